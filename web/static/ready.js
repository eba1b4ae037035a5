// Pairs that are leased, fetched and decoded before anybody looks at them.
import { Problem, request } from './api.js';
import { BrokenClip, bothClips, loadClip } from './clip.js';

/** The pair on the page and two ahead. */
const N_LEASES = 3;
const HEARTBEAT_MS = 60_000;
const RETRY_MS = 1_000;
/** So many tries may fail before it is worth a word. */
const QUIET_TRIES = 3;

/**
 * Fetches and decodes both clips of a lease; tries again while the network is away.
 *
 * @param {{cancelled?: AbortSignal, late?: (reason: Error) => void}} [watcher] `cancelled` when nobody waits
 *   for the pair any more; `late` is told of each try that failed once several have
 * @returns {Promise<{lease: object, left: Clip, right: Clip}>} rejects with BrokenClip, or once cancelled
 */
export async function preparePair(lease, { cancelled = null, late = () => {} } = {}) {
  for (let n = 1; ; n += 1) {
    const loading = [lease.left, lease.right].map((side) => loadClip(side.clip, side, cancelled));
    try {
      const [left, right] = await bothClips(loading);
      return { lease, left, right };
    } catch (reason) {
      if (reason instanceof BrokenClip || cancelled?.aborted) throw reason;
      if (n >= QUIET_TRIES) late(reason);
    }
    await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
  }
}

/** Gives a pair's pictures back. */
export function releasePair(pair) {
  pair?.left.close();
  pair?.right.close();
}

/**
 * The queue of prepared pairs. Fires `state` (the server's words about the run) after each
 * question to the server, `ready` when a pair was prepared, `late` ({reason}) while the next one's
 * clips do not come, `broken` ({lease, reason}), `gone` ({lease}) when somebody else has it now, and
 * `offline` when the server did not reply.
 */
export class ReadyPairs extends EventTarget {
  #run;
  #isSettled;
  #shown;
  #entries = [];
  #asking = null;
  #isToAskAgain = false;

  /**
   * @param {string} run
   * @param {(lease: object) => boolean} isSettled leases that must not be shown, or not again
   * @param {() => object[]} shown leases that the page holds at this moment
   */
  constructor(run, isSettled, shown) {
    super();
    this.#run = run;
    this.#isSettled = isSettled;
    this.#shown = shown;
    setInterval(() => this.#heartbeat(), HEARTBEAT_MS);
  }

  /** Whether `take` gives a pair: the next in the server's order, whichever others are decoded before it. */
  get isNextReady() {
    this.dropTaken();
    return Boolean(this.#entries[0]?.pair);
  }

  /** Whether pairs are on their way. */
  get isPreparing() {
    return this.#entries.length > 0;
  }

  /** Takes the next pair, in the server's order, or null when it is not decoded yet. */
  take() {
    return this.isNextReady ? this.#entries.shift().pair : null;
  }

  /** Forgets leases that are settled or on the page; called whenever one was settled. */
  dropTaken() {
    for (const entry of [...this.#entries]) if (this.#isTaken(entry.lease)) this.#drop(entry);
  }

  #drop(entry) {
    this.#entries = this.#entries.filter((kept) => kept !== entry);
    entry.leaving.abort();
    releasePair(entry.pair);
  }

  #late(entry, reason) {
    if (entry === this.#entries[0]) this.#tell('late', { reason });
  }

  /**
   * Asks the server for leases up to count, and prepares the new ones. Called while a question is
   * under way, it asks once more: the reply on its way may not know what has just happened.
   */
  refill() {
    this.#isToAskAgain = true;
    this.#asking ??= this.#askUntilFresh().finally(() => {
      this.#asking = null;
    });
    return this.#asking;
  }

  async #askUntilFresh() {
    while (this.#isToAskAgain) {
      this.#isToAskAgain = false;
      await this.#ask();
    }
  }

  /** Compared when a reply is read, not when it was asked for: pairs are taken meanwhile. */
  #isTaken(lease) {
    return this.#isSettled(lease) || this.#shown().some((held) => held.lease_id === lease.lease_id);
  }

  async #ask() {
    let reply;
    try {
      reply = await request('POST', `/api/v1/runs/${this.#run}/leases`, { count: N_LEASES });
    } catch (reason) {
      const isProblem = reason instanceof Problem && !reason.isPassing;
      this.#tell(isProblem ? 'refused' : 'offline', reason);
      return;
    }
    const offered = new Set(reply.leases.map((lease) => lease.lease_id));
    for (const entry of [...this.#entries]) if (!offered.has(entry.lease.lease_id)) this.#drop(entry);
    for (const lease of reply.leases) {
      const isKnown = this.#entries.some((entry) => entry.lease.lease_id === lease.lease_id);
      if (isKnown || this.#isTaken(lease)) continue;
      this.#prepare({ lease, pair: null, leaving: new AbortController() });
    }
    this.#tell('state', reply);
  }

  async #prepare(entry) {
    this.#entries.push(entry);
    try {
      entry.pair = await preparePair(entry.lease, { cancelled: entry.leaving.signal, late: (reason) => this.#late(entry, reason) });
    } catch (reason) {
      if (!this.#entries.includes(entry)) return;
      this.#drop(entry);
      this.#tell('broken', { lease: entry.lease, reason });
      return;
    }
    if (this.#entries.includes(entry)) this.#tell('ready', entry.lease);
    else releasePair(entry.pair);
  }

  async #heartbeat() {
    if (document.visibilityState !== 'visible') return;
    const held = [...this.#shown(), ...this.#entries.map((entry) => entry.lease)];
    for (const lease of held.filter((candidate) => !this.#isSettled(candidate))) {
      await request('POST', `/api/v1/leases/${lease.lease_id}/heartbeat`).catch((reason) => {
        if (reason instanceof Problem && reason.status === 410) this.#tell('gone', { lease });
      });
    }
  }

  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
