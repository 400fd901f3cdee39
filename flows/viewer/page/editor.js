// Boxes drawn over a facade's picture, under pointer and keys.

import { LEAST, Steps, moved, placed, snapped, spanned, stretched, stride } from "./boxes.js";
import { element } from "./elements.js";

// How near to a line a box is drawn to it, and how large what it is stretched by is, half, pixels of the page.
const REACH = 7;
const HANDLE = matchMedia("(pointer: coarse)").matches ? 11 : 5;
const EDGES = ["nw", "n", "ne", "e", "se", "s", "sw", "w"];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

// Boxes that are no elements: what pictures show that is not of the facade, and what is of it although it looks like something
// in front.
export const MASKS = ["hide", "keep"];
const MASK_COLOURS = { hide: "#e5006d", keep: "#00e5ff" };

export class Editor {
  // stand: what /edit/facade says, `said` among it; colours: label -> colour; changed: called after every step.
  constructor(stand, labels, colours, changed) {
    Object.assign(this, { size: stand.size, metre: stand.texels_per_metre, labels, colours, changed });
    this.lines = { rows: stand.rows, columns: stand.columns };
    this.label = labels[0];
    this.snap = true;
    this.selected = null;
    this.drag = null;
    this.restart(stand);
    const [width, height] = this.size;
    this.image = element("image", { width, height, preserveAspectRatio: "none" });
    this.grid = element("g", { class: "lattice" });
    this.layer = element("g", {});
    this.svg = element("svg", {
      viewBox: `0 0 ${width} ${height}`, tabindex: 0, role: "application", "aria-roledescription": "picture with boxes", class: "boxes",
      "aria-describedby": "keys", onkeydown: (event) => this.key(event), onpointerdown: (event) => this.down(event),
      onpointermove: (event) => this.move(event), onpointerup: () => this.up(), onpointercancel: () => this.drop(),
    }, this.image, this.grid, this.layer);
    new ResizeObserver(() => this.draw()).observe(this.svg);
    this.lattice();
  }

  restart(stand) {
    const masks = MASKS.flatMap((label) => stand[label].map((box) => [label, ...box]));
    const boxes = [...stand.elements, ...masks].map(([label, x0, y0, x1, y1]) => ({ label, x0, y0, x1, y1 }));
    this.steps = new Steps({ boxes, said: stand.said });
    this.saved = boxes;
    this.selected = null;
    // Boxes that nobody drew: as they were found, or as a completion has them. A box that is changed is another object.
    this.found = new WeakSet(boxes);
  }

  get boxes() {
    return this.steps.now.boxes;
  }

  // What is said of the wall and its building beside boxes: name -> value.
  get said() {
    return this.steps.now.said;
  }

  say(name, value) {
    if (this.said[name] !== value) this.steps.take({ boxes: this.boxes, said: { ...this.said, [name]: value } }, `said ${name}`);
    this.changed();
  }

  // What is known to be kept of that now, which is no step.
  stands(said) {
    this.steps.now = { boxes: this.boxes, said };
    this.steps.kind = null;
  }

  get dirty() {
    return this.boxes !== this.saved;
  }

  get box() {
    return this.selected === null ? null : this.boxes[this.selected];
  }

  // Boxes as they are saved, shares of the wall: elements, and what is hidden and kept; null where nothing is.
  shares() {
    const [width, height] = this.size;
    const share = ({ x0, y0, x1, y1 }) => [x0 / width, y0 / height, x1 / width, y1 / height];
    const mask = (label) => this.boxes.filter((box) => box.label === label).map(share);
    const elements = this.elements.map((box) => [box.label, ...share(box)]);
    return { elements, ...Object.fromEntries(MASKS.map((label) => [label, mask(label).length ? mask(label) : null])) };
  }

  get elements() {
    return this.boxes.filter((box) => !MASKS.includes(box.label));
  }

  // Elements as they are completed: with whether they were drawn here.
  observations() {
    const { elements, hide } = this.shares();
    return { elements: this.elements.map((box, number) => [...elements[number], !this.found.has(box)]), hide };
  }

  // Elements in place of those that are here; masks stay.
  complete(elements) {
    this.take([...elements, ...this.boxes.filter((box) => MASKS.includes(box.label))], null);
  }

  lattice() {
    const [width, height] = this.size;
    const line = (x1, y1, x2, y2) => element("line", { x1, y1, x2, y2 });
    this.grid.replaceChildren(...(this.snap
      ? [...this.lines.rows.map((y) => line(0, y, width, y)), ...this.lines.columns.map((x) => line(x, 0, x, height))]
      : []));
  }

  draw() {
    const shown = this.boxes.map((box, number) => [this.drag?.number === number ? this.drag.box : box, number]);
    if (this.drag && this.drag.number === null) shown.push([this.drag.box, null]);
    // the small ones over the large ones, and over all the one that is held
    const held = (number) => number === (this.drag ? this.drag.number : this.selected);
    const area = (box) => (box.x1 - box.x0) * (box.y1 - box.y0);
    shown.sort(([a, m], [b, n]) => held(m) - held(n) || area(b) - area(a));
    const drawn = shown.map(([box, number]) => element("rect", {
      class: `box${MASKS.includes(box.label) ? " mask" : ""}${held(number) ? " held" : ""}`, "data-number": number, x: box.x0, y: box.y0, width: box.x1 - box.x0, height: box.y1 - box.y0,
      stroke: this.colour(box.label), fill: this.colour(box.label),
    }, element("title", {}, box.label)));
    this.layer.replaceChildren(...drawn, ...(this.box && !this.drag ? this.handles(this.box) : []));
  }

