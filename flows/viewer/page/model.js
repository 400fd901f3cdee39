// The blocks in 3D: a walk along their streets at eye height, and a bird's view. A frame is drawn only when something changes.

import { MapControls, MathUtils, Raycaster, Vector2, Vector3 } from "./vendor/three.js";
import { HAZE_M, SHADOW_M, Stage } from "./scene.js";
import { Tiles } from "./tiles.js";

const EYE_M = 1.7;
const WALK_MS = 1.6; // metres a second; with Shift RUN times as fast
const RUN = 4;
const TURN_KEYS = 1.6; // radians a second
const DRAG_TURN = 1.1; // radians for the width of the picture
const FLIGHT_S = 0.9;
const BIRD_PITCH = -0.62;
const WALK_KEYS = { KeyW: [0, 1], ArrowUp: [0, 1], KeyS: [0, -1], ArrowDown: [0, -1], KeyA: [-1, 0], KeyD: [1, 0] };
const LOOK_KEYS = { ArrowLeft: 1, ArrowRight: -1, KeyQ: 1, KeyE: -1 };
const SELECT_MS = 150;
const FAR_M = 8000;
// Frames a second below which fewer pixels are drawn, and above which more are; the least share of the page's pixels.
const SLOW_FPS = 15;
const FAST_FPS = 40;
const LEAST_SCALE = 0.35;
// A pointer that moves less has clicked, pixels.
const CLICK_PX = 6;

export class View {
  // Shows a city in a canvas, which says in its dataset where the viewer is and how it goes. start: {anchor, heading}; told: called with
  // words when what goes on changes; found: called with (block, [east, north, up]) of what was clicked.
  constructor(canvas, city, { anchor, heading }, { told, found }) {
    const stage = new Stage(canvas);
    Object.assign(this, { canvas, stage, anchor, told, found, held: new Set(), dirty: true, before: performance.now(), selected: 0, scale: stage.bySoftware ? 0.6 : 1, fps: 0, drawn: 0 });
    this.tiles = new Tiles(stage, city, anchor, () => (this.dirty = true));
    this.feet = new Vector3();
    this.stands = false; // on ground that is loaded
    this.bird = heading === null;
    this.flown = this.bird ? 1 : 0; // share of the way from the street to the bird's place
    [this.yaw, this.pitch] = [MathUtils.degToRad(-(heading || 0)), 0.06];
    this.above = stage.camera.clone(); // the bird
    this.controls = Object.assign(new MapControls(this.above, canvas), { enabled: this.bird, minDistance: 15, maxPolarAngle: 1.5, zoomSpeed: 1.5 });
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.resize();
    this.frameAll(this.yaw);
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.listen();
    requestAnimationFrame((now) => this.frame(now));
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.stage.resize(clientWidth, clientHeight, Math.max(FAR_M, 3 * this.controls.getDistance()));
    this.dirty = true;
  }

  // Stand somewhere else.
  place(x, y, z, heading = null) {
    this.feet.set(x, y, z);
    this.stands = false;
    if (heading !== null) this.yaw = MathUtils.degToRad(-heading);
    this.dirty = true;
  }

  // Take the bird where all that there is fills the picture.
  frameAll(yaw) {
    const { above, controls, stage: { camera } } = this;
    const box = this.tiles.box();
    box.getCenter(controls.target).setY(box.min.y);
    above.rotation.set(BIRD_PITCH, yaw, 0);
    above.updateMatrixWorld();
    const back = new Vector3(0, 0, 1).applyQuaternion(above.quaternion);
    const tall = Math.tan(MathUtils.degToRad(camera.fov / 2));
    let distance = 20;
    for (let k = 0; k < 8; k++) {
      const corner = new Vector3(...["x", "y", "z"].map((axis, i) => box[(k >> i) & 1 ? "max" : "min"][axis])).sub(controls.target).applyQuaternion(above.quaternion.clone().invert());
      distance = Math.max(distance, Math.abs(corner.x) / (0.92 * tall * camera.aspect) + corner.z, Math.abs(corner.y) / (0.92 * tall) + corner.z);
    }
    above.position.copy(controls.target).addScaledVector(back, distance);
    controls.maxDistance = 6 * distance;
    controls.update();
  }

