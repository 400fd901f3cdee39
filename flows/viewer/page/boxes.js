// Boxes of elements on a facade's picture, in its texels, y down, and what may be done with them; nothing here draws.
// A box is {label, x0, y0, x1, y1}. Boxes and lists of them are replaced, never changed.

// No box is narrower or lower, texels.
export const LEAST = 2;

// What was done, to be undone and done again. Steps of one `kind` that follow each other are undone as one.
export class Steps {
  constructor(boxes) {
    this.now = boxes;
    this.past = [];
    this.future = [];
    this.kind = null;
  }

  take(boxes, kind = null) {
    if (kind === null || kind !== this.kind) this.past.push(this.now);
    this.kind = kind;
    this.future = [];
    this.now = boxes;
  }

  undo() {
    if (!this.past.length) return;
    this.future.push(this.now);
    this.now = this.past.pop();
    this.kind = null;
  }

  redo() {
    if (!this.future.length) return;
    this.past.push(this.now);
    this.now = this.future.pop();
    this.kind = null;
  }
}

const between = (value, least, most) => Math.min(Math.max(value, least), Math.max(least, most));

// A box elsewhere on a wall of size [w, h].
export function moved(box, dx, dy, [width, height]) {
  const [x, y] = [between(dx, -box.x0, width - box.x1), between(dy, -box.y0, height - box.y1)];
  return { ...box, x0: box.x0 + x, x1: box.x1 + x, y0: box.y0 + y, y1: box.y1 + y };
}

// A box with some of its edges elsewhere; edges: such as "n" or "sw".
export function stretched(box, edges, dx, dy, [width, height]) {
  const made = { ...box };
  if (edges.includes("w")) made.x0 = between(box.x0 + dx, 0, box.x1 - LEAST);
  if (edges.includes("e")) made.x1 = between(box.x1 + dx, box.x0 + LEAST, width);
  if (edges.includes("n")) made.y0 = between(box.y0 + dy, 0, box.y1 - LEAST);
  if (edges.includes("s")) made.y1 = between(box.y1 + dy, box.y0 + LEAST, height);
  return made;
}

// The box between two places, however they lie.
export function spanned(label, a, b, [width, height]) {
  const [x0, x1] = [a.x, b.x].map((x) => between(x, 0, width)).sort((p, q) => p - q);
  const [y0, y1] = [a.y, b.y].map((y) => between(y, 0, height)).sort((p, q) => p - q);
  return { label, x0, y0, x1, y1 };
}

// How far it is from some places to a line, of all the least, if that is within reach; else 0.
function pull(places, lines, reach) {
  const ways = places.flatMap((place) => lines.map((line) => line - place)).filter((way) => Math.abs(way) <= reach);
  return ways.sort((a, b) => Math.abs(a) - Math.abs(b))[0] || 0;
}

// A box of which some edges were dragged, or the whole (null), drawn to lines {rows, columns} within reach, texels.
export function snapped(box, edges, { rows, columns }, reach, size) {
  if (edges === null) return moved(box, pull([box.x0, box.x1], columns, reach), pull([box.y0, box.y1], rows, reach), size);
  const made = { ...box };
  for (const [edge, side, lines] of [["w", "x0", columns], ["e", "x1", columns], ["n", "y0", rows], ["s", "y1", rows]]) {
    if (edges.includes(edge)) made[side] += pull([box[side]], lines, reach);
  }
  return made.x1 - made.x0 >= LEAST && made.y1 - made.y0 >= LEAST ? made : box;
}

// How far a key goes: one texel, or with lines until one of some places is on the next.
export function stride(places, towards, lines) {
  if (!lines) return towards;
  const ways = places.flatMap((place) => lines.map((line) => towards * (line - place))).filter((way) => way > 0.5);
  return ways.length ? towards * Math.min(...ways) : 0;
}

// Where a new box goes: beside one that is there, on the side that has room, else in the middle of the wall.
export function placed(label, beside, metre, [width, height]) {
  if (beside) {
    const wide = beside.x1 - beside.x0;
    const right = beside.x1 + 2 * wide <= width;
    return moved({ ...beside, label }, right ? 2 * wide : -2 * wide, 0, [width, height]);
  }
  const [w, h] = [Math.min(1.2 * metre, width / 2), Math.min(1.6 * metre, height / 2)];
  return { label, x0: (width - w) / 2, y0: (height - h) / 2, x1: (width + w) / 2, y1: (height + h) / 2 };
}
