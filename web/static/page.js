// What scripts of pages share: parts of the page by their id, and words put into them.

/** @param {string} id */
export const $ = (id) => document.getElementById(id);

/** Nothing that reads the page aloud is told of words that are there already. */
export function setText(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}
