// Curves of a run, drawn as SVG: calm lines, a mark per session, one value told at the end.

const WIDTH = 320;
const HEIGHT = 132;
const PAD = { left: 40, right: 12, top: 10, bottom: 22 };
const SVG = 'http://www.w3.org/2000/svg';
/** Of a mark that leads somewhere: what can be pressed on either side of it, unless another is near, and its height. */
const REACH = 15;
const HIT_HEIGHT = 56;

/**
 * A run's events, turned into the curves that people look at.
 * @param {object[]} events as the run recorded them, in order
 */
export function foldEvents(events) {
  const curves = emptyCurves();
  for (const event of events) addEvent(curves, event);
  return curves;
}

/** Curves without a point. */
export function emptyCurves() {
  return {
    success: [], return: [], trainingReturn: [], accuracy: [], correlation: [], labels: [], speed: [],
    gapChosen: [], gapPool: [], disagreementChosen: [], disagreementPool: [], sessions: [], total_steps: 0,
  };
}

/** Adds one event; an event that says nothing about a curve changes nothing. */
export function addEvent(curves, event) {
  const push = (name, y) => {
    const last = curves[name].at(-1);
    if (typeof y !== 'number' || !Number.isFinite(y) || (last && last.x > event.step)) return;
    if (last?.x === event.step) curves[name].pop();
    curves[name].push({ x: event.step, y });
  };
  switch (event.kind) {
    case 'phase':
      curves.total_steps = event.total_steps;
      break;
    case 'metrics':
      push('trainingReturn', event.return_mean);
      push('labels', event.labels);
      push('speed', event.steps_per_s);
      break;
    case 'session_offered':
      push('gapChosen', event.stage_gap_chosen);
      push('gapPool', event.stage_gap_pool);
      push('disagreementChosen', event.disagreement_chosen);
      push('disagreementPool', event.disagreement_pool);
      push('sessions', event.session);
      break;
    case 'session_closed':
    case 'refitted':
      push('accuracy', event.accuracy);
      push('labels', event.labels);
      break;
    case 'evaluation':
      push('success', event.success_rate);
      push('return', event.return_mean);
      push('correlation', event.reward_correlation);
      break;
  }
}

/**
 * Draws into an <svg>, replacing what was there.
 * @param {SVGElement} svg
 * @param {{series: {name: string, points: {x: number, y: number}[], isQuiet?: boolean}[],
 *   range?: [number, number], xMax?: number, marks?: {x: number, y: number}[],
 *   href?: (mark: {x: number, y: number}) => string, isTabbed?: boolean,
 *   format?: (value: number) => string}} chart `range` is the least span of the y axis; with `href`
 *   each mark is a link, at which the Tab key stops where `isTabbed` says so
 */
export function drawCurve(svg, chart) {
  const format = chart.format ?? compact;
  const all = chart.series.flatMap((series) => series.points);
  svg.setAttribute('viewBox', `0 0 ${WIDTH} ${HEIGHT}`);
  for (const part of [...svg.children]) if (all.length === 0 || !part.matches('.marks')) part.remove();
  if (all.length === 0) return;
  const xMax = Math.max(chart.xMax ?? 0, ...all.map((point) => point.x), 1);
  const [low, high] = spanOf(all, chart.range);
  const x = (value) => PAD.left + (value / xMax) * (WIDTH - PAD.left - PAD.right);
  const y = (value) => PAD.top + (1 - (value - low) / (high - low)) * (HEIGHT - PAD.top - PAD.bottom);

  drawMarks(svg, chart, x);
  for (const value of [low, (low + high) / 2, high]) {
    add(svg, 'line', { class: 'grid', x1: PAD.left, x2: WIDTH - PAD.right, y1: y(value), y2: y(value) });
    add(svg, 'text', { class: 'tick', x: PAD.left - 6, y: y(value) + 3.5, 'text-anchor': 'end' }, format(value));
  }
  add(svg, 'text', { class: 'tick', x: PAD.left, y: HEIGHT - 6 }, '0');
  add(svg, 'text', { class: 'tick', x: WIDTH - PAD.right, y: HEIGHT - 6, 'text-anchor': 'end' }, `${compact(xMax)} steps`);
  for (const series of chart.series) {
    if (series.points.length === 0) continue;
    const path = series.points.map((p, i) => `${i ? 'L' : 'M'}${x(p.x).toFixed(1)} ${y(p.y).toFixed(1)}`).join('');
    add(svg, 'path', { class: series.isQuiet ? 'line quiet' : 'line', d: path });
    const end = series.points.at(-1);
    add(svg, 'circle', { class: series.isQuiet ? 'dot quiet' : 'dot', cx: x(end.x), cy: y(end.y), r: 3 });
  }
  const says = chart.series
    .filter((series) => series.points.length > 0)
    .map((series) => `${series.name}: ${format(series.points[0].y)} at first, ${format(series.points.at(-1).y)} now`);
  svg.setAttribute('role', chart.href ? 'group' : 'img'); // nothing inside a picture can be reached
  svg.setAttribute('aria-label', says.join('; '));
}

