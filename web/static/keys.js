// What single keys mean on the labeler's page.

const ANSWERS = {
  preference: { 1: 'left', ArrowLeft: 'left', 2: 'right', ArrowRight: 'right', 3: 'equal', ArrowDown: 'equal' },
  same_stage: { s: 'same', d: 'different' },
};
const PLAYER = { ' ': 'toggle', ',': 'back', '.': 'forward', '[': 'slower', ']': 'faster', r: 'restart' };
const PAGE = { z: 'undo', Escape: 'leave', u: 'unsure', '?': 'guidance' };

/** Whether nobody else has taken it, and it is not one of the browser's own. */
export function isPlain(event) {
  return !(event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey);
}

/**
 * @param {KeyboardEvent} event a plain one
 * @param {string | undefined} question that is on
 * @returns {{answer?: string, player?: string, page?: string}} what it asks for; nothing where it means nothing
 *   here, or is a longer press of a key that does something once
 */
export function meaningOf(event, question) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key; // with Caps Lock, too
  if (PLAYER[key]) return { player: PLAYER[key] };
  return event.repeat ? {} : { answer: ANSWERS[question]?.[key], page: PAGE[key] };
}
