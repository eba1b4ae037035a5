// What a labeler reads while no pair is on: why, until when, and how the agent does so far.
import { request, timeOfDay } from './api.js';
import { drawCurve, foldEvents, percent } from './chart.js';
import { $, setText } from './page.js';

const HEADINGS = {
  open: 'The next pair is on its way',
  saving: 'Saving your answer',
  offline: 'No connection to the server',
  stranger: 'Who is answering?',
  keepless: 'Answers cannot be kept here',
  undecodable: 'The clips cannot be shown here',
  late: 'The next pair is late',
  drawing: 'Drawing the next clips',
  waiting: 'The agent is practising',
  held: 'Others are on the remaining pairs',
  done: 'All done — thank you',
  paused: 'Paused for now',
  failed: 'This run cannot go on',
  over: 'This study takes no answers now',
};

/** The curve is asked for at most this often. */
const CURVE_MS = 2_000;

export class WaitingCard {
  #run;
  #isStudy;
  #curveAt = 0;
  #hasFocus = false;

  /** @param isStudy fixed pairs and no agent: nobody sees how it does, and another task may follow */
  constructor(run, isStudy) {
    this.#run = run;
    this.#isStudy = isStudy;
  }

  /** @param isPreparing whether pairs are on their way to this page */
  tell(state, isPreparing) {
    const card = $('waiting');
    if (card.dataset.kind !== state.kind) this.#curveAt = 0;
    card.dataset.kind = state.kind;
    // Questions that are open for the server, none of them left here: its word on the last answer is due.
    const isSaving = state.kind === 'open' && !isPreparing;
    const isLast = this.#isStudy && state.kind === 'done';
    const heading = HEADINGS[isSaving ? 'saving' : state.kind] ?? state.kind;
    setText('waiting-title', isLast ? 'That was the last pair' : heading);
    const until = state.until ? ` Until ${timeOfDay(state.until).slice(0, 5)}.` : '';
    const message = isLast ? 'All pairs here are answered. Go on, or go back to change an answer.' : `${state.message ?? ''}${until}`;
    setText('waiting-text', state.kind === 'open' ? '' : message);
    const progress = state.phase?.progress;
    const hasProgress = typeof progress === 'number' && state.kind === 'waiting';
    $('waiting-bar').hidden = !hasProgress;
    if (hasProgress) $('waiting-bar').value = progress;
    $('to-run').hidden = isLast || !['done', 'failed', 'over', 'paused'].includes(state.kind);
    if (this.#isStudy) this.#offerWayOn(isLast);
    this.#tellCurve(state.kind);
  }

  /** The way on takes the focus once, when it appears: Enter goes on. */
  #offerWayOn(isOffered) {
    const link = $('to-seat');
    link.hidden = !isOffered;
    if (isOffered && !this.#hasFocus) link.focus(); // refused while the card is hidden or under a dialog
    this.#hasFocus = isOffered && (this.#hasFocus || document.activeElement === link);
  }

  /** Success so far, while there is nothing else to look at. */
  async #tellCurve(kind) {
    if (this.#isStudy || !['waiting', 'done'].includes(kind) || Date.now() - this.#curveAt < CURVE_MS) return;
    this.#curveAt = Date.now();
    const events = await request('GET', `/api/v1/runs/${this.#run}/metrics`).catch(() => null);
    const points = events ? foldEvents(events).success : [];
    $('waiting-curve').hidden = points.length < 2;
    if (points.length >= 2) drawCurve($('waiting-svg'), { series: [{ name: 'success', points }], range: [0, 1], format: percent });
  }
}
