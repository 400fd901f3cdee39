// The blocks in 3D: a walk along their streets at eye height, and a bird's view. A frame is drawn only when something changes.

import { LOOK_KEYS, FIELD, Viewer, WALK_KEYS } from "./camera.js";
import { HAZE_M, Scene } from "./scene.js";
import { Stream } from "./stream.js";
import { Surroundings } from "./walking.js";

const SELECT_MS = 150;
const FAR_M = 8000;
// Frames a second below which fewer pixels are drawn, and above which more are; the least share of the page's pixels.
const SLOW_FPS = 15;
const FAST_FPS = 40;
const LEAST_SCALE = 0.35;
// A pointer that moves less has clicked, pixels.
const CLICK_PX = 6;

// Show a city in a canvas, which says in its dataset where the viewer is and how it goes. start: {anchor, heading}; told: called with
// words when what goes on changes; found: called with (block, [east, north, up]) of what was clicked.
export function show(canvas, city, { anchor, heading }, { told, found }) {
  const scene = new Scene(canvas);
  const surroundings = new Surroundings();
  const view = new View(canvas, scene);
  const stream = new Stream(scene, surroundings, city, anchor, () => (view.dirty = true));
  const viewer = new Viewer(surroundings, stream.box(), heading);
  viewer.aspect = canvas.clientWidth / Math.max(1, canvas.clientHeight);
  viewer.frame();
  Object.assign(view, { stream, viewer, told });
  const pick = (x, y) => {
    const { place } = viewer.pose();
    const hit = scene.at([x, y], stream.shown, viewer.pose(), viewer.halves(), view.far());
    if (!hit) return;
    const ray = direction(viewer, [x, y]);
    const [east, up, south] = place.map((value, axis) => value + hit.away * ray[axis]);
    found(hit.block, [east + anchor[0], anchor[1] - south, up + anchor[2]]);
  };
  listen(canvas, view, pick);
  requestAnimationFrame((now) => view.frame(now));
  return view;
}

// The direction of a place of the picture.
function direction(viewer, [x, y]) {
  const { yaw, pitch } = viewer.pose();
  const { wide, tall } = viewer.halves();
  const [flat, ahead] = [[Math.cos(yaw), 0, Math.sin(yaw)], [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), -Math.cos(yaw) * Math.cos(pitch)]];
  const up = [flat[1] * ahead[2] - flat[2] * ahead[1], flat[2] * ahead[0] - flat[0] * ahead[2], flat[0] * ahead[1] - flat[1] * ahead[0]];
  const ray = ahead.map((value, axis) => value + x * wide * flat[axis] + y * tall * up[axis]);
  const length = Math.hypot(...ray);
  return ray.map((value) => value / length);
}

class View {
  constructor(canvas, scene) {
    Object.assign(this, { canvas, scene, held: new Set(), dirty: true, before: performance.now(), selected: 0, scale: scene.bySoftware ? 0.6 : 1, fps: 0, drawn: 0 });
    new ResizeObserver(() => (this.dirty = true)).observe(canvas);
  }

  far() {
    return Math.max(FAR_M, 3 * this.viewer.over.distance + 2 * this.viewer.reach);
  }

  frame(now) {
    if (!this.canvas.isConnected) {
      this.scene.close();
      return;
    }
    const seconds = Math.min(0.1, (now - this.before) / 1000);
    const continued = this.moving;
    const { viewer, stream } = this;
    viewer.aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    this.moving = viewer.move(this.held, seconds) || this.dirty;
    if (this.moving && continued) this.measure(now - this.before);
    this.before = now;
    if (this.moving || now - this.selected > 4 * SELECT_MS) {
      if (now - this.selected > SELECT_MS) {
        this.selected = now;
        const before = String(stream.shown.map(({ address, level }) => `${address} ${level}`));
        stream.select(viewer.pose(), viewer.halves(), this.canvas.clientHeight * Math.min(2, devicePixelRatio || 1));
        if (String(stream.shown.map(({ address, level }) => `${address} ${level}`)) !== before) this.moving = true;
        viewer.setBox(stream.box());
      }
    }
    // at rest, all pixels are drawn once
    const rests = !this.moving && this.coarse;
    if (this.moving || rests) this.draw(rests);
    this.say();
    requestAnimationFrame((next) => this.frame(next));
  }

