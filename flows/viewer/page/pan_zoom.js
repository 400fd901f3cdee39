// What part of a plane a picture shows: panned and zoomed by pointer, wheel, fingers and keys.

const MOST_PX_PER_M = 60;
const PAN_SHARE = 0.2;
const KEY_FACTOR = 1.5;
// A pointer that moves less has clicked, pixels.
const CLICK_PX = 6;

export class PanZoom {
  // svg: the picture; changed: called when it shows another part; clicked: called with a place [x, y] of the plane and the event.
  constructor(svg, { changed, clicked }) {
    Object.assign(this, { svg, changed, clicked, size: [0, 0], whole: [0, 0, 1, 1], place: null, touched: false });
    this.pointers = new Map();
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    svg.addEventListener("pointerup", (event) => this.up(event));
    svg.addEventListener("pointercancel", (event) => this.pointers.delete(event.pointerId));
    svg.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(svg);
  }

  // Box [x0, y0, x1, y1] of all that there is; it is shown until somebody pans or zooms.
  extend(box) {
    this.whole = box;
    if (!this.touched) this.fit(box);
  }

  // Show a box, with some room around it.
  fit([x0, y0, x1, y1], least = 20) {
    const [width, height] = this.size;
    this.fitted = [x0, y0, x1, y1];
    if (!width) return;
    const scale = Math.min(width / Math.max(1.1 * (x1 - x0), least), height / Math.max(1.1 * (y1 - y0), least));
    this.show((x0 + x1) / 2, (y0 + y1) / 2, scale);
  }

  // Show a box because somebody asked for it.
  go(box, least) {
    this.touched = true;
    this.fit(box, least);
  }

  // A place in the middle, and pixels of a metre.
  show(x, y, scale) {
    const [x0, y0, x1, y1] = this.whole;
    const least = Math.min(MOST_PX_PER_M, 0.5 * Math.min(this.size[0] / Math.max(x1 - x0, 20), this.size[1] / Math.max(y1 - y0, 20)));
    this.place = { x: Math.min(x1, Math.max(x0, x)), y: Math.min(y1, Math.max(y0, y)), scale: Math.min(MOST_PX_PER_M, Math.max(least, scale)) };
    const [left, top, right, bottom] = this.box();
    this.svg.setAttribute("viewBox", `${left} ${top} ${right - left} ${bottom - top}`);
    this.changed();
  }

  // What is shown: [x0, y0, x1, y1].
  box() {
    const { x, y, scale } = this.place;
    const [width, height] = this.size.map((side) => side / scale / 2);
    return [x - width, y - height, x + width, y + height];
  }

  resize() {
    const { clientWidth, clientHeight } = this.svg;
    if (!clientWidth || (clientWidth === this.size[0] && clientHeight === this.size[1])) return;
    this.size = [clientWidth, clientHeight];
    if (!this.place || !this.touched) this.fit(this.fitted || this.whole);
    else this.show(this.place.x, this.place.y, this.place.scale);
  }

  // Zoom so that what is at a pixel [px, py] stays there; the middle without one.
  zoom(factor, pixel = this.size.map((side) => side / 2)) {
    if (!this.place) return;
    this.touched = true;
    const { x, y, scale } = this.place;
    const [dx, dy] = [pixel[0] - this.size[0] / 2, pixel[1] - this.size[1] / 2];
    const after = Math.min(MOST_PX_PER_M, scale * factor);
    this.show(x + dx / scale - dx / after, y + dy / scale - dy / after, after);
  }

  pan(dx, dy) {
    if (!this.place) return;
    this.touched = true;
    const { x, y, scale } = this.place;
    this.show(x - dx / scale, y - dy / scale, scale);
  }

  pixel(event) {
    const { left, top } = this.svg.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  at([px, py]) {
    const [x0, y0] = this.box();
    return [x0 + px / this.place.scale, y0 + py / this.place.scale];
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
    this.zoom(Math.exp(-0.002 * Math.max(-300, Math.min(300, lines * event.deltaY))), this.pixel(event));
  }

  down(event) {
    if (event.button !== 0) return;
    this.svg.focus({ preventScroll: true });
    this.svg.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { now: this.pixel(event), start: this.pixel(event), still: this.pointers.size === 0 });
  }

  move(event) {
    const held = this.pointers.get(event.pointerId);
    if (!held || !this.place) return;
    const at = this.pixel(event);
    if (Math.hypot(at[0] - held.start[0], at[1] - held.start[1]) > CLICK_PX) held.still = false;
    const before = held.now;
    held.now = at;
    const others = [...this.pointers.values()].filter((other) => other !== held);
    if (others.length) {
      for (const one of this.pointers.values()) one.still = false;
      const [far, near] = [at, before].map(([x, y]) => Math.max(1, Math.hypot(x - others[0].now[0], y - others[0].now[1])));
      this.zoom(far / near, [(at[0] + others[0].now[0]) / 2, (at[1] + others[0].now[1]) / 2]);
      this.pan((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
    } else if (!held.still) this.pan(at[0] - before[0], at[1] - before[1]);
  }

  up(event) {
    const held = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (held?.still && this.place) this.clicked(this.at(held.now), event);
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const [width, height] = this.size.map((side) => PAN_SHARE * side);
    const act = {
      ArrowLeft: () => this.pan(width, 0), ArrowRight: () => this.pan(-width, 0), ArrowUp: () => this.pan(0, height), ArrowDown: () => this.pan(0, -height),
      "+": () => this.zoom(KEY_FACTOR), "=": () => this.zoom(KEY_FACTOR), "-": () => this.zoom(1 / KEY_FACTOR), 0: () => this.go(this.whole),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }
}
