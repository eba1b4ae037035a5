// The labeler's page's small words: what is saved, what went wrong, what is read aloud.
import { timeOfDay } from './api.js';
import { $, setText } from './page.js';

/** Saving that takes no longer is not worth a word. */
const SAVING_MS = 300;

let savingTimer = 0;
/** When the last answer was stored that this page heard of. */
let lastSaved = null;

/** An answer is on its way. */
export function tellUnsaved() {
  $('saved').dataset.state = 'sending';
  savingTimer ||= setTimeout(tellSaving, SAVING_MS);
}

/** To be seen, not to be read aloud: on a slow connection it is so after every answer. */
function tellSaving() {
  savingTimer = 0;
  const words = document.createElement('span');
  words.setAttribute('aria-hidden', 'true');
  words.textContent = 'saving…';
  $('saved').dataset.state = 'sending';
  $('saved').replaceChildren(words);
}

function stopSaving() {
  clearTimeout(savingTimer);
  savingTimer = 0;
}

/** One answer is stored; a newer one may be on its way, until `tellAllSent`. */
export function tellSaved(storedAt) {
  stopSaving();
  lastSaved = storedAt;
  showSaved();
  savingTimer = setTimeout(tellSaving, SAVING_MS);
}

/** No answer of this browser is on its way, whoever sent the last one; some may be undelivered. */
export function tellAllSent() {
  stopSaving();
  if ($('saved').dataset.state === 'sending' || $('undelivered').hidden) showSaved();
}

function showSaved() {
  $('saved').dataset.state = lastSaved ? 'saved' : '';
  setText('saved', lastSaved ? `saved ${timeOfDay(lastSaved)}` : '');
}

const WAITS = {
  offline: (kept) => `no connection: ${kept} and will be sent when it is back`,
  busy: (kept) => `the server is busy: ${kept} and will be sent soon`,
  stranger: (kept) => `not sent: ${kept}`,
};

/** @param {{count: number, why: 'offline'|'busy'|'stranger'|null}} waiting answers that do not get through now */
export function tellWaitingAnswers({ count, why }) {
  if (count === 0) return tellAllSent();
  stopSaving();
  $('saved').dataset.state = 'unsent';
  setText('saved', WAITS[why](count === 1 ? '1 answer is kept here' : `${count} answers are kept here`));
}

/** Whether the server knows who answers here; where it does not, the page shows the way back in. */
export function tellKnown(isKnown) {
  $('stranger').hidden = isKnown;
}

/** Answers that stay in this browser. */
export function tellUndelivered({ count }) {
  $('undelivered').hidden = count === 0;
  if (count === 0) return;
  stopSaving();
  $('saved').dataset.state = 'unsent';
  const [answers, were, are] = count === 1 ? ['1 answer', 'It was', 'It is'] : [`${count} answers`, 'They were', 'They are'];
  setText('saved', `not sent: ${answers} kept here`);
  setText('undelivered', `${answers} could not be delivered. ${were} given under another name, or to a run that is gone. ${are} kept in this browser and tried again whenever this page is opened.`);
}

let noticeTimer = 0;

export function notice(text, isBad = false) {
  const box = $('notice');
  box.textContent = text;
  box.dataset.tone = isBad ? 'bad' : 'plain';
  box.hidden = false;
  clearTimeout(noticeTimer);
  noticeTimer = setTimeout(() => { box.hidden = true; }, 12_000);
}

export function announce(text) {
  $('announcer').textContent = text;
}
