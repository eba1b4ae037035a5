// What this browser remembers of a person's choices; nothing, where it keeps no data for this site.

/** @returns {string | null} */
export function recall(name) {
  try {
    return localStorage.getItem(name);
  } catch {
    return null;
  }
}

/** @param {string} value */
export function remember(name, value) {
  try {
    localStorage.setItem(name, value);
  } catch {
    // It holds until the page is left, and is asked for again.
  }
}
