// An experiment under way: the page is fetched again now and then, and brought up to date where it
// changed, until it says that nobody works on the experiment any more.

const EVERY_MS = 15_000;

/** As the server last told it; a person may have opened or moved something since. */
let told = document.querySelector('#main').innerHTML;

async function look() {
  // The server may be starting again; the next look will tell.
  const isUp = document.visibilityState !== 'visible' || (await refresh().catch(() => true));
  if (isUp) setTimeout(look, EVERY_MS);
}

/** @returns {Promise<boolean>} whether the experiment goes on */
async function refresh() {
  const reply = await fetch(location.href, { signal: AbortSignal.timeout(EVERY_MS) });
  if (!reply.ok || reply.redirected) return true;
  const page = new DOMParser().parseFromString(await reply.text(), 'text/html');
  const now = page.querySelector('#main');
  if (now.innerHTML !== told) {
    told = now.innerHTML;
    bringUpToDate(document.querySelector('#main'), now);
  }
  return page.querySelector('script[src$="/experiment.js"]') !== null;
}

function bringUpToDate(main, now) {
  for (const picture of now.querySelectorAll('img')) loadAnew(picture);
  const id = document.activeElement?.id;
  renew(main, now);
  if (id && document.activeElement?.id !== id) document.getElementById(id)?.focus({ preventScroll: true });
}

/** A picture keeps its address while its curves go on, and a browser the pictures of a page by their addresses. */
function loadAnew(picture) {
  const address = new URL(picture.getAttribute('src'), location.href);
  address.searchParams.set('at', Date.now());
  picture.setAttribute('src', address.href);
}

/** Changes what differs and nothing else, so that focus and scrolled tables stay as they are. */
function renew(old, now) {
  if (old.isEqualNode(now)) return;
  const isAlike = old.nodeName === now.nodeName && old.childNodes.length === now.childNodes.length;
  if (!isAlike || old.nodeType !== Node.ELEMENT_NODE) return old.replaceWith(document.importNode(now, true));
  for (const { name, value } of now.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  for (const name of old.getAttributeNames()) {
    if (!now.hasAttribute(name) && name !== 'open') old.removeAttribute(name); // a person opens a <details>
  }
  [...old.childNodes].forEach((child, index) => renew(child, now.childNodes[index]));
}

setTimeout(look, EVERY_MS);
