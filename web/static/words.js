// The labeler's page's small words: what is saved, what went wrong, what is read aloud.
import { timeOfDay } from './api.js';

const $ = (id) => document.getElementById(id);

export function setText(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

export function tellUnsaved() {
  $('saved').dataset.state = 'sending';
}

export function tellSaved(storedAt) {
  $('saved').dataset.state = 'saved';
  setText('saved', `saved ${timeOfDay(storedAt)}`);
}

export function tellWaitingAnswers({ count, isOffline }) {
  if (count === 0) return;
  $('saved').dataset.state = 'unsent';
  const what = count === 1 ? '1 answer is kept here' : `${count} answers are kept here`;
  setText('saved', isOffline ? `no connection: ${what} and will be sent when it is back` : `the server is busy: ${what} and will be sent soon`);
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
