// The labeler's page: one key stores the answer and shows the next pair.
import { recall, remember } from './choices.js';
import { canShowClips } from './clip.js';
import { KeptFocus } from './focus.js';
import { isPlain, meaningOf } from './keys.js';
import { Outbox } from './outbox.js';
import { $ } from './page.js';
import './pair.js';
import { preparePair, ReadyPairs, releasePair } from './ready.js';
import { Settled } from './settled.js';
import { WaitingCard } from './waiting.js';
import { announce, notice, tellAllSent, tellKnown, tellSaved, tellUndelivered, tellUnsaved, tellWaitingAnswers } from './words.js';

const WORDS = { left: 'left is better', right: 'right is better', equal: 'about the same', same: 'same stage', different: 'different stages', skip: 'skipped' };
/** Nobody judges a pair this soon: a key that bounced, or was meant for the pair before. */
const TOO_SOON_MS = 150;
/** How often a waiting page asks whether there is something to do. */
const WAITING_MS = 1_000;
/** Who goes back to a pair that is longer on its way is offered to stay. */
const SLOW_MS = 500;
/** A clip that cannot be shown is passed over again, where this browser could not keep that it was. */
const PASS_AGAIN_MS = 5_000;
/** After so many pairs in a row that cannot be shown it is not the pairs. */
const MOST_BROKEN = 3;

const page = $('label');
const run = page.dataset.run;
const player = $('pair');
const guidance = $('guidance');
/** Names what this labeler has read; another person at the same browser has not. */
const whoRead = `stair-guidance-${page.dataset.labeler}`;
const reasons = $('reasons');
/** A study: fixed pairs, practice with a word on each answer, and a task after this one. */
const isStudy = 'study' in page.dataset;
const feedback = $('feedback');
const waiting = new WaitingCard(run, isStudy);
const focus = new KeptFocus($('working'));

/** What is on: `{lease, left, right}`, and whether it is an answered one that was gone back to. */
let current = null;
let isChanging = false;
/** Pair that waits, prepared, while an answered one is changed, with what was watched of it: `watch`. */
let interrupted = null;
let history = [];
/** Ends the wait for an answered pair that is fetched again; till then what is on stays on and takes no answer. */
let turningBack = null;
/** When the pair that is on was first there with nothing over it. */
let shownAt = 0;
let pressedAt = 0;
let settled;
let usesShortcuts = recall('stair-shortcuts') !== 'off';
let outbox;
/** Queries whose clips could not be shown, since the last pair that could. */
const broken = new Set();
/** Why nothing more is asked here until the page is loaded again: what the card says. */
let stuck = null;
/** This browser's other tabs, told of answers. */
let tabs;
let ready;

async function start() {
  waiting.tell({ kind: 'open' }, true);
  setStage('waiting');
  try {
    await openKept();
  } catch (reason) {
    console.error('answers cannot be kept:', reason);
    return stop('keepless', 'This browser keeps no data for this site. Allow it, or use another browser.');
  }
  if (!(await canShowClips())) {
    return stop('undecodable', 'The clips are H.264 video, which this browser does not play. Any current Firefox, Chrome, Edge or Safari does.');
  }
  const shown = () => [current, interrupted].filter(Boolean).map((pair) => pair.lease);
  ready = new ReadyPairs(run, (lease) => settled.has(lease), shown);
  listen();
  outbox.start();
  tellShortcuts();
  greet();
  await ready.refill();
  proceed();
}

/** What this browser keeps of answers. */
async function openKept() {
  outbox = await Outbox.open(run, page.dataset.labeler);
  tabs = new BroadcastChannel('stair-answered');
  history = await outbox.history();
  settled = new Settled(await outbox.answeredLeases(), history);
}

/** Asks for no answer that could be lost, or about clips that cannot be seen. */
function stop(kind, message) {
  stuck = { kind, message };
  if (!current) tellStuck();
}

function tellStuck() {
  $('help').hidden = true; // there is nothing to compare
  waiting.tell(stuck, false);
  setStage('waiting');
  tellUndo();
}

// --- showing -----------------------------------------------------------------------------------

