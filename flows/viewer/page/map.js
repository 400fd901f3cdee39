// The map of blocks: their outlines by state and, where they are large enough, buildings, streets and facades. Metres from the
// map's origin, x east, y down on the page.

import { STATES } from "./city.js";
import { element } from "./elements.js";
import { blockLabels, streetLabels } from "./labels.js";
import { PanZoom } from "./pan_zoom.js";

// A block that is this large shows its facades, pixels; and so many blocks at a time.
const DETAIL_PX = 90;
const MOST_DETAILED = 16;
// How far from a facade a click still chooses it, pixels.
const REACH_PX = 12;
const SETTLED_MS = 120;
const BAR_PX = 130;
const STREET_M = 7;

const ring = (points) => `M${points.map((point) => point.join(" ")).join("L")}Z`;
const path = (points) => `M${points.map((point) => point.join(" ")).join("L")}`;

export class BlockMap {
  // label: what the map shows, for those who do not see it; choose: called with (block, facade id); view: called when another
  // part is shown, with the numbers of the blocks whose facades it needs; colour, strong, sign: of a facade.
  constructor({ label, choose, view = () => {}, colour, strong = () => true, sign = () => null }) {
    Object.assign(this, { choose, view, colour, strong, sign, shapes: new Map(), details: new Map(), marked: [] });
    const layer = (name) => element("g", { class: name });
    // what belongs to a block is under what belongs to another only where both are of one kind
    this.kinds = ["around", "own", "streets", "facades"].map(layer);
    this.layers = { blocks: layer("blocks"), details: element("g", {}, ...this.kinds), marks: layer("marks"), labels: layer("labels") };
    this.svg = element("svg", { tabindex: 0, role: "application", "aria-roledescription": "map", "aria-label": label }, ...Object.values(this.layers));
    this.bar = element("div", { class: "scale-bar" }, element("span", {}));
    const button = (text, name, act) => element("button", { type: "button", "aria-label": name, title: name, onclick: act }, text);
    this.element = element("div", { class: "map" }, this.svg,
      element("div", { class: "map-buttons" }, button("+", "Zoom in", () => this.plane.zoom(1.6)), button("\u2212", "Zoom out", () => this.plane.zoom(1 / 1.6)),
        button("\u2922", "Show all", () => this.plane.go(this.plane.whole))),
      element("div", { class: "north", role: "img", "aria-label": "North is up" }, element("span", {}, "N"), element("span", {}, "\u2191")), this.bar);
    this.plane = new PanZoom(this.svg, { changed: () => this.moved(), clicked: (place) => this.clicked(place) });
  }

  // Blocks: [{number, outline [[x, y]], state, name}], with y up; those that are gone are taken away.
  setBlocks(blocks) {
    this.shapes.clear();
    this.layers.blocks.replaceChildren(...blocks.filter(({ outline }) => outline.length).map((block) => {
      const points = block.outline.map(([x, y]) => [x, -y]);
      const box = boxOf(points);
      this.shapes.set(block.number, { ...block, points, box });
      const [colour, text] = STATES[block.state];
      return element("path", { class: "block", "data-block": block.number, "data-state": block.state, d: ring(points), fill: colour, stroke: colour }, element("title", {}, `${block.name}: ${text}`));
    }));
    for (const number of this.details.keys()) if (!this.shapes.has(number)) this.drop(number);
    if (this.shapes.size) this.plane.extend(unite([...this.shapes.values()].map(({ box }) => box)));
  }

