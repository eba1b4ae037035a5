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

const WAITS = {
  offline: (kept) => `no connection: ${kept} and will be sent when it is back`,
  busy: (kept) => `the server is busy: ${kept} and will be sent soon`,
  stranger: (kept) => `not sent: ${kept}`,
};

/** @param {{count: number, why: 'offline'|'busy'|'stranger'|null}} waiting answers that do not get through now */
export function tellWaitingAnswers({ count, why }) {
  if (count === 0) return;
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
