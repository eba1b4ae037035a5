// <stair-pair>: two clips drawn from one clock, so that they cannot fall out of step.
//
// Inside it the page writes two <canvas data-side="left|right">, and whichever controls it wants:
// buttons with data-do="toggle|back|forward|slower|faster|restart", an <input type="range"
// data-do="scrub">, an <output data-show="speed|frame">. With attributes `left` and `right`
// (addresses of clips) it loads them itself while it is in view, and lets go of them when it is not, as
// decoded ones are large; where that fails it says so, and tries again when it is played or comes into
// view again.
// With `still` it waits to be played.
import { bothClips, loadClip } from './clip.js';

/** Times the recorded pace, slowest first. */
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
/** Real seconds that the last frame stays on before the loop starts again. */
const HOLD_S = 0.5;
/** Frames that an arrow goes on a slider, as on any other. */
const ARROWS = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };

/**
 * Fires `firstframe` when both first frames are drawn, `seen` when nothing lies over them for the
 * first time, `change` when frame, speed or playing changed.
 */
export class StairPair extends HTMLElement {
  #clips = { left: null, right: null };
  #seconds = 0;
  #held = 0;
  #playing = false;
  #isCovered = false;
  /** The clips go on playing once nothing lies over them. */
  #playsOn = false;
  /** A pointer moved the slider that has the focus. */
  #isDragged = false;
  #speed = 1;
  #last = null;
  #request = 0;
  #drawn = { left: -1, right: -1 };
  #observer = null;
  #isListening = false;
  /** Ends the loading of own clips; `null` until it begins, and where the page loads the clips. */
  #loading = null;
  #watch = emptyWatch();