  // The map of a block, [dx, dy] metres from the map's origin, y up.
  setDetail(number, block, [dx, dy]) {
    this.drop(number);
    const flip = ([x, y]) => [x, -y];
    const outline = ({ rings }) => rings.map((points) => ring(points.map(flip))).join("");
    // a path each: parts of buildings lie over each other
    const buildings = (mine, name) => block.buildings.filter(({ own }) => own === mine).map((one) => element("path", { class: name, d: outline(one) }));
    const lines = block.facades.map((facade, index) => {
      const [[x1, y1], [x2, y2]] = facade.line.map(flip);
      return element("line", { class: "facade", "data-facade": facade.id, x1, y1, x2, y2, stroke: this.colour(facade), opacity: this.strong(index, number) ? 1 : 0.25 },
        element("title", {}, `${facade.id}: ${facade.street}, ${facade.status}`));
    });
    const streets = block.streets.map((street) => element("path", { class: "street", d: path(street.line.map(flip)), "stroke-width": STREET_M }, element("title", {}, street.name)));
    const groups = [buildings(false, "building around"), buildings(true, "building"), streets, lines].map((parts, kind) => {
      const group = element("g", { transform: `translate(${dx} ${-dy})` }, ...parts);
      this.kinds[kind].append(group);
      return group;
    });
    // what helps people who do not see clicks without a pointer
    groups.at(-1).addEventListener("click", (event) => event.detail === 0 && event.target.dataset.facade && this.choose(number, event.target.dataset.facade));
    this.details.set(number, { block, groups, lines, offset: [dx, -dy] });
    this.settle();
    if (!this.shapes.size) this.plane.extend(unite([...this.details.keys()].map((key) => this.extent(key))));
  }

  drop(number) {
    for (const group of this.details.get(number)?.groups || []) group.remove();
    this.details.delete(number);
  }

  // Box of a block's facades and streets on the map.
  extent(number) {
    const { block: { size: [width, height] }, offset: [dx, dy] } = this.details.get(number);
    return [dx, dy - height, dx + width, dy];
  }

  recolour() {
    for (const [number, { block, lines }] of this.details) {
      block.facades.forEach((facade, index) => {
        lines[index].setAttribute("stroke", this.colour(facade));
        lines[index].setAttribute("opacity", this.strong(index, number) ? 1 : 0.25);
      });
    }
  }

  // Marks: [{points: [[x, y]], closed}], y up, in place of those before; `here` with `heading` in degrees, of somebody who stood there.
  mark(marks, here = null) {
    this.marked = marks;
    this.here = here;
    this.drawMarks();
  }

  // Show what is marked, or a box [x0, y0, x1, y1] with y up.
  goTo(box) {
    this.plane.go([box[0], -box[3], box[2], -box[1]], 60);
  }