/** Puts the next prepared pair on, or says what is being waited for. */
function proceed() {
  if (current || turningBack) return;
  if (stuck && !interrupted) return tellStuck();
  const next = interrupted ?? ready.take();
  interrupted = null;
  if (next) show(next, null);
  else {
    pressedAt = 0;
    if (page.dataset.stage === 'working') tellWaiting({ kind: 'open' });
    setStage('waiting');
    tellUndo();
    refill();
  }
}

function show(pair, before) {
  broken.clear();
  current = pair;
  isChanging = before !== null;
  const isStage = pair.lease.question === 'same_stage';
  page.dataset.question = pair.lease.question;
  $('help').hidden = false;
  $('question').textContent = isStage ? 'Are both at the same stage of the task?' : 'Which one does better?';
  $('practice').hidden = !pair.lease.practice;
  $('again').hidden = !isChanging;
  if (isChanging) $('before').textContent = WORDS[before] ?? before;
  tellUndo();
  page.dataset.shown = '';
  setShownAt(Infinity);
  setStage('working');
  focus.restore(document.querySelector(`.answers.${isStage ? 'stage' : 'preference'} button`));
  player.show(pair.left, pair.right, pair.watch);
}

/** Takes off a pair that is not to be answered here any more. */
function takeOff() {
  const leaving = current;
  current = null;
  player.clear();
  releasePair(leaving);
  proceed();
}

function setStage(stage) {
  if (page.dataset.stage === stage) return;
  page.dataset.stage = stage;
  if (stage === 'waiting') player.clear();
  $('working').hidden = stage !== 'working';
  $('waiting').hidden = stage !== 'waiting';
}

function firstFrameIsOn() {
  if (pressedAt) performance.measure('key-to-first-frame', { start: pressedAt });
  pressedAt = 0;
  page.dataset.shown = current?.lease.lease_id ?? '';
}

function setShownAt(time) {
  shownAt = time;
  page.dataset.shownAt = String(time);
}

// --- answering ---------------------------------------------------------------------------------

/** Stores an answer in the browser, shows what comes next, and lets the outbox send it. */
function answer(word, input, reason = null, pressed = performance.now()) {
  const pair = current;
  if (!pair || turningBack || performance.now() - shownAt < TOO_SOON_MS) return;
  const body = {
    answer: word,
    reason,
    guidance_sha256: page.dataset.guidance,
    timing: { ...player.watched, input },
  };
  const wasChange = isChanging;
  const before = wasChange ? lastAnswer(pair.lease) : null;
  current = null;
  isChanging = false;
  pressedAt = pressed;
  tellUnsaved();
  const kept = wasChange ? keepChange(pair, body) : keepFirst(pair, body);
  if (pair.lease.practice) tellPractice(pair.lease.practice, word);
  proceed();
  releasePair(pair);
  // Once it is kept, it is on its way, whatever was said of those before it meanwhile.
  kept.then(tellUnsaved, (failure) => notKept(pair.lease, before, failure));
}

/** As far as this page knows. */
function lastAnswer(lease) {
  return history.find((row) => row.lease_id === lease.lease_id)?.answer ?? null;
}

/** What most people would say, right after the answer. */
function tellPractice({ expects, because }, word) {
  const isRight = word === expects;
  $('feedback-title').textContent = isRight ? 'Yes' : `Most people say: ${WORDS[expects]}`;
  $('feedback-text').textContent = because;
  cover(feedback);
}

async function keepFirst({ lease }, body) {
  settle(lease, body.answer);
  history = history.filter((row) => row.lease_id !== lease.lease_id);
  history.push({ lease_id: lease.lease_id, lease, answer: body.answer });
  const isNew = await outbox.answer(lease, body);
  if (isNew) tabs.postMessage({ lease, answer: body.answer });
  else notice('This pair was answered in another tab already; that answer stands.');
}

async function keepChange({ lease }, body) {
  noteChange(lease, body.answer);
  await outbox.change(lease, body);
  tabs.postMessage({ lease, answer: body.answer });
}

function noteChange(lease, word) {
  settle(lease, word);
  const row = history.find((kept) => kept.lease_id === lease.lease_id);
  if (row) row.answer = word;
}