  fly() {
    this.bird = !this.bird;
    this.controls.enabled = this.bird;
    if (this.bird) this.frameAll(this.yaw);
    this.dirty = true;
  }

  // Whether something moved, while keys were held for some seconds.
  move(seconds) {
    const flown = MathUtils.clamp(this.flown + ((this.bird ? 1 : -1) * seconds) / FLIGHT_S, 0, 1);
    if (flown !== this.flown) {
      this.flown = flown;
      return true;
    }
    const pressed = (keys) => Object.entries(keys).filter(([key]) => this.held.has(key)).map(([, value]) => value);
    const turn = TURN_KEYS * seconds * pressed(LOOK_KEYS).reduce((sum, value) => sum + value, 0);
    const step = pressed(WALK_KEYS).reduce((sum, [x, y]) => sum.add(new Vector2(x, y)), new Vector2());
    const landed = !this.bird && !this.stands && this.land();
    if (turn && this.bird) this.above.position.sub(this.controls.target).applyAxisAngle(this.above.up, turn).add(this.controls.target);
    else this.yaw += turn;
    if (!step.lengthSq()) return turn !== 0 || landed;
    const fast = this.held.has("ShiftLeft") || this.held.has("ShiftRight") ? RUN : 1;
    const yaw = this.bird ? this.controls.getAzimuthalAngle() : this.yaw;
    step.setLength(seconds * fast * (this.bird ? 0.4 * this.controls.getDistance() : WALK_MS)).rotateAround(new Vector2(), yaw);
    if (this.bird) for (const point of [this.above.position, this.controls.target]) point.add(new Vector3(step.x, 0, -step.y));
    else if (this.stands) this.tiles.walk(this.feet, step.x, -step.y);
    return true;
  }

  // Come to stand once there is ground under the walk's beginning.
  land() {
    const ground = this.tiles.ground(this.feet.x, this.feet.z, this.feet.y + 1);
    if (ground !== null) this.feet.y = ground;
    return (this.stands = ground !== null);
  }

  // The camera between street and bird's place.
  aim() {
    const { stage: { camera }, above, flown } = this;
    if (this.bird) this.controls.update();
    camera.position.set(this.feet.x, this.feet.y + EYE_M, this.feet.z);
    camera.rotation.set(this.pitch, this.yaw, 0);
    const share = flown * flown * (3 - 2 * flown);
    camera.position.lerp(above.position, share);
    camera.quaternion.slerp(above.quaternion, share);
    camera.updateMatrixWorld();
  }