/**
 * A line for each mark. They stay in their place while the curve goes on, so that neither the focus nor
 * a press gets lost.
 */
function drawMarks(svg, { marks = [], href, isTabbed }, x) {
  const group = svg.querySelector('.marks') ?? add(svg, 'g', { class: 'marks' });
  const places = marks.map((mark) => ({ at: x(mark.x), round: mark.y + 1, address: href?.(mark) }));
  const told = JSON.stringify([places, isTabbed]);
  if (group.dataset.told === told) return;
  group.dataset.told = told;
  const focused = group.contains(document.activeElement) && document.activeElement.getAttribute('href');
  group.replaceChildren();
  places.forEach(({ at, round, address }, index) => {
    const name = address ? `round ${round}: its pairs` : `round ${round}`;
    const parent = address ? add(group, 'a', { href: address, 'aria-label': name, tabindex: isTabbed ? 0 : -1 }) : group;
    const line = add(parent, 'line', { class: 'mark', x1: at, x2: at, y1: HEIGHT - PAD.bottom - 6, y2: HEIGHT - PAD.bottom });
    add(address ? parent : line, 'title', {}, name);
    if (!address) return;
    const left = Math.min(REACH, (at - (places[index - 1]?.at ?? -Infinity)) / 2);
    const right = Math.min(REACH, ((places[index + 1]?.at ?? Infinity) - at) / 2);
    add(parent, 'rect', { class: 'hit', x: at - left, width: left + right, y: HEIGHT - PAD.bottom + 6 - HIT_HEIGHT, height: HIT_HEIGHT });
    if (address === focused) parent.focus({ preventScroll: true });
  });
}

function spanOf(points, range) {
  const values = points.map((point) => point.y);
  let low = Math.min(...values, range?.[0] ?? Infinity);
  let high = Math.max(...values, range?.[1] ?? -Infinity);
  if (high === low) high = low + 1;
  if (range) return [low, high];
  const step = niceStep((high - low) / 2);
  low = Math.floor(low / step) * step;
  high = low + 2 * step * Math.ceil((high - low) / (2 * step));
  return [low, high];
}

function niceStep(raw) {
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 2.5, 5, 10].map((n) => n * power).find((step) => step >= raw) ?? raw;
}

/** `12.5k`, `840`, `0.31`. */
export function compact(value) {
  const size = Math.abs(value);
  if (size >= 1e6) return `${trim(value / 1e6)}M`;
  if (size >= 1e3) return `${trim(value / 1e3)}k`;
  return size >= 10 || Number.isInteger(value) ? String(Math.round(value)) : value.toFixed(2);
}

/** `35 %` of 0.35. */
export function percent(value) {
  return `${Math.round(value * 100)} %`;
}

function trim(value) {
  return String(Number(value.toPrecision(3)));
}

function add(parent, tag, attributes, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, String(value));
  if (text !== undefined) node.textContent = text;
  parent.append(node);
  return node;
}
