// Takes an MP4 file apart, as far as a decoder of its one H.264 track needs it.
//
// The browser plays MP4 but offers no exact frames from it; WebCodecs decodes exact frames but
// reads no MP4. This is the piece between them. Clips here are short and not fragmented; anything
// else throws, and the caller falls back to seeking a video element.

/**
 * @param {ArrayBuffer} buffer a whole file
 * @returns {{codec: string, description: Uint8Array, width: number, height: number,
 *   fps: number, samples: {data: Uint8Array, isKey: boolean, timestamp: number}[]}}
 *   samples in decoding order, timestamps in microseconds of presentation
 */
export function readMp4(buffer) {
  const view = new DataView(buffer);
  const movie = find(boxes(view, 0, view.byteLength), 'moov');
  const track = boxes(view, movie.start, movie.end).find((box) => box.type === 'trak' && isVideo(view, box));
  if (!track) throw new Error('no video track');
  const media = child(view, track, 'mdia');
  const header = child(view, media, 'mdhd');
  const isLong = view.getUint8(header.start) === 1;
  const timescale = view.getUint32(header.start + (isLong ? 20 : 12));
  const table = child(view, child(view, media, 'minf'), 'stbl');

  const sizes = sampleSizes(view, child(view, table, 'stsz'));
  const offsets = sampleOffsets(view, table, sizes);
  const { times, durations } = sampleTimes(view, table, sizes.length);
  const keys = keySamples(view, table);
  const description = sampleDescription(view, child(view, table, 'stsd'));
  const seconds = durations.reduce((sum, d) => sum + d, 0) / timescale;
  const samples = sizes.map((size, i) => ({
    data: new Uint8Array(buffer, offsets[i], size),
    isKey: keys === null || keys.has(i + 1),
    timestamp: Math.round((times[i] / timescale) * 1e6),
  }));
  return { ...description, fps: sizes.length / seconds, samples };
}

function boxes(view, start, end) {
  const found = [];
  for (let at = start; at + 8 <= end; ) {
    let size = view.getUint32(at);
    let head = 8;
    if (size === 1) {
      size = Number(view.getBigUint64(at + 8));
      head = 16;
    } else if (size === 0) {
      size = end - at;
    }
    if (size < head || at + size > end) throw new Error('a box reaches past the end of the file');
    found.push({ type: fourCharacters(view, at + 4), start: at + head, end: at + size });
    at += size;
  }
  return found;
}

function fourCharacters(view, at) {
  return String.fromCharCode(...[0, 1, 2, 3].map((i) => view.getUint8(at + i)));
}

function find(list, type) {
  const box = list.find((candidate) => candidate.type === type);
  if (!box) throw new Error(`no ${type} box`);
  return box;
}

function child(view, parent, type) {
  return find(boxes(view, parent.start, parent.end), type);
}

function isVideo(view, track) {
  const handler = child(view, child(view, track, 'mdia'), 'hdlr');
  return fourCharacters(view, handler.start + 8) === 'vide';
}

function sampleSizes(view, box) {
  const same = view.getUint32(box.start + 4);
  const n = view.getUint32(box.start + 8);
  return Array.from({ length: n }, (_, i) => same || view.getUint32(box.start + 12 + 4 * i));
}

function sampleOffsets(view, table, sizes) {
  const list = boxes(view, table.start, table.end);
  const wide = list.find((box) => box.type === 'co64');
  const box = wide ?? find(list, 'stco');
  const n = view.getUint32(box.start + 4);
  const chunkAt = (i) => (wide ? Number(view.getBigUint64(box.start + 8 + 8 * i)) : view.getUint32(box.start + 8 + 4 * i));
  const groups = find(list, 'stsc');
  const nGroups = view.getUint32(groups.start + 4);
  const offsets = [];
  let group = 0;
  for (let chunk = 0; chunk < n; chunk += 1) {
    while (group + 1 < nGroups && view.getUint32(groups.start + 8 + 12 * (group + 1)) <= chunk + 1) group += 1;
    const perChunk = view.getUint32(groups.start + 8 + 12 * group + 4);
    let at = chunkAt(chunk);
    for (let k = 0; k < perChunk && offsets.length < sizes.length; k += 1) {
      offsets.push(at);
      at += sizes[offsets.length - 1];
    }
  }
  if (offsets.length !== sizes.length) throw new Error('the sample tables disagree');
  return offsets;
}

function sampleTimes(view, table, n) {
  const list = boxes(view, table.start, table.end);
  const durations = runs(view, find(list, 'stts'), false);
  const shiftBox = list.find((box) => box.type === 'ctts');
  const shifts = shiftBox ? runs(view, shiftBox, view.getUint8(shiftBox.start) === 1) : [];
  const times = [];
  let decoding = 0;
  for (let i = 0; i < n; i += 1) {
    times.push(decoding + (shifts[i] ?? 0));
    decoding += durations[i] ?? 0;
  }
  return { times, durations };
}

function runs(view, box, isSigned) {
  const n = view.getUint32(box.start + 4);
  const values = [];
  for (let i = 0; i < n; i += 1) {
    const at = box.start + 8 + 8 * i;
    const value = isSigned ? view.getInt32(at + 4) : view.getUint32(at + 4);
    for (let k = view.getUint32(at); k > 0; k -= 1) values.push(value);
  }
  return values;
}

/** Numbers (from 1) of samples that need no other, or null where all are so. */
function keySamples(view, table) {
  const box = boxes(view, table.start, table.end).find((candidate) => candidate.type === 'stss');
  if (!box) return null;
  const n = view.getUint32(box.start + 4);
  return new Set(Array.from({ length: n }, (_, i) => view.getUint32(box.start + 8 + 4 * i)));
}

function sampleDescription(view, box) {
  const [entry] = boxes(view, box.start + 8, box.end);
  if (!entry || !/^avc[13]$/.test(entry.type)) throw new Error('not H.264');
  const config = find(boxes(view, entry.start + 78, entry.end), 'avcC');
  const description = new Uint8Array(view.buffer, config.start, config.end - config.start);
  const hex = (i) => description[i].toString(16).padStart(2, '0');
  return {
    codec: `avc1.${hex(1)}${hex(2)}${hex(3)}`,
    description,
    width: view.getUint16(entry.start + 24),
    height: view.getUint16(entry.start + 26),
  };
}
