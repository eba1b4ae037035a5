// Talks to the server: JSON in, JSON out, problems as errors with words for people.

/** No reply is waited for longer. */
const TIMEOUT_MS = 20_000;

/** The server understood and said no. `body` is its problem document (RFC 9457). */
export class Problem extends Error {
  constructor(status, body) {
    super(body.detail || body.title || `The server answered ${status}.`);
    this.status = status;
    this.body = body;
  }

  /** Whether the same request may succeed later. */
  get isPassing() {
    return this.status >= 500 || this.status === 429 || this.status === 408;
  }
}

/**
 * @param {string} method
 * @param {string} url
 * @param {object} [body]
 * @returns {Promise<any>} the reply; rejects with Problem, or TypeError when there was no reply
 */
export async function request(method, url, body) {
  const response = await fetch(url, {
    method,
    headers: { accept: 'application/json', ...(body === undefined ? {} : { 'content-type': 'application/json' }) },
    body: body === undefined ? undefined : JSON.stringify(body),
    credentials: 'same-origin',
    cache: 'no-store',
    signal: inTime(),
  });
  if (!response.ok) throw await refusalOf(response);
  const parsed = readJson(await response.text());
  if (parsed === null) throw notOurs();
  return parsed;
}

/** Somebody on the way has answered: a hotel's network, say, that wants a login first. Counts as no reply. */
export function notOurs() {
  return new TypeError('not a reply of this server');
}

/** Ends a request that takes too long, or before that once `cancelled` says so. */
export function inTime(cancelled = null) {
  const ending = new AbortController();
  setTimeout(() => ending.abort(new DOMException('no reply in time', 'TimeoutError')), TIMEOUT_MS);
  if (cancelled?.aborted) ending.abort();
  cancelled?.addEventListener('abort', () => ending.abort());
  return ending.signal;
}

/**
 * What a reply that is not ok says. Only the server itself can say no: anybody else on the way may be
 * busy, and what else they answer is no reply.
 *
 * @returns {Promise<Problem | TypeError>}
 */
export async function refusalOf(response) {
  const isOurs = response.headers.get('content-type')?.startsWith('application/problem+json');
  const text = await response.text();
  const problem = new Problem(response.status, (isOurs && readJson(text)) || { title: text.slice(0, 200) });
  return isOurs || problem.isPassing ? problem : notOurs();
}

function readJson(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

/** `14:02:11`, in the reader's own time zone. */
export function timeOfDay(timestamp) {
  const date = new Date(timestamp);
  const two = (n) => String(n).padStart(2, '0');
  return `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}
