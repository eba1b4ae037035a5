// Which questions are not to be shown, or not again: answered ones, and those that the server
// withdraws because their pair was skipped.

export class Settled {
  #answered;
  /** Queries whose preference was skipped: no stage question about them is asked. */
  #skipped = new Set();

  /**
   * @param {Set<string>} answered leases
   * @param {{lease: object, answer: string}[]} history of this run, oldest first
   */
  constructor(answered, history) {
    this.#answered = answered;
    for (const { lease, answer } of history) this.note(lease, answer);
  }

  /** @param {string} answer the newest to this lease */
  note(lease, answer) {
    this.#answered.add(lease.lease_id);
    if (lease.question !== 'preference') return;
    if (answer === 'skip') this.#skipped.add(lease.query_id);
    else this.#skipped.delete(lease.query_id);
  }

  /** No answer to this lease stands. */
  forget(lease) {
    this.#answered.delete(lease.lease_id);
    if (lease.question === 'preference') this.#skipped.delete(lease.query_id);
  }

  has(lease) {
    return this.#answered.has(lease.lease_id) || (lease.question === 'same_stage' && this.#skipped.has(lease.query_id));
  }
}