  colour(label) {
    return this.colours[label] ?? MASK_COLOURS[label];
  }

  handles(box) {
    const half = HANDLE * this.texel();
    const at = (edges, low, high, start, end) => (edges.includes(low) ? start : edges.includes(high) ? end : (start + end) / 2);
    return EDGES.map((edges) => element("rect", {
      class: `handle to-${edges}`, "data-edges": edges, width: 2 * half, height: 2 * half,
      x: at(edges, "w", "e", box.x0, box.x1) - half, y: at(edges, "n", "s", box.y0, box.y1) - half,
    }));
  }

  // Texels of a pixel of the page.
  texel() {
    const matrix = this.svg.getScreenCTM();
    return matrix && matrix.a > 0 ? 1 / matrix.a : 1;
  }

  place(event) {
    return new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
  }

  // A step that is done: the boxes then, and which is held.
  take(boxes, selected, kind = null) {
    this.steps.take({ boxes, said: this.said }, kind);
    this.select(selected);
  }

  select(number) {
    this.selected = number === null || !this.boxes.length ? null : Math.min(number, this.boxes.length - 1);
    if (this.box) this.label = this.box.label;
    this.draw();
    this.changed();
  }

  replace(box, kind = null) {
    if (["label", "x0", "y0", "x1", "y1"].every((name) => box[name] === this.box[name])) return this.select(this.selected);
    this.take(this.boxes.map((other, number) => (number === this.selected ? box : other)), this.selected, kind);
  }

  add() {
    const box = placed(this.label, this.box, this.metre, this.size);
    this.take([...this.boxes, this.snap ? snapped(box, null, this.lines, Infinity, this.size) : box], this.boxes.length);
  }

  remove() {
    if (this.box) this.take(this.boxes.filter((_, number) => number !== this.selected), null);
  }

  undo() {
    this.steps.undo();
    this.select(this.selected);
  }

  redo() {
    this.steps.redo();
    this.select(this.selected);
  }

  called(label) {
    this.label = label;
    if (this.box && this.box.label !== label) this.replace({ ...this.box, label });
    else this.changed();
  }

  snapping(on) {
    this.snap = on;
    this.lattice();
    this.changed();
  }

  next(by) {
    const count = this.boxes.length;
    if (count) this.select(this.selected === null ? (by > 0 ? 0 : count - 1) : (this.selected + by + count) % count);
  }

  // By an arrow: the box as a whole, or with Shift its right and lower edges.
  arrow([x, y], stretches) {
    const { x0, y0, x1, y1 } = this.box;
    const dx = x && stride(stretches ? [x1] : [x0, x1], x, this.snap && this.lines.columns);
    const dy = y && stride(stretches ? [y1] : [y0, y1], y, this.snap && this.lines.rows);
    const box = stretches ? stretched(this.box, x ? "e" : "s", dx, dy, this.size) : moved(this.box, dx, dy, this.size);
    this.replace(box, `${stretches ? "stretched" : "moved"} ${this.selected}`);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const label = this.labels[Number(event.key) - 1];
    const keys = {
      a: () => this.add(), n: () => this.next(1), p: () => this.next(-1), s: () => this.snapping(!this.snap),
      Delete: () => this.remove(), Backspace: () => this.remove(), Escape: () => (this.drag ? this.drop() : this.select(null)),
    };
    const arrow = ARROWS[event.key];
    const act = arrow ? this.box && (() => this.arrow(arrow, event.shiftKey)) : label ? () => this.called(label) : keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  down(event) {
    if (event.button !== 0) return;
    event.preventDefault();
    this.svg.focus({ preventScroll: true });
    this.svg.setPointerCapture(event.pointerId);
    const { number, edges } = event.target.dataset;
    const start = this.place(event);
    if (edges) this.drag = { number: this.selected, edges, start, from: this.box, box: this.box };
    else if (number !== undefined) {
      this.select(Number(number));
      this.drag = { number: this.selected, edges: null, start, from: this.box, box: this.box };
    } else this.drag = { number: null, start, box: spanned(this.label, start, start, this.size) };
  }

  move(event) {
    if (!this.drag) return;
    const { start, from, edges } = this.drag;
    const at = this.place(event);
    const reach = this.snap ? REACH * this.texel() : -1;
    if (from) {
      const box = edges ? stretched(from, edges, at.x - start.x, at.y - start.y, this.size) : moved(from, at.x - start.x, at.y - start.y, this.size);
      // a click that trembles moves nothing
      this.drag.box = Math.hypot(at.x - start.x, at.y - start.y) < 3 * this.texel() ? from : snapped(box, edges, this.lines, reach, this.size);
    } else {
      const box = spanned(this.label, start, at, this.size);
      this.drag.box = snapped(box, "nesw", this.lines, reach, this.size);
    }
    this.draw();
  }

  up() {
    if (!this.drag) return;
    const { number, from, box } = this.drag;
    this.drag = null;
    const large = box.x1 - box.x0 >= LEAST && box.y1 - box.y0 >= LEAST;
    if (from && box !== from) this.replace(box);
    else if (!from && large) this.take([...this.boxes, box], this.boxes.length);
    else this.select(number);
  }

  drop() {
    this.drag = null;
    this.draw();
  }
}