  connectedCallback() {
    if (!this.#isListening) this.#listen();
    document.addEventListener('visibilitychange', this.#visibilityChanged);
    if (this.hasAttribute('left')) this.#loadWhenSeen();
  }

  /** To what happens inside it; once, however often it is put on a page. */
  #listen() {
    this.#isListening = true;
    this.addEventListener('click', (event) => {
      const what = event.target.closest('[data-do]')?.dataset.do;
      if (event.target.closest('canvas')) this.toggle();
      else if (what && what !== 'scrub') this.do(what);
    });
    this.addEventListener('input', (event) => {
      if (isSlider(event.target)) this.seek(Number(event.target.value));
    });
    this.addEventListener('pointerdown', ({ target }) => { if (isSlider(target)) this.#isDragged = true; });
    this.addEventListener('focusout', ({ target }) => { if (isSlider(target)) this.#isDragged = false; });
    this.addEventListener('keydown', (event) => this.#stepByArrow(event));
  }

  disconnectedCallback() {
    document.removeEventListener('visibilitychange', this.#visibilityChanged);
    this.#observer?.disconnect();
    cancelAnimationFrame(this.#request);
    this.#request = 0;
    if (this.#loading) this.#letGo();
  }

  /** Whether the person asked their system for less motion. */
  static get wantsStillness() {
    return matchMedia('(prefers-reduced-motion: reduce)').matches;
  }

  get playing() {
    return this.#playing;
  }

  get speed() {
    return this.#speed;
  }

  /** Frame that is on, from 0; the longer clip counts. */
  get frame() {
    const clip = this.#longer();
    return clip ? clip.indexAt(this.#seconds) : 0;
  }

  /** What was watched since the pair was `seen`: for the honest timing that is stored with an answer. */
  get watched() {
    this.#countTime();
    const { visible, hidden, loops, seeks, dropped } = this.#watch;
    return {
      visible_ms: Math.round(visible),
      hidden_ms: Math.round(hidden),
      loops,
      seeks,
      speed: this.#speed,
      dropped_frames: dropped,
    };
  }

  /** For `show`, so that a pair that comes back goes on counting. */
  get watch() {
    this.#countTime();
    return { ...this.#watch };
  }

  /**
   * Puts two clips on, at their first frame, and plays them, once nothing lies over them, unless stillness is wanted.
   *
   * @param {object} [watch] of the pair when it was on before
   */
  show(left, right, watch = emptyWatch()) {
    this.#clips = { left, right };
    this.#drawn = { left: -1, right: -1 };
    this.#seconds = 0;
    this.#held = 0;
    this.#watch = { ...watch, isDrawn: false, isStarted: false };
    for (const side of ['left', 'right']) {
      const canvas = this.#canvas(side);
      const clip = this.#clips[side];
      if (!canvas || !clip) continue;
      if (canvas.width !== clip.width) canvas.width = clip.width;
      if (canvas.height !== clip.height) canvas.height = clip.height;
    }
    const scrub = this.querySelector('[data-do="scrub"]');
    if (scrub) scrub.max = String(this.#longer().frames.length - 1);
    this.#draw();
    const isToPlay = !StairPair.wantsStillness && !this.hasAttribute('still');
    this.#playing = isToPlay && !this.#isCovered;
    this.#playsOn = isToPlay && this.#isCovered;
    this.#tell();
    requestAnimationFrame(() => {
      this.#watch.isDrawn = true;
      this.dispatchEvent(new CustomEvent('firstframe'));
      this.#startWatch();
    });
    this.#run();
  }

  /** Takes the clips off; their memory stays with whoever loaded them. */
  clear() {
    this.#playing = false;
    this.#playsOn = false;
    this.#clips = { left: null, right: null };
  }

  /** Something lies over the pair: until `uncover` it holds still and no time counts. */
  cover() {
    if (this.#isCovered) return;
    this.#countTime();
    this.#isCovered = true;
    this.#playsOn = this.#playing;
    if (this.#playing) this.toggle();
  }

  /** The pair can be seen again, and goes on as it was. */
  uncover() {
    if (!this.#isCovered) return;
    this.#countTime();
    this.#isCovered = false;
    if (this.#playsOn && !this.#playing) this.toggle();
    this.#playsOn = false;
    this.#startWatch();
  }

  /** One of the controls by its name. */
  do(what) {
    if (!this.#longer()) return this.#loadAgain();
    switch (what) {
      case 'toggle': return this.toggle();
      case 'back': return this.step(-1);
      case 'forward': return this.step(1);
      case 'slower': return this.#changeSpeed(-1);
      case 'faster': return this.#changeSpeed(1);
      case 'restart': return this.restart();
    }
  }

  toggle() {
    if (!this.#longer()) return this.#loadAgain();
    this.#playing = !this.#playing;
    if (this.#playing && this.#seconds >= this.#longer().duration) this.#seconds = 0;
    this.#tell();
    this.#run();
  }

  /** Pauses and moves by exactly `n` frames. */
  step(n) {
    this.#playing = false;
    this.seek(this.frame + n);
  }

  /** Moves both clips to a frame; goes on playing if it was. */
  seek(frame) {
    const clip = this.#longer();
    if (!clip) return;
    const k = Math.max(0, Math.min(clip.frames.length - 1, Math.round(frame)));
    this.#seconds = (k + 0.5) / clip.fps;
    this.#held = 0;
    this.#watch.seeks += 1;
    this.#draw();
    this.#tell();
  }

  /** From the first frame again, playing. */
  restart() {
    this.#seconds = 0;
    this.#held = 0;
    this.#playing = true;
    this.#draw();
    this.#tell();
    this.#run();
  }

  /** Sets the pace to one of the offered ones. */
  setSpeed(speed) {
    if (!SPEEDS.includes(speed)) return;
    this.#speed = speed;
    this.#tell();
  }

  #changeSpeed(by) {
    const at = SPEEDS.indexOf(this.#speed) + by;
    this.setSpeed(SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at))]);
  }

  /** On a slider that keys have led to; one that was dragged leaves its arrows to the page. */
  #stepByArrow(event) {
    const n = ARROWS[event.key];
    const isModified = event.ctrlKey || event.metaKey || event.altKey;
    if (!n || isModified || !isSlider(event.target) || this.#isDragged || !event.target.matches(':focus-visible')) return;
    event.preventDefault();
    this.step(n);
  }

  #canvas(side) {
    return this.querySelector(`canvas[data-side="${side}"]`);
  }

  #longer() {
    const { left, right } = this.#clips;
    if (!left || !right) return left ?? right;
    return left.duration >= right.duration ? left : right;
  }

  #run() {
    if (this.#request || !this.#playing) return;
    this.#last = null;
    this.#request = requestAnimationFrame(this.#tick);
  }

  #tick = (now) => {
    this.#request = 0;
    if (!this.#playing || !this.#longer()) return;
    const elapsed = this.#last === null ? 0 : Math.min(0.25, (now - this.#last) / 1000);
    this.#last = now;
    this.#advance(elapsed);
    this.#request = requestAnimationFrame(this.#tick);
  };

  #advance(elapsed) {
    const clip = this.#longer();
    const before = this.frame;
    this.#seconds += elapsed * this.#speed;
    if (this.#seconds >= clip.duration) {
      this.#held += (this.#seconds - clip.duration) / this.#speed;
      this.#seconds = clip.duration;
      if (this.#held >= HOLD_S) {
        this.#seconds = 0;
        this.#held = 0;
        this.#watch.loops += 1;
      }
    }
    const after = this.frame;
    const expected = Math.max(1, Math.ceil((clip.fps * this.#speed) / 50));
    if (after > before + expected) this.#watch.dropped += after - before - expected;
    if (after !== before) {
      this.#draw();
      this.#tell();
    }
  }

  /** Both canvases in one go: the only place that draws. */
  #draw() {
    for (const side of ['left', 'right']) {
      const clip = this.#clips[side];
      const canvas = this.#canvas(side);
      if (!clip || !canvas) continue;
      const index = clip.indexAt(this.#seconds);
      if (index === this.#drawn[side]) continue;
      canvas.getContext('2d').drawImage(clip.frames[index], 0, 0);
      this.#drawn[side] = index;
    }
  }

  #tell() {
    const n = this.#longer()?.frames.length ?? 0;
    const scrub = this.querySelector('[data-do="scrub"]');
    if (scrub && !scrub.matches(':active')) scrub.value = String(this.frame);
    scrub?.setAttribute('aria-valuetext', `frame ${this.frame + 1} of ${n}`);
    this.#tellPlaying();
    const speed = this.querySelector('[data-show="speed"]');
    if (speed) speed.textContent = `${this.#speed}×`;
    const frame = this.querySelector('[data-show="frame"]');
    if (frame) frame.textContent = `${this.frame + 1} / ${n}`;
    this.dispatchEvent(new CustomEvent('change'));
  }

  #tellPlaying() {
    const toggle = this.querySelector('[data-do="toggle"]');
    const label = this.#playing ? 'Pause' : 'Play';
    if (toggle && toggle.getAttribute('aria-label') !== label) toggle.setAttribute('aria-label', label);
    this.toggleAttribute('playing', this.#playing);
  }

  #visibilityChanged = () => {
    this.#countTime(document.visibilityState === 'visible');
  };

  /** Time counts from when the pair is drawn with nothing over it. */
  #startWatch() {
    if (this.#isCovered || !this.#watch.isDrawn || this.#watch.isStarted) return;
    this.#watch.since = performance.now();
    this.#watch.isStarted = true;
    this.dispatchEvent(new CustomEvent('seen'));
  }

  /**
   * Adds the time since the last look to visible or hidden, or to neither when something lay over
   * the pair; `wasHidden` says which it was.
   */
  #countTime(wasHidden = document.visibilityState !== 'visible') {
    if (!this.#watch.isStarted) return;
    const now = performance.now();
    if (!this.#isCovered) this.#watch[wasHidden ? 'hidden' : 'visible'] += now - this.#watch.since;
    this.#watch.since = now;
  }

  #loadWhenSeen() {
    this.#observer = new IntersectionObserver((entries) => {
      if (entries.at(-1).isIntersecting) this.#load();
      else if (this.#loading) this.#letGo();
    });
    this.#observer.observe(this);
  }

  async #load() {
    if (this.hasAttribute('loaded')) return;
    this.setAttribute('loaded', '');
    this.#tellTrouble(null);
    const loading = new AbortController();
    this.#loading = loading;
    try {
      const addresses = ['left', 'right'].map((side) => this.getAttribute(side));
      const clips = await bothClips(addresses.map((url) => url && loadClip(url, {}, loading.signal)));
      if (loading.signal.aborted) for (const clip of clips) clip?.close();
      else this.show(...clips);
    } catch (reason) {
      if (loading.signal.aborted) return;
      this.removeAttribute('loaded');
      this.#tellTrouble(reason.message);
    }
  }

  /** After a failure, when somebody wants to see it. */
  #loadAgain() {
    if (this.hasAttribute('broken')) this.#load();
  }

  /** @param {string | null} reason why there is nothing to see */
  #tellTrouble(reason) {
    this.querySelector('.trouble')?.remove();
    this.toggleAttribute('broken', reason !== null);
    if (reason === null) return;
    const words = document.createElement('p');
    words.className = 'trouble';
    words.textContent = `These clips could not be loaded; press play to try again. (${reason})`;
    this.append(words);
  }

  /** Gives the memory of its own clips back, those on their way too; the last frames stay to be seen. */
  #letGo() {
    this.#loading.abort();
    this.#loading = null;
    const { left, right } = this.#clips;
    this.clear();
    this.#tellPlaying();
    for (const clip of [left, right]) clip?.close();
    this.removeAttribute('loaded');
  }
}

function isSlider(element) {
  return element.dataset?.do === 'scrub';
}

function emptyWatch() {
  return { isDrawn: false, isStarted: false, since: 0, visible: 0, hidden: 0, loops: 0, seeks: 0, dropped: 0 };
}

customElements.define('stair-pair', StairPair);
