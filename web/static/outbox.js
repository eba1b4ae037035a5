// Keeps every answer in the browser until the server has said that it keeps it.
//
// An answer is written to IndexedDB before it is sent, and taken out when it is acknowledged: a
// lost connection, a closed lid, a restarted server or a lost cookie lose nothing. Sending twice
// is harmless, the server stores an answer to a lease once. Of acknowledged answers the newest of
// each run stay, to be gone back to.
import { notOurs, Problem, request } from './api.js';

/** Answered pairs that can be gone back to. */
export const HISTORY = 50;
const FIRST_RETRY_MS = 500;
const LAST_RETRY_MS = 5_000;

/**
 * @typedef {object} Answered one answered pair: `{lease_id, run, labeler, lease, answer, answer_id, at}`;
 *   `answer_id` is null until the server has acknowledged it
 */

/**
 * Fires `saved` ({stored_at, lease_id}) · `waiting` ({count, why}) while nothing gets through: `offline`,
 * `busy`, or `stranger` when the server does not know who answers · `undelivered` ({count}) when it does
 * not take some from here, which stay in this browser · `refused` ({message, lease, standing}) when it
 * does not take one at all; `standing` is the word that stands for its lease, null when none does and it
 * can be asked again, undefined when this browser does not know it.
 */
export class Outbox extends EventTarget {
  #database;
  #run;
  #labeler;
  #sending = false;
  /** Something was answered, or heard of, while the last was being sent. */
  #isToSendAgain = false;
  #retryMs = FIRST_RETRY_MS;
  #timer = 0;
  /** Leases whose answers the server does not take from here; tried again when it offers them, or a page is opened. */
  #undelivered = new Set();

  /**
   * @param {string} run only this run's history is told; every run's unsent answers are sent
   * @param {string} labeler who answers on this page; what others answered in this browser is not gone back to
   */
  static async open(run, labeler) {
    const outbox = new Outbox();
    outbox.#run = run;
    outbox.#labeler = labeler;
    outbox.#database = await openDatabase();
    await outbox.#prune().catch((reason) => console.warn('old answers stay in this browser:', reason));
    return outbox;
  }