/** The answer is lost: the one before it stands, or none does and the pair is asked about again. */
async function notKept(lease, before, failure) {
  const then = before ? `It is still: ${WORDS[before]}` : 'The pair is shown again';
  notice(`This browser could not keep the answer (${failure.message}). ${then}.`, true);
  if (before) noteChange(lease, before);
  else forgetAnswer(lease);
  refill();
  if (await outbox.isEmpty().catch(() => true)) tellAllSent();
}

/** Notes an answer, and lets go of what waits here and is settled by it. */
function settle(lease, word) {
  settled.note(lease, word);
  ready.dropTaken();
  if (!interrupted || !settled.has(interrupted.lease)) return;
  releasePair(interrupted);
  interrupted = null;
}

function undoable() {
  const at = isChanging ? history.findIndex((row) => row.lease_id === current.lease.lease_id) : history.length;
  return at > 0 ? history[at - 1] : null;
}

/** The way back is on the bench, and on the card while there is no pair. */
function tellUndo() {
  const isPossible = undoable() !== null;
  $('undo').disabled = !isPossible;
  $('undo-waiting').hidden = !isPossible;
}

/** Goes back to the answered pair before the one that is on, or the last one. */
async function undo() {
  const row = undoable();
  if (!row || turningBack) return;
  const turning = new AbortController();
  turningBack = turning;
  setTimeout(() => { if (turningBack === turning) offerToStay(true); }, SLOW_MS);
  try {
    const pair = await preparePair(row.lease, { cancelled: turning.signal });
    const before = await standing(row);
    if (turning.signal.aborted) return releasePair(pair);
    if (isChanging) releasePair(current);
    else if (current) interrupted = { ...current, watch: player.watch };
    show(pair, before);
    announce(`Back to a pair you answered: ${WORDS[before]}. Answer again to change it.`);
  } catch (reason) {
    if (turning.signal.aborted) return;
    history = history.filter((kept) => kept !== row); // the next press goes further back
    notice(`That pair can no longer be shown: ${reason.message}`, true);
  } finally {
    if (turningBack === turning) turnedBack();
  }
}

/** The newest answer to a pair, given here or in another tab. */
async function standing(row) {
  const kept = await outbox.history().catch(() => []);
  return kept.find((fresh) => fresh.lease_id === row.lease_id)?.answer ?? row.answer;
}

/** The answered pair is there, or is not waited for any more. */
function turnedBack() {
  turningBack = null;
  offerToStay(false);
  if (!current) proceed();
  tellUndo();
}

/** Goes on with what is on, and does not wait for the answered pair. */
function stayHere() {
  turningBack?.abort();
  if (turningBack) turnedBack();
}

/** A way out, beside the way back, while an answered pair is long on its way. */
function offerToStay(isOffered) {
  for (const button of document.querySelectorAll('[data-stay]')) {
    if (!isOffered && button === document.activeElement) button.previousElementSibling.focus();
    button.hidden = !isOffered;
  }
  if (isOffered) announce('That pair is still on its way. “Stay here” goes on without it.');
}

/** Leaves an answered pair as it was. */
function leaveUnchanged() {
  if (turningBack) return stayHere();
  if (!isChanging) return;
  const leaving = current;
  current = null;
  isChanging = false;
  proceed();
  releasePair(leaving);
}

/**
 * Nobody pressed anything: the page itself passes the pair over, and says why. Where one after the other
 * cannot be shown, it asks no more: what is skipped in somebody's name is not asked again.
 */
async function skipBroken({ lease, reason }) {
  broken.add(lease.query_id);
  if (broken.size > MOST_BROKEN) return stop('undecodable', `${MOST_BROKEN} pairs in a row could not be shown (${reason.message}) and were passed over. The others are left for another browser, or a later time. Please tell whoever asked you to answer.`);
  settle(lease, 'skip');
  if (current && !isChanging && settled.has(current.lease)) takeOff();
  const body = {
    answer: 'skip',
    reason: `passed over by the page: ${reason.message}`,
    guidance_sha256: page.dataset.guidance,
    timing: { visible_ms: 0, hidden_ms: 0, loops: 0, seeks: 0, speed: 1, dropped_frames: 0, input: null },
  };
  try {
    await outbox.answer(lease, body);
  } catch (failure) {
    notice(`One pair cannot be shown, and this browser could not keep a note of it (${failure.message}).`, true);
    setTimeout(() => askAgain(lease), PASS_AGAIN_MS);
    return;
  }
  notice('One pair could not be shown and was passed over. The researcher is told.', true);
  refill();
}

