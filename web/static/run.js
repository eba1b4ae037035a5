// The researcher's page of one run: curves and state that follow the run as it goes.
import { request, timeOfDay } from './api.js';
import { addEvent, compact, drawCurve, emptyCurves, percent } from './chart.js';
import { $, setText } from './page.js';
import './pair.js';

const page = $('run');
const run = page.dataset.run;
const fixed = (value) => (Math.abs(value) < 10 ? value.toFixed(2) : compact(value));

/** What each panel of the page shows; `id` is its <figure>. */
const PANELS = [
  { id: 'success', format: percent, range: [0, 1], lines: [['success', 'success']] },
  { id: 'return', format: compact, lines: [['evaluation', 'return'], ['training', 'trainingReturn', true]] },
  { id: 'accuracy', format: percent, range: [0.5, 1], lines: [['agrees with the answers', 'accuracy']] },
  { id: 'correlation', format: fixed, range: [0, 1], lines: [['correlation', 'correlation']] },
  { id: 'gap', format: fixed, lines: [['chosen', 'gapChosen'], ['pool', 'gapPool', true]] },
  { id: 'disagreement', format: fixed, lines: [['chosen', 'disagreementChosen'], ['pool', 'disagreementPool', true]] },
  { id: 'labels', format: compact, lines: [['answers', 'labels']] },
  { id: 'speed', format: compact, lines: [['steps a second', 'speed']] },
];

/** Kinds of event after which the server draws other clips or complaints into the page. */
const DRAWN = ['clips', 'answer', 'clip_failed', 'damaged_checkpoint', 'damaged_history'];

const curves = emptyCurves();
let isDrawing = false;

function start() {
  draw();
  listen();
  document.addEventListener('visibilitychange', drawSoon);
  tellState();
  setInterval(tellState, 5_000);
}

/** The answers of a round, to look at again. */
const answersOf = (mark) => `/labels?run=${run}&round=${mark.y + 1}`;

function draw() {
  isDrawing = false;
  let isFirst = true; // the same marks are on every panel; the Tab key stops at them once
  const xMax = Number(page.dataset.totalSteps) || curves.total_steps;
  for (const panel of PANELS) {
    const series = panel.lines.map(([name, key, isQuiet]) => ({ name, points: curves[key], isQuiet }));
    const [first] = series;
    const figure = $(`curve-${panel.id}`);
    const isEmpty = series.every((line) => line.points.length === 0);
    figure.toggleAttribute('data-empty', isEmpty);
    const now = first.points.at(-1);
    figure.querySelector('[data-show="now"]').textContent = now ? panel.format(now.y) : '–';
    if (isEmpty) continue;
    if (panel.id === 'success') setText('success-now', percent(now.y));
    const marks = { marks: curves.sessions, href: answersOf, isTabbed: isFirst };
    drawCurve(figure.querySelector('svg'), { series, range: panel.range, format: panel.format, xMax, ...marks });
    isFirst = false;
  }
}

function drawSoon() {
  if (isDrawing) return;
  isDrawing = true;
  requestAnimationFrame(draw);
}

/** Until the events are asked for again, where somebody on the way has refused them. */
const REFUSED_MS = 3_000;

/**
 * The server's events, from the first one of the run; after a lost connection the browser asks
 * again by itself from the last one it has seen. What comes twice is taken in once.
 */
function listen() {
  const source = new EventSource(`/api/v1/runs/${run}/events`);
  const take = (message) => {
    let event;
    try {
      event = JSON.parse(message.data);
    } catch {
      return;
    }
    const isHere = document.visibilityState === 'visible';
    addEvent(curves, event);
    if (isHere) drawSoon();
    if (event.kind !== 'metrics') tellStateSoon();
    if (DRAWN.includes(event.kind)) tellClipsSoon();
  };
  source.onmessage = take;
  for (const kind of ['phase', 'metrics', 'session_offered', 'session_closed', 'refitted', 'evaluation', 'finished', 'answer', 'clips', 'clip_failed', 'damaged_checkpoint', 'damaged_history', 'state']) {
    source.addEventListener(kind, take);
  }
  source.onopen = () => page.removeAttribute('data-offline');
  source.onerror = () => {
    page.setAttribute('data-offline', '');
    // Any reply but the events, as a proxy's while the server starts again, ends it for the browser.
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, REFUSED_MS);
  };
}

let stateTimer = 0;
function tellStateSoon() {
  if (stateTimer) return;
  stateTimer = setTimeout(() => {
    stateTimer = 0;
    tellState();
  }, 300);
}

async function tellState() {
  if (document.visibilityState !== 'visible') return;
  const now = await request('GET', `/api/v1/runs/${run}`).catch(() => null);
  if (!now) return;
  const { kind, message, since, next } = now.state;
  page.dataset.state = kind;
  setText('state-message', message);
  const isUp = ['training', 'waiting_for_labels'].includes(kind);
  page.toggleAttribute('data-no-questions', !isUp || now.labels >= now.budget);
  setText('state-since', since ? `${kind === 'finished' ? 'at' : 'since'} ${timeOfDay(since)}` : '');
  setText('state-next', next ?? '');
  setText('labels-used', `${now.labels} of ${now.budget}`);
  $('labels-bar').max = now.budget;
  $('labels-bar').value = now.labels;
  setText('steps-done', compact(now.step));
  $('steps-bar').max = now.total_steps;
  $('steps-bar').value = now.step;
}

let clipsTimer = 0;
/** New clips are drawn by the server into the same words and pictures; this fetches that part of the page. */
function tellClipsSoon() {
  if (clipsTimer) return;
  clipsTimer = setTimeout(async () => {
    clipsTimer = 0;
    const response = await fetch(location.pathname, { headers: { accept: 'text/html' } }).catch(() => null);
    if (!response?.ok) return;
    const fresh = new DOMParser().parseFromString(await response.text(), 'text/html');
    for (const id of ['demonstrations', 'pairs', 'broken']) replaceIfChanged(id, fresh);
  }, 1_500);
}

function replaceIfChanged(id, fresh) {
  const [old, now] = [$(id), fresh.getElementById(id)];
  if (!old || !now || old.dataset.version === now.dataset.version) return;
  old.replaceWith(document.adoptNode(now));
}

start();