  /** Lets go of answers that the server has and that nobody can go back to. */
  #prune() {
    return this.#write(['answered', 'unsent'], (transaction) => {
      const [answered, unsent] = ['answered', 'unsent'].map((name) => transaction.objectStore(name));
      const unsentRows = unsent.getAll();
      const answeredRows = answered.getAll();
      answeredRows.onsuccess = () => {
        const held = new Set(unsentRows.result.map((row) => row.lease_id)); // a change needs what it supersedes
        for (const row of beyondHistory(answeredRows.result)) {
          if (row.answer_id && !held.has(row.lease_id)) answered.delete(row.lease_id);
        }
      };
    });
  }

  /** Sends what is unsent from before; whoever listens does so by now. */
  start() {
    addEventListener('online', () => this.#sendSoon(0));
    this.#sendSoon(0);
  }

  /** The run's pairs that this labeler answered, oldest first. @returns {Promise<Answered[]>} */
  async history() {
    const all = await this.#read('answered', (store) => store.getAll());
    const isTheirs = (row) => row.run === this.#run && (row.labeler ?? this.#labeler) === this.#labeler;
    return all.filter(isTheirs).sort((a, b) => a.at - b.at).slice(-HISTORY);
  }

  /**
   * Keeps the first answer to a lease and sends it.
   * @returns {Promise<boolean>} false when another tab has answered this lease already
   */
  async answer(lease, body) {
    const row = this.#answered(lease, body);
    const isNew = await this.#write(['answered', 'unsent'], (transaction) => {
      transaction.objectStore('answered').add(row);
      transaction.objectStore('unsent').add({ lease_id: lease.lease_id, body, isChange: false });
    });
    this.#sendSoon(0); // what the other tab has kept, too
    return isNew;
  }

  /** Keeps a changed answer to an answered lease and sends it after the one that it supersedes. */
  async change(lease, body) {
    await this.#write(['answered', 'unsent'], (transaction) => {
      const answered = transaction.objectStore('answered');
      const reading = answered.get(lease.lease_id);
      reading.onsuccess = () => {
        answered.put({ ...(reading.result ?? this.#answered(lease, body)), answer: body.answer });
        transaction.objectStore('unsent').add({ lease_id: lease.lease_id, body, isChange: true });
      };
    });
    this.#sendSoon(0);
  }

  /** @returns {Answered} not acknowledged */
  #answered(lease, body) {
    return { lease_id: lease.lease_id, run: this.#run, labeler: this.#labeler, lease, answer: body.answer, answer_id: null, at: Date.now() };
  }

  /**
   * The server was heard of: what waits for it need wait no longer, and what it offers it takes from here.
   *
   * @param {object[]} offered leases
   */
  wake(offered) {
    const isTakenNow = offered.filter((lease) => this.#undelivered.delete(lease.lease_id)).length > 0;
    if (isTakenNow) this.#tell('undelivered', { count: this.#undelivered.size });
    else if (this.#retryMs === FIRST_RETRY_MS) return;
    this.#retryMs = FIRST_RETRY_MS;
    this.#sendSoon(0);
  }

  /** Leases that this browser has answered, sent or not. @returns {Promise<Set<string>>} */
  async answeredLeases() {
    return new Set(await this.#read('answered', (store) => store.getAllKeys()));
  }

  /** Whether nothing is left to send. @returns {Promise<boolean>} */
  async isEmpty() {
    return (await this.#unsent()).length === 0;
  }

  /** Rows that may get through, in the order of answering. */
  async #unsent() {
    const rows = await this.#read('unsent', (store) => store.getAll());
    return rows.filter((row) => !this.#undelivered.has(row.lease_id));
  }

  #sendSoon(afterMs) {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#sendAll(), afterMs);
  }

  async #sendAll() {
    this.#isToSendAgain = this.#sending;
    if (this.#sending) return;
    this.#sending = true;
    try {
      // One tab sends at a time where the browser can arrange that; otherwise the server sorts it out.
      const send = () => this.#sendInOrder();
      await (navigator.locks ? navigator.locks.request('stair-outbox', send) : send());
    } catch (reason) {
      console.error('what is to be sent could not be read:', reason);
      this.#sendLater();
    } finally {
      this.#sending = false;
      if (this.#isToSendAgain) this.#sendSoon(0);
    }
  }

  async #sendInOrder() {
    for (;;) {
      const unsent = await this.#unsent();
      if (unsent.length === 0) break;
      try {
        await this.#send(unsent[0]);
      } catch (reason) {
        const why = whatHoldsItUp(reason);
        if (why) return this.#tryAgain(why, unsent.length);
        await this.#settle(unsent[0], reason);
      }
      this.#retryMs = FIRST_RETRY_MS;
    }
    this.#tell('waiting', { count: 0, why: null });
  }

  #tryAgain(why, count) {
    this.#tell('waiting', { count, why });
    this.#sendLater();
  }

  #sendLater() {
    this.#sendSoon(this.#retryMs);
    this.#retryMs = Math.min(LAST_RETRY_MS, this.#retryMs * 2);
  }

  async #send(item) {
    const row = await this.#read('answered', (store) => store.get(item.lease_id));
    const body = { ...item.body, supersedes: item.isChange ? (row?.answer_id ?? null) : null };
    const reply = await request('PUT', `/api/v1/leases/${item.lease_id}/answer`, body);
    if (typeof reply.answer_id !== 'string') throw notOurs(); // taken for stored only where the server says so
    await this.#acknowledge(item, row, reply.answer_id);
    this.#tell('saved', { stored_at: reply.stored_at, lease_id: item.lease_id });
  }

  /** @param {string} [word] that stands, where it is not the one that was sent */
  #acknowledge(item, row, answerId, word = null) {
    return this.#write(['answered', 'unsent'], (transaction) => {
      const answered = transaction.objectStore('answered');
      const reading = answered.get(item.lease_id);
      reading.onsuccess = () => {
        const known = reading.result ?? row;
        if (known) answered.put({ ...known, answer: word ?? known.answer, answer_id: answerId ?? null });
        transaction.objectStore('unsent').delete(item.key);
      };
    });
  }

  /** The server has said no to this one, and will not say otherwise soon. */
  #settle(item, problem) {
    // Given under another name, or to a lease that is gone: the server has kept nothing.
    const isLost = problem.status === 403 || problem.status === 404;
    return isLost ? this.#keepBack(item) : this.#giveUp(item, problem);
  }

  /** It stays in this browser, and holds up no other. */
  #keepBack(item) {
    this.#undelivered.add(item.lease_id);
    this.#tell('undelivered', { count: this.#undelivered.size });
  }

  /**
   * Decided (409, 410), it is kept aside by the server; anything else is no answer to its question.
   * A lease without an answer that stands does not count as answered: offered again, it is shown.
   */
  async #giveUp(item, problem) {
    const row = await this.#read('answered', (store) => store.get(item.lease_id));
    const isDecided = problem.status === 409 || problem.status === 410;
    const existing = problem.body.existing;
    const standing = isDecided ? (existing?.answer_id ?? row?.answer_id) : null;
    if (standing) await this.#acknowledge(item, row, standing, existing?.answer);
    else await this.#forget(item);
    const lease = row?.lease ?? { lease_id: item.lease_id };
    this.#tell('refused', { message: problem.message, lease, standing: standing ? existing?.answer : null });
  }

  #forget(item) {
    return this.#write(['answered', 'unsent'], (transaction) => {
      transaction.objectStore('answered').delete(item.lease_id);
      transaction.objectStore('unsent').delete(item.key);
    });
  }

  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  #read(store, ask) {
    return new Promise((resolve, reject) => {
      const request = ask(this.#database.transaction(store).objectStore(store));
      request.onsuccess = () => resolve(request.result);
      request.onerror = () => reject(request.error);
    });
  }

  /** @returns {Promise<boolean>} false when a key was there already and nothing was written */
  #write(stores, change) {
    return new Promise((resolve, reject) => {
      const transaction = this.#database.transaction(stores, 'readwrite', { durability: 'strict' });
      transaction.oncomplete = () => resolve(true);
      transaction.onabort = () =>
        transaction.error?.name === 'ConstraintError' ? resolve(false) : reject(transaction.error ?? new Error('it was given up'));
      change(transaction);
    });
  }
}

/** Answers older than the newest `HISTORY` of their run. @param {Answered[]} rows */
function beyondHistory(rows) {
  const nOfRun = new Map();
  const newestFirst = [...rows].sort((a, b) => b.at - a.at);
  return newestFirst.filter(({ run }) => {
    nOfRun.set(run, (nOfRun.get(run) ?? 0) + 1);
    return nOfRun.get(run) > HISTORY;
  });
}

/** Why an answer did not get through now but may later; null when the server has decided. */
function whatHoldsItUp(reason) {
  if (!(reason instanceof Problem)) return 'offline';
  if (reason.status === 401) return 'stranger';
  return reason.isPassing ? 'busy' : null;
}

function openDatabase() {
  return new Promise((resolve, reject) => {
    const opening = indexedDB.open('stair', 1);
    opening.onupgradeneeded = () => {
      opening.result.createObjectStore('unsent', { keyPath: 'key', autoIncrement: true });
      opening.result.createObjectStore('answered', { keyPath: 'lease_id' });
    };
    opening.onsuccess = () => resolve(opening.result);
    opening.onerror = () => reject(opening.error);
  });
}