// --- the server's words ------------------------------------------------------------------------

let refillTimer = 0;

async function refill() {
  clearTimeout(refillTimer);
  if (stuck) return;
  await ready.refill();
  if (!current) proceedIfReady();
  const isIdle = !current && !ready.isPreparing;
  clearTimeout(refillTimer); // several may have waited for the same reply
  if (isIdle) refillTimer = setTimeout(refill, WAITING_MS);
}

function proceedIfReady() {
  if (ready.isNextReady || interrupted) proceed();
}

function tellProgress({ state, progress }) {
  const { answered: n, budget, session, session_answered, session_size } = progress;
  $('answers').textContent = `${n} of ${budget} answers`;
  $('bar').max = budget;
  $('bar').value = n;
  const hasSession = session !== null && session !== undefined && session_size;
  $('session').textContent = hasSession ? `round ${session + 1}: ${session_answered} of ${session_size}` : '';
  if (page.dataset.stage === 'waiting' || !current) tellWaiting(state);
}

let nTold = 0;

/** A study's last pair is done, and the way on open, once every answer is with the server. */
async function tellWaiting(state) {
  if (stuck) return; // it is told already
  const turn = (nTold += 1);
  const isUnsent = isStudy && state.kind === 'done' && !(await outbox.isEmpty());
  if (turn === nTold) waiting.tell(isUnsent ? { kind: 'open' } : state, ready.isPreparing);
}

// --- what lies over the pair -------------------------------------------------------------------

function cover(dialog) {
  player.cover();
  dialog.showModal();
}

function uncovered() {
  if (!document.querySelector('dialog[open]')) player.uncover();
}

/** Guidance comes before a labeler's first pair, and again when its words have changed. */
function greet() {
  if (recall(whoRead) === page.dataset.guidance) return;
  cover(guidance);
}

/** Once more, in the middle of it. */
function openGuidance() {
  $('close-guidance').textContent = 'Go on';
  cover(guidance);
}

function tellShortcuts() {
  $('shortcuts').checked = usesShortcuts;
  page.toggleAttribute('data-no-shortcuts', !usesShortcuts);
}

// --- input -------------------------------------------------------------------------------------

function listen() {
  document.addEventListener('keydown', keyPressed);
  player.addEventListener('firstframe', firstFrameIsOn);
  player.addEventListener('seen', () => setShownAt(performance.now()));
  page.addEventListener('click', clicked);
  ready.addEventListener('state', ({ detail }) => {
    outbox.wake(detail.leases);
    tellKnown(true);
    tellProgress(detail);
  });
  ready.addEventListener('ready', () => { if (!current) proceedIfReady(); });
  ready.addEventListener('broken', ({ detail }) => skipBroken(detail));
  ready.addEventListener('late', ({ detail }) => late(detail.reason));
  ready.addEventListener('gone', ({ detail }) => takenByOthers(detail.lease));
  ready.addEventListener('offline', () => offline());
  ready.addEventListener('refused', ({ detail }) => refused(detail));
  outbox.addEventListener('saved', ({ detail }) => {
    tellSaved(detail.stored_at);
    tellKnown(true);
    refill(); // only now does the server count this answer
  });
  outbox.addEventListener('waiting', ({ detail }) => {
    tellWaitingAnswers(detail);
    if (detail.why === 'stranger') tellKnown(false);
  });
  outbox.addEventListener('undelivered', ({ detail }) => tellUndelivered(detail));
  outbox.addEventListener('refused', ({ detail: { message, lease, standing } }) => {
    notice(`The server did not take an answer: ${message}`, true);
    if (standing === null) {
      tabs.postMessage({ lease, answer: null });
      forgetAnswer(lease);
    } else if (standing !== undefined) noteChange(lease, standing);
    refill();
  });
  tabs.addEventListener('message', ({ data }) => {
    if (data.answer !== null) answeredElsewhere(data);
    else askAgain(data.lease);
  });
  for (const dialog of document.querySelectorAll('dialog')) dialog.addEventListener('close', uncovered);
  guidance.addEventListener('close', () => remember(whoRead, page.dataset.guidance));
  $('shortcuts').addEventListener('change', () => {
    usesShortcuts = $('shortcuts').checked;
    remember('stair-shortcuts', usesShortcuts ? 'on' : 'off');
    tellShortcuts();
  });
}

