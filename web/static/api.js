// Talks to the server: JSON in, JSON out, problems as errors with words for people.

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
    signal: AbortSignal.timeout(20_000),
  });
  const text = await response.text();
  const parsed = readJson(text);
  if (!response.ok) throw new Problem(response.status, parsed ?? { title: text.slice(0, 200) });
  return parsed;
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
