// An experiment under way: the page is fetched again now and then, and its content replaced.

const EVERY = 15_000;

async function refresh() {
  try {
    const reply = await fetch(location.href);
    if (reply.ok) {
      const page = new DOMParser().parseFromString(await reply.text(), 'text/html');
      document.querySelector('#main').replaceWith(page.querySelector('#main'));
    }
  } catch {
    // The server may be starting again; the next look will tell.
  }
  setTimeout(refresh, EVERY);
}

setTimeout(refresh, EVERY);
