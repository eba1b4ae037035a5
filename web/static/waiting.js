// What a labeler reads while no pair is on: why, until when, and how the agent does so far.
import { request, timeOfDay } from './api.js';
import { drawCurve, foldEvents } from './chart.js';
import { setText } from './words.js';

const HEADINGS = {
  open: 'The next pair is on its way',
  saving: 'Saving your answer',
  offline: 'No connection to the server',
  drawing: 'Drawing the next clips',
  waiting: 'The agent is practising',
  held: 'Others are on the remaining pairs',
  done: 'All done — thank you',
  paused: 'Paused for now',
  failed: 'This run cannot go on',
};

/** The curve is asked for at most this often. */
const CURVE_MS = 2_000;

const $ = (id) => document.getElementById(id);

export class WaitingCard {
  #run;
  #hasCurve;
  #curveAt = 0;

  /** @param hasCurve whether whoever waits may see how the agent does */
  constructor(run, hasCurve) {
    this.#run = run;
    this.#hasCurve = hasCurve;
  }

  /** @param isPreparing whether pairs are on their way to this page */
  tell(state, isPreparing) {
    const card = $('waiting');
    if (card.dataset.kind !== state.kind) this.#curveAt = 0;
    card.dataset.kind = state.kind;
    // Questions that are open for the server, none of them left here: its word on the last answer is due.
    const isSaving = state.kind === 'open' && !isPreparing;
    setText('waiting-title', HEADINGS[isSaving ? 'saving' : state.kind] ?? state.kind);
    const until = state.until ? ` Until ${timeOfDay(state.until).slice(0, 5)}.` : '';
    setText('waiting-text', state.kind === 'open' ? '' : `${state.message ?? ''}${until}`);
    const progress = state.phase?.progress;
    const hasProgress = typeof progress === 'number' && state.kind === 'waiting';
    $('waiting-bar').hidden = !hasProgress;
    if (hasProgress) $('waiting-bar').value = progress;
    $('to-run').hidden = !['done', 'failed', 'paused'].includes(state.kind);
    this.#tellCurve(state.kind);
  }

  /** Success so far, while there is nothing else to look at. */
  async #tellCurve(kind) {
    if (!this.#hasCurve || !['waiting', 'done'].includes(kind) || Date.now() - this.#curveAt < CURVE_MS) return;
    this.#curveAt = Date.now();
    const events = await request('GET', `/api/v1/runs/${this.#run}/metrics`).catch(() => null);
    const points = events ? foldEvents(events).success : [];
    $('waiting-curve').hidden = points.length < 2;
    if (points.length >= 2) drawCurve($('waiting-svg'), { series: [{ name: 'success', points }], range: [0, 1], format: percent });
  }
}

const percent = (value) => `${Math.round(value * 100)} %`;