  frame(now) {
    if (!this.canvas.isConnected) {
      this.tiles.close();
      this.controls.dispose();
      this.stage.close();
      return;
    }
    const seconds = Math.min(0.1, (now - this.before) / 1000);
    const continued = this.moving;
    this.moving = this.move(seconds) || this.dirty;
    if (this.moving && continued) this.measure(now - this.before);
    this.before = now;
    if (this.moving) this.aim();
    this.stale = this.stale || this.moving; // what is chosen to be drawn may not fit the place
    if (this.stale && now - this.selected > SELECT_MS) {
      Object.assign(this, { stale: false, selected: now });
      this.tiles.select(this.bird ? this.stage.camera.position : this.feet, this.canvas.clientHeight * Math.min(2, devicePixelRatio || 1));
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
    const [around, reach] = this.bird ? [this.controls.target, 2 ** Math.ceil(Math.log2(this.controls.getDistance()))] : [this.feet, SHADOW_M];
    this.stage.castShadows(around, reach, this.tiles.renewed);
    this.tiles.renewed = false;
    this.stage.draw(Math.min(2, devicePixelRatio || 1) * (rests ? 1 : this.scale), Math.max(HAZE_M, 2 * this.controls.getDistance() * this.flown));
  }

  // Frames a second while something moves, and fewer pixels where they are few.
  measure(ms) {
    this.fps = this.fps ? 0.8 * this.fps + 0.2 * (1000 / Math.max(ms, 1)) : 1000 / Math.max(ms, 1);
    if (this.fps < SLOW_FPS) this.scale = Math.max(LEAST_SCALE, 0.9 * this.scale);
    else if (this.fps > FAST_FPS) this.scale = Math.min(1, 1.05 * this.scale);
  }

  say() {
    const { position: { x, y, z }, rotation } = this.stage.camera;
    const figures = this.tiles.figures();
    const texts = { x, y, z, yaw: -rotation.y, pitch: rotation.x, overGround: y - this.feet.y };
    Object.assign(this.canvas.dataset, Object.fromEntries(Object.entries(texts).map(([name, value]) => [name, value.toFixed(3)])), figures,
      { mode: this.bird ? "bird" : "street", stands: String(this.stands), fps: this.fps.toFixed(1), drawn: this.drawn });
    this.told(this.tiles.failed || (figures.missing ? `Loading: ${figures.missing} models` : ""), `${this.fps ? `${this.fps.toFixed(0)} frames a second, ` : ""}${(figures.bytes / 1e6).toFixed(0)} of ${figures.limit / 1e6} MB`);
  }

  // Ask for what is at [x, y] of the picture, from -1 to 1 and up.
  pick(x, y) {
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(x, y), this.stage.camera);
    const hit = this.tiles.hit(ray.ray.origin, ray.ray.direction);
    if (hit) this.found(hit.block, [hit.point.x + this.anchor[0], this.anchor[1] - hit.point.z, hit.point.y + this.anchor[2]]);
  }

  listen() {
    const { canvas, held } = this;
    let [click, last] = [null, null];
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus();
      click = event.isPrimary && event.button === 0 ? [event.clientX, event.clientY] : null;
      last = click;
      if (!this.bird) canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!last || !event.isPrimary) return;
      if (click && Math.hypot(event.clientX - click[0], event.clientY - click[1]) > CLICK_PX) click = null;
      const turn = DRAG_TURN / canvas.clientWidth;
      if (!this.bird && !click) {
        this.yaw += turn * (event.clientX - last[0]);
        this.pitch = MathUtils.clamp(this.pitch + turn * (event.clientY - last[1]), -1.4, 1.4);
        this.dirty = true;
      }
      last = [event.clientX, event.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => {
      const { left, top, width, height } = canvas.getBoundingClientRect();
      if (click && event.type === "pointerup") this.pick((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
      [click, last] = [null, null];
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.bird || !this.stands) return;
      const metres = event.deltaY > 0 ? -1 : 1;
      this.tiles.walk(this.feet, -metres * Math.sin(this.yaw), -metres * Math.cos(this.yaw));
      this.dirty = true;
    }, { passive: false });
    canvas.addEventListener("blur", () => held.clear());
    canvas.addEventListener("keyup", (event) => held.delete(event.code));
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.code === "KeyB" && !event.repeat) this.fly();
      else if (event.code === "Enter") this.pick(0, 0);
      else if (event.code in WALK_KEYS || event.code in LOOK_KEYS || event.code.startsWith("Shift")) held.add(event.code);
      else return;
      this.dirty = true;
      event.preventDefault();
    });
    // buttons for fingers walk as long as they are held
    for (const button of canvas.parentElement.querySelectorAll("button[data-key]")) {
      button.addEventListener("pointerdown", () => held.add(button.dataset.key));
      for (const end of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(end, () => held.delete(button.dataset.key));
    }
  }
}
