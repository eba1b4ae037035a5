// For whoever works by Tab and Enter: buttons come and go with the pairs, and the focus is not lost with them.

export class KeptFocus {
  #last = null;

  /** @param {HTMLElement} bench whose buttons keys lead to */
  constructor(bench) {
    // A pointer leads nowhere that is worth coming back to: the space bar plays the clips then.
    bench.addEventListener('focusin', ({ target }) => { this.#last = target.matches('button:focus-visible') ? target : null; });
  }

  /** Puts it back where it was, or on `instead` where that is hidden by now. */
  restore(instead) {
    const at = document.activeElement;
    if (!this.#last || (at !== document.body && isThere(at))) return;
    (isThere(this.#last) ? this.#last : instead).focus();
  }
}

function isThere(element) {
  return element.getClientRects().length > 0;
}