function offline() {
  if (current) return;
  tellWaiting({ kind: 'offline', message: 'No pair is left to show here. This page tries again by itself, and every answer is kept.' });
}

/** The next pair's clips do not come, though the server is there. */
function late(reason) {
  if (!current) tellWaiting({ kind: 'late', message: `Its clips have not come through: ${reason.message}. This page goes on trying.` });
}

/** Nobody was seen here for so long that somebody else was asked. */
function takenByOthers(lease) {
  if (interrupted?.lease.lease_id === lease.lease_id) {
    releasePair(interrupted);
    interrupted = null;
  }
  if (!isChanging && current?.lease.lease_id === lease.lease_id) {
    notice('Somebody else has that pair by now; here is the next one.');
    takeOff();
  }
  refill();
}

function refused(problem) {
  const isStranger = problem.status === 401;
  if (isStranger) tellKnown(false);
  if (current) return;
  const isOver = problem.body.type === '/problems/study-state';
  tellWaiting(isStranger ? { kind: 'stranger' } : { kind: isOver ? 'over' : 'failed', message: problem.message });
}

function answeredElsewhere({ lease, answer: word }) {
  settle(lease, word);
  if (!current) refill();
  else if (!isChanging && settled.has(current.lease)) {
    notice('You answered this pair in another tab; here is the next one.');
    takeOff();
  }
}

/** No answer to this lease stands: if it is offered again, it is asked as if for the first time. */
function forgetAnswer(lease) {
  settled.forget(lease);
  history = history.filter((row) => row.lease_id !== lease.lease_id);
  if (isChanging && current.lease.lease_id === lease.lease_id) {
    isChanging = false;
    $('again').hidden = true;
  }
  tellUndo();
}

function askAgain(lease) {
  forgetAnswer(lease);
  refill();
}

function keyPressed(event) {
  if (!usesShortcuts || !isPlain(event)) return;
  const { answer: word, player: control, page: deed } = meaningOf(event, current?.lease.question);
  if (reasons.open) return void (event.repeat || reasonPressed(event));
  if (feedback?.open) return; // Enter and Escape are the dialog's own
  if (guidance.open) {
    if (deed === 'guidance') guidance.close();
    return;
  }
  if (deed === 'guidance') return act(event, openGuidance);
  const isField = event.target.matches('input, textarea, select');
  const isScrub = event.target.dataset?.do === 'scrub';
  if (isField && !isScrub) return;
  if (word) return act(event, () => answer(word, 'key', null, event.timeStamp));
  if (deed === 'undo') return act(event, undo);
  if (deed === 'leave') return act(event, leaveUnchanged);
  if (deed === 'unsure' && current) return act(event, askReason);
  const pressesButton = event.key === ' ' && event.target.matches('button, a, summary');
  if (control && current && !pressesButton) act(event, () => player.do(control));
}

function act(event, what) {
  event.preventDefault();
  what();
}

function reasonPressed(event) {
  const button = reasons.querySelector(`[data-key="${CSS.escape(event.key)}"]`);
  if (button) act(event, () => skip(button.value, 'key'));
}

function askReason() {
  if (turningBack) return; // no answer is taken
  cover(reasons);
}

function skip(reason, input) {
  reasons.close();
  answer('skip', input, reason);
}

function clicked(event) {
  const button = event.target.closest('button');
  if (!button) return;
  // The second click of a double click was meant for the pair before.
  const isSecondClick = event.detail > 1;
  const input = event.detail === 0 ? 'key' : 'pointer';
  if (button.dataset.answer && !isSecondClick) answer(button.dataset.answer, input, null, event.timeStamp);
  else if (button.dataset.reason !== undefined) skip(button.value, input);
  else if (button.id === 'undo' || button.id === 'undo-waiting') undo();
  else if (button.id === 'unsure') askReason();
  else if (button.dataset.stay !== undefined) stayHere();
  else if (button.id === 'leave') leaveUnchanged();
  else if (button.id === 'help') openGuidance();
  else if (button.dataset.close !== undefined) button.closest('dialog').close();
}

start();
