// The researcher's page of a study: follows the preparation, then loads the page that is ready.
import { request } from './api.js';
import { $, setText } from './page.js';

const page = $('study');
const EVERY_MS = 1_000;

async function follow() {
  const study = await request('GET', `/api/v1/studies/${page.dataset.study}`).catch(() => null);
  if (study && study.state !== 'preparing') return location.reload();
  if (study) {
    const bar = $('study-bar');
    bar.max = Math.max(study.n_items, 1);
    bar.value = study.n_drawn;
    const words = study.n_items ? `drawing clips: ${study.n_drawn} of ${study.n_items} pairs` : study.message;
    setText('study-message', words);
  }
  setTimeout(follow, EVERY_MS);
}

if (page.dataset.state === 'preparing') setTimeout(follow, EVERY_MS);
for (const field of document.querySelectorAll('[data-link]')) field.addEventListener('focus', () => field.select());
