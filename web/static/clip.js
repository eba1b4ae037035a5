// Loads a clip and decodes every frame of it once, so that any frame can be shown at any moment.
import { inTime, notOurs, Problem, refusalOf } from './api.js';
import { readMp4 } from './mp4.js';

/** No clip takes longer to decode; where it does, the browser has stopped without a word. */
const DECODING_MS = 20_000;

/** A clip that is gone, or whose bytes arrived but cannot be shown; loading it again would not help. */
export class BrokenClip extends Error {}

/** Whether this browser has a decoder for the server's clips at all: H.264, baseline. */
export async function canShowClips() {
  const codec = 'avc1.42E01E';
  if (document.createElement('video').canPlayType(`video/mp4; codecs="${codec}"`)) return true;
  if (typeof VideoDecoder === 'undefined') return false;
  return VideoDecoder.isConfigSupported({ codec }).then(({ supported }) => supported, () => false);
}

/** All frames of a clip, ready to draw. */
export class Clip {
  /**
   * @param {ImageBitmap[]} frames in order of presentation
   * @param {number} fps frames per second
   */
  constructor(frames, fps) {
    this.frames = frames;
    this.fps = fps;
    this.width = frames[0].width;
    this.height = frames[0].height;
  }

  /** Seconds. */
  get duration() {
    return this.frames.length / this.fps;
  }

  /** The frame that is on at `seconds`; the last one stays on afterwards. */
  indexAt(seconds) {
    return Math.max(0, Math.min(this.frames.length - 1, Math.floor(seconds * this.fps + 1e-6)));
  }

  /** Gives the pictures' memory back. */
  close() {
    for (const frame of this.frames) frame.close();
    this.frames = [];
  }
}

/**
 * @param {string} url of an MP4 file
 * @param {{fps?: number, n_frames?: number}} [known] what the server said about it
 * @param {AbortSignal} [cancelled] nobody waits for it any more
 * @returns {Promise<Clip>} rejects with BrokenClip; with anything else where it may be there later: the
 *   network failed or took too long, somebody on the way is busy or answers instead of the server, or the
 *   server does not know who asks
 */
export async function loadClip(url, known = {}, cancelled = null) {
  const response = await fetch(url, { signal: inTime(cancelled) });
  if (!response.ok) {
    const reason = await refusalOf(response);
    if (!(reason instanceof Problem) || reason.isPassing || reason.status === 401) throw reason;
    throw new BrokenClip(`the clip is not there: ${reason.body.title || reason.status}`);
  }
  if (!response.headers.get('content-type')?.startsWith('video/')) throw notOurs();
  const bytes = await response.arrayBuffer();
  try {
    return await decodeExactly(bytes);
  } catch (reason) {
    console.info('frames are taken from a video element instead:', reason.message);
    return decodeBySeeking(bytes, known);
  }
}

/**
 * Both clips of a pair, or neither: where one fails, the other's memory is given back.
 *
 * @param {Promise<Clip | null>[]} loading
 * @returns {Promise<(Clip | null)[]>} rejects with what broke one of them for good, if anything did
 */
export async function bothClips(loading) {
  const results = await Promise.allSettled(loading);
  const failures = results.filter(({ status }) => status === 'rejected').map(({ reason }) => reason);
  if (failures.length === 0) return results.map(({ value }) => value);
  for (const { value } of results) value?.close();
  throw failures.find((reason) => reason instanceof BrokenClip) ?? failures[0];
}

async function decodeExactly(bytes) {
  if (typeof VideoDecoder === 'undefined') throw new Error('no WebCodecs here');
  const file = readMp4(bytes);
  const config = {
    codec: file.codec,
    description: file.description,
    codedWidth: file.width,
    codedHeight: file.height,
    optimizeForLatency: true,
  };
  const { supported } = await VideoDecoder.isConfigSupported(config);
  if (!supported) throw new Error(`${file.codec} is not supported`);

  const pictures = [];
  let failure = null;
  const decoder = new VideoDecoder({
    output(frame) {
      const timestamp = frame.timestamp;
      pictures.push(
        createImageBitmap(frame).then((bitmap) => {
          frame.close();
          return { timestamp, bitmap };
        }),
      );
    },
    error(reason) {
      failure = reason;
    },
  });
  decoder.configure(config);
  for (const sample of file.samples) {
    decoder.decode(
      new EncodedVideoChunk({ type: sample.isKey ? 'key' : 'delta', timestamp: sample.timestamp, data: sample.data }),
    );
  }
  try {
    await inDue(decoder.flush());
  } catch (reason) {
    failure ??= reason;
  }
  if (decoder.state !== 'closed') decoder.close();
  const decoded = await Promise.all(pictures);
  if (failure || decoded.length !== file.samples.length) {
    for (const { bitmap } of decoded) bitmap.close();
    throw failure ?? new Error(`${decoded.length} of ${file.samples.length} frames were decoded`);
  }
  decoded.sort((a, b) => a.timestamp - b.timestamp);
  return new Clip(decoded.map(({ bitmap }) => bitmap), file.fps);
}

async function decodeBySeeking(bytes, known) {
  const url = URL.createObjectURL(new Blob([bytes], { type: 'video/mp4' }));
  const video = document.createElement('video');
  video.muted = true;
  video.preload = 'auto';
  video.src = url;
  const frames = [];
  try {
    await once(video, 'loadeddata');
    const fps = known.fps ?? 25;
    const n = known.n_frames ?? Math.max(1, Math.round(video.duration * fps));
    for (let k = 0; k < n; k += 1) {
      video.currentTime = (k + 0.5) / fps;
      await once(video, 'seeked');
      frames.push(await createImageBitmap(video));
    }
    return new Clip(frames, fps);
  } catch (reason) {
    for (const frame of frames) frame.close();
    throw reason instanceof Overdue ? reason : new BrokenClip(`the browser could not show it: ${reason.message}`);
  } finally {
    video.removeAttribute('src');
    video.load();
    URL.revokeObjectURL(url);
  }
}

/** The browser was asked to decode and says nothing; it may do so later. */
class Overdue extends Error {}

/** @returns {Promise<any>} what `decoding` comes to; rejects with Overdue where it comes to nothing */
function inDue(decoding) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Overdue('the browser takes too long to decode it')), DECODING_MS);
  });
  return Promise.race([decoding, late]).finally(() => clearTimeout(timer));
}

function once(video, event) {
  const happening = new Promise((resolve, reject) => {
    video.addEventListener(event, resolve, { once: true });
    video.addEventListener('error', () => reject(new Error(video.error?.message || 'the browser cannot decode it')), { once: true });
  });
  return inDue(happening);
}
