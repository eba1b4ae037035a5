// Keeps every answer in the browser until the server has said that it is stored.
//
// An answer is written to IndexedDB before it is sent, and taken out when it is acknowledged: a
// lost connection, a closed lid or a restarted server lose nothing. Sending twice is harmless,
// the server stores an answer to a lease once.
import { Problem, request } from './api.js';

/** Answered pairs that can be gone back to. */
export const HISTORY = 50;
const FIRST_RETRY_MS = 500;
const LAST_RETRY_MS = 5_000;

/**
 * @typedef {object} Answered one answered pair: `{lease_id, run, lease, answer, answer_id, at}`;
 *   `answer_id` is null until the server has acknowledged it
 */

/** Fires `saved` ({stored_at}), `refused` ({message, status, lease_id}) and `waiting` ({count, isOffline}). */
export class Outbox extends EventTarget {
  #database;
  #run;
  #sending = false;
  #retryMs = FIRST_RETRY_MS;
  #timer = 0;

  /** @param {string} run only this run's history is told; every run's unsent answers are sent */
  static async open(run) {
    const outbox = new Outbox();
    outbox.#run = run;
    outbox.#database = await openDatabase();
    addEventListener('online', () => outbox.#sendSoon(0));
    outbox.#sendSoon(0);
    return outbox;
  }

  /** The run's answered pairs, oldest first. @returns {Promise<Answered[]>} */
  async history() {
    const all = await this.#read('answered', (store) => store.getAll());
    return all.filter((row) => row.run === this.#run).sort((a, b) => a.at - b.at).slice(-HISTORY);
  }

  /**
   * Keeps the first answer to a lease and sends it.
   * @returns {Promise<boolean>} false when another tab has answered this lease already
   */
  async answer(lease, body) {
    const row = { lease_id: lease.lease_id, run: this.#run, lease, answer: body.answer, answer_id: null, at: Date.now() };
    const isNew = await this.#write(['answered', 'unsent'], (transaction) => {
      transaction.objectStore('answered').add(row);
      transaction.objectStore('unsent').add({ lease_id: lease.lease_id, body, isChange: false });
    });
    if (isNew) this.#sendSoon(0);
    return isNew;
  }

  /** Keeps a changed answer to an answered lease and sends it after the one that it supersedes. */
  async change(lease, body) {
    await this.#write(['answered', 'unsent'], (transaction) => {
      const answered = transaction.objectStore('answered');
      const reading = answered.get(lease.lease_id);
      reading.onsuccess = () => {
        answered.put({ ...reading.result, answer: body.answer });
        transaction.objectStore('unsent').add({ lease_id: lease.lease_id, body, isChange: true });
      };
    });
    this.#sendSoon(0);
  }

  /** The server was heard of: what waits for a connection need wait no longer. */
  wake() {
    if (this.#retryMs === FIRST_RETRY_MS) return;
    this.#retryMs = FIRST_RETRY_MS;
    this.#sendSoon(0);
  }

  /** Leases that this browser has answered, sent or not. @returns {Promise<Set<string>>} */
  async answeredLeases() {
    return new Set(await this.#read('answered', (store) => store.getAllKeys()));
  }

  /** Whether the server has acknowledged every answer. @returns {Promise<boolean>} */
  async isEmpty() {
    return (await this.#read('unsent', (store) => store.count())) === 0;
  }

  #sendSoon(afterMs) {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#sendAll(), afterMs);
  }

  async #sendAll() {
    if (this.#sending) return;
    this.#sending = true;
    try {
      // One tab sends at a time where the browser can arrange that; otherwise the server sorts it out.
      const send = () => this.#sendInOrder();
      await (navigator.locks ? navigator.locks.request('stair-outbox', send) : send());
    } finally {
      this.#sending = false;
    }
  }

  async #sendInOrder() {
    for (;;) {
      const [item] = await this.#read('unsent', (store) => store.getAll(null, 1));
      if (!item) break;
      const count = await this.#read('unsent', (store) => store.count());
      try {
        await this.#send(item);
        this.#retryMs = FIRST_RETRY_MS;
      } catch (reason) {
        if (!(reason instanceof Problem) || reason.isPassing) {
          this.#tell('waiting', { count, isOffline: !(reason instanceof Problem) });
          this.#sendSoon(this.#retryMs);
          this.#retryMs = Math.min(LAST_RETRY_MS, this.#retryMs * 2);
          return;
        }
        await this.#setAside(item, reason);
      }
    }
    this.#tell('waiting', { count: 0, isOffline: false });
  }

  async #send(item) {
    const row = await this.#read('answered', (store) => store.get(item.lease_id));
    const body = { ...item.body, supersedes: item.isChange ? (row?.answer_id ?? null) : null };
    const reply = await request('PUT', `/api/v1/leases/${item.lease_id}/answer`, body);
    await this.#acknowledge(item, row, reply.answer_id);
    this.#tell('saved', { stored_at: reply.stored_at, lease_id: item.lease_id });
  }

  #acknowledge(item, row, answerId) {
    return this.#write(['answered', 'unsent'], (transaction) => {
      const answered = transaction.objectStore('answered');
      const reading = answered.get(item.lease_id);
      reading.onsuccess = () => {
        if (reading.result ?? row) answered.put({ ...(reading.result ?? row), answer_id: answerId ?? null });
        transaction.objectStore('unsent').delete(item.key);
      };
    });
  }

  /** The server will never take this one; it is told, and the next goes on. */
  async #setAside(item, problem) {
    const row = await this.#read('answered', (store) => store.get(item.lease_id));
    const existing = problem.body?.answer_id ?? problem.body?.existing?.answer_id ?? row?.answer_id ?? null;
    await this.#acknowledge(item, row, existing);
    this.#tell('refused', { message: problem.message, status: problem.status, lease_id: item.lease_id });
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
        transaction.error?.name === 'ConstraintError' ? resolve(false) : reject(transaction.error);
      change(transaction);
    });
  }
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