  moved() {
    const { scale } = this.plane.place;
    this.svg.style.setProperty("--facade", `${Math.min(7, Math.max(1.6, 2.2 * Math.sqrt(scale))).toFixed(1)}px`);
    const metres = niceLength(BAR_PX / scale);
    this.bar.style.width = `${metres * scale}px`;
    this.bar.firstChild.textContent = metres >= 1000 ? `${metres / 1000} km` : `${metres} m`;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.settle(), SETTLED_MS);
  }

  // Numbers of the blocks that are shown with their facades, those in the middle first.
  wanted() {
    if (!this.plane.place) return [];
    const [x0, y0, x1, y1] = this.plane.box();
    const { x, y, scale } = this.plane.place;
    const shown = [...this.shapes.values()].filter(({ box }) => box[2] > x0 && box[0] < x1 && box[3] > y0 && box[1] < y1);
    const large = shown.filter(({ box }) => this.shapes.size === 1 || scale * Math.max(box[2] - box[0], box[3] - box[1]) >= DETAIL_PX);
    const far = ({ box }) => Math.hypot((box[0] + box[2]) / 2 - x, (box[1] + box[3]) / 2 - y);
    return large.sort((a, b) => far(a) - far(b)).slice(0, MOST_DETAILED).map(({ number }) => number);
  }

  // What depends on the part that is shown, once it is no longer moved.
  settle() {
    if (!this.plane.place) return;
    const wanted = this.shapes.size ? this.wanted() : [...this.details.keys()];
    for (const number of this.details.keys()) if (!wanted.includes(number)) this.drop(number);
    for (const shape of this.layers.blocks.children) shape.classList.toggle("detailed", this.details.has(Number(shape.dataset.block)));
    this.drawMarks();
    const named = [...this.details.values()].flatMap(({ block, offset: [dx, dy] }) =>
      block.streets.map((street) => ({ name: street.name, points: street.line.map(([x, y]) => [x + dx, dy - y]) })));
    const blocks = [...this.shapes.values()].filter(({ number }) => !this.details.has(number));
    this.layers.labels.replaceChildren(...streetLabels(named, this.plane), ...blockLabels(blocks, this.plane));
    this.view(wanted);
  }

  drawMarks() {
    const { scale } = this.plane.place || { scale: 1 };
    const parts = this.marked.map(({ points, closed }) => {
      const flipped = points.map(([x, y]) => [x, -y]);
      return element("path", { class: closed ? "mark area" : "mark", d: closed ? ring(flipped) : path(flipped) });
    });
    for (const { block, offset: [dx, dy] } of this.details.values()) {
      for (const facade of block.facades) {
        const sign = this.sign(facade);
        if (!sign) continue;
        const [x, y] = [0, 1].map((axis) => (facade.line[0][axis] + facade.line[1][axis]) / 2);
        parts.push(element("circle", { class: "sign", cx: x + dx, cy: dy - y, r: 11 / scale }),
          element("text", { x: x + dx, y: dy - y + 5 / scale, "font-size": 15 / scale, "text-anchor": "middle" }, sign));
      }
    }
    if (this.here) {
      const { at: [x, y], heading } = this.here;
      if (heading !== null) {
        const [east, north] = [Math.sin((heading * Math.PI) / 180), Math.cos((heading * Math.PI) / 180)].map((part) => (40 * part) / scale);
        parts.push(element("line", { class: "looks", x1: x, y1: -y, x2: x + east, y2: -y - north }));
      }
      parts.push(element("circle", { class: "here", cx: x, cy: -y, r: 6 / scale }));
    }
    this.layers.marks.replaceChildren(...parts);
  }

  // The facade at a place of the map, else the block.
  clicked([x, y]) {
    let best = null;
    let least = REACH_PX / this.plane.place.scale;
    for (const [number, { block, offset: [dx, dy] }] of this.details) {
      for (const facade of block.facades) {
        const away = distance([x - dx, dy - y], facade.line);
        if (away < least) [best, least] = [{ number, id: facade.id }, away];
      }
    }
    if (best) {
      this.choose(best.number, best.id);
      return;
    }
    const block = [...this.shapes.values()].find(({ points, number }) => !this.details.has(number) && inside([x, y], points));
    if (block) this.plane.go(block.box);
  }
}

// A small map of one block and nothing else: `within` are corners [low, high] of the part that is shown first, y up.
export function smallMap(block, { colour, strong = () => true, here = null, heading = null, within = null, called = () => null, choose, label }) {
  const map = new BlockMap({ label, colour, strong, sign: called, choose: (_, id) => choose(id) });
  map.setDetail(0, block, [0, 0]);
  if (here) map.mark([], { at: here, heading });
  if (within) map.plane.go([within[0][0], -within[1][1], within[1][0], -within[0][1]]);
  return map.element;
}

export const boxOf = (points) => {
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
};
export const unite = (boxes) => [0, 1, 2, 3].map((side) => (side < 2 ? Math.min : Math.max)(...boxes.map((box) => box[side])));

// The largest of 1, 2 and 5 times a power of ten that is no longer.
export function niceLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((digit) => digit * power).find((length) => length <= most);
}

// Metres from a place to a line of two points.
export function distance([x, y], [[x1, y1], [x2, y2]]) {
  const length = (x2 - x1) ** 2 + (y2 - y1) ** 2;
  const share = length ? Math.min(1, Math.max(0, ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / length)) : 0;
  return Math.hypot(x - x1 - share * (x2 - x1), y - y1 - share * (y2 - y1));
}

function inside([x, y], points) {
  let found = false;
  points.forEach(([x1, y1], i) => {
    const [x2, y2] = points[(i + 1) % points.length];
    if (y1 > y !== y2 > y && x < x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)) found = !found;
  });
  return found;
}