  draw(rests) {
    this.dirty = false;
    this.coarse = !rests && this.scale < 1;
    this.drawn += 1;
    const haze = Math.max(HAZE_M, 2 * this.viewer.over.distance * this.viewer.flown);
    const scale = Math.min(2, devicePixelRatio || 1) * (rests ? 1 : this.scale);
    this.scene.draw(this.stream.shown, this.viewer.pose(), this.viewer.halves(), { scale, haze, far: this.far() });
  }

  // Frames a second while something moves, and fewer pixels where they are few.
  measure(ms) {
    this.fps = this.fps ? 0.8 * this.fps + 0.2 * (1000 / Math.max(ms, 1)) : 1000 / Math.max(ms, 1);
    if (this.fps < SLOW_FPS) this.scale = Math.max(LEAST_SCALE, 0.9 * this.scale);
    else if (this.fps > FAST_FPS) this.scale = Math.min(1, 1.05 * this.scale);
  }

  say() {
    const { stream } = this;
    const figures = { fps: this.fps.toFixed(1), drawn: this.drawn, bytes: Math.round(stream.bytes), limit: stream.limit, models: stream.shown.length, missing: stream.missing, coming: stream.coming };
    Object.assign(this.canvas.dataset, this.viewer.said(), figures);
    const listed = [...stream.blocks.values()].some(({ asked }) => asked);
    this.told(stream.failed || (stream.missing || listed ? `Loading: ${stream.missing} models` : ""), `${this.fps ? `${this.fps.toFixed(0)} frames a second, ` : ""}${(stream.bytes / 1e6).toFixed(0)} of ${stream.limit / 1e6} MB`);
  }
}

function listen(canvas, view, pick) {
  const { viewer, held } = view;
  const touches = new Map();
  let click = null;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.focus();
    canvas.setPointerCapture(event.pointerId);
    touches.set(event.pointerId, [event.clientX, event.clientY]);
    click = touches.size === 1 && event.button === 0 ? [event.clientX, event.clientY] : null;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!touches.has(event.pointerId)) return;
    const [x, y] = touches.get(event.pointerId);
    if (click && Math.hypot(event.clientX - click[0], event.clientY - click[1]) > CLICK_PX) click = null;
    const apart = () => { const [a, b] = [...touches.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    const before = touches.size === 2 ? apart() : 0;
    touches.set(event.pointerId, [event.clientX, event.clientY]);
    const turn = (FIELD * Math.PI) / 180 / canvas.clientWidth;
    if (touches.size === 1 && !click) viewer.look(-turn * (event.clientX - x), turn * (event.clientY - y));
    else if (touches.size === 2 && Math.abs(apart() - before) > 0.5) viewer.nearer(before / apart());
    view.dirty = true;
  });
  canvas.addEventListener("pointerup", (event) => {
    touches.delete(event.pointerId);
    if (!click) return;
    click = null;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    pick((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
  });
  canvas.addEventListener("pointercancel", (event) => touches.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); viewer.nearer(event.deltaY > 0 ? 1.12 : 1 / 1.12); view.dirty = true; }, { passive: false });
  canvas.addEventListener("blur", () => held.clear());
  canvas.addEventListener("keyup", (event) => held.delete(event.code));
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.code === "KeyB" && !event.repeat) viewer.fly();
    else if (event.code === "Enter") pick(0, 0);
    else if (event.code in WALK_KEYS || event.code in LOOK_KEYS || event.code.startsWith("Shift")) held.add(event.code);
    else return;
    view.dirty = true;
    event.preventDefault();
  });
  // buttons for fingers walk as long as they are held
  for (const button of canvas.parentElement.querySelectorAll("button[data-key]")) {
    button.addEventListener("pointerdown", () => held.add(button.dataset.key));
    for (const end of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(end, () => held.delete(button.dataset.key));
  }
}
