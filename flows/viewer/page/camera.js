// Where the viewer of the 3D page is and looks: on foot along streets, or as a bird.

import { EYE_M } from "./walking.js";

export const FIELD = 65; // degrees from side to side at least, and from top to bottom at most
const NEAR_M = 0.12;
const WALK_MS = 1.6; // metres a second; with Shift RUN times as fast
const RUN = 4;
const TURN_KEYS = 1.6; // radians a second
const FLIGHT_S = 0.9;
const BIRD_PITCH = -0.62;

export const WALK_KEYS = { KeyW: [0, 1], ArrowUp: [0, 1], KeyS: [0, -1], ArrowDown: [0, -1], KeyA: [-1, 0], KeyD: [1, 0] };
export const LOOK_KEYS = { ArrowLeft: -1, ArrowRight: 1, KeyQ: -1, KeyE: 1 };

export class Viewer {
  // surroundings: what a walker stands on; box: [low, high] of what there is, as the page draws it (x east, y up, z south), around
  // the place where the walk begins; heading: degrees, or null where there is no street.
  constructor(surroundings, box, heading) {
    this.surroundings = surroundings;
    this.feet = [0, 0, 0];
    this.stands = false; // on ground that is loaded
    this.yaw = heading === null ? 0 : (heading * Math.PI) / 180;
    this.pitch = 0.06;
    this.aspect = 1.6;
    this.over = { at: [0, 0, 0], distance: 100, yaw: this.yaw, pitch: BIRD_PITCH };
    this.bird = heading === null;
    this.flown = this.bird ? 1 : 0; // share of the way from the street to the bird's place
    this.setBox(box);
  }

  setBox(box) {
    this.box = box;
    this.reach = Math.max(box[1][0] - box[0][0], box[1][2] - box[0][2], 30);
  }

  // The bird's place from which all that there is fills the picture: looking as before, or along its shorter side where that is much
  // nearer.
  frame() {
    const ways = [0, 0.5, -0.5].map((turn) => this.framed(this.over.yaw + turn * Math.PI));
    const nearest = ways.reduce((best, one) => (one.distance < 0.85 * best.distance ? one : best));
    Object.assign(this.over, nearest, { pitch: BIRD_PITCH });
  }

  framed(yaw) {
    const [low, high] = this.box;
    const { tall, wide } = this.halves();
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1 ? high[0] : low[0], k & 2 ? high[1] : low[1], k & 4 ? high[2] : low[2]]);
    const at = [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2];
    const { right, up, ahead } = axes(yaw, BIRD_PITCH);
    let distance = 20;
    for (const corner of corners) {
      const from = corner.map((value, axis) => value - at[axis]);
      const [x, y, z] = [right, up, ahead].map((along) => dot(along, from));
      distance = Math.max(distance, Math.abs(x) / (0.92 * wide) - z, Math.abs(y) / (0.92 * tall) - z);
    }
    return { at, distance, yaw };
  }

  fly() {
    this.bird = !this.bird;
    if (!this.bird) return;
    this.over.yaw = this.yaw;
    this.frame();
  }

  // Stand somewhere else: a place as the page draws it.
  place(feet, heading) {
    this.feet = [...feet];
    this.stands = false;
    if (heading !== null) this.yaw = (heading * Math.PI) / 180;
  }

  // Half the sides of the picture at a metre.
  halves() {
    const across = Math.tan((FIELD * Math.PI) / 360);
    const tall = Math.min(across, across / this.aspect);
    return { tall, wide: tall * this.aspect };
  }

  // The viewer's place and view: between street and bird's place while flying from one to the other.
  pose() {
    const share = this.flown * this.flown * (3 - 2 * this.flown);
    const { at, distance, yaw, pitch } = this.over;
    const { ahead } = axes(yaw, pitch);
    const above = at.map((value, axis) => value - distance * ahead[axis]);
    const below = [this.feet[0], this.feet[1] + EYE_M, this.feet[2]];
    const mix = (a, b) => a + share * (b - a);
    const turn = ((((yaw - this.yaw) % (2 * Math.PI)) + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
    return { place: below.map((value, axis) => mix(value, above[axis])), yaw: this.yaw + share * turn, pitch: mix(this.pitch, pitch) };
  }

  // Whether something moved, while keys were held for some seconds.
  move(held, seconds) {
    const flown = this.flown;
    this.flown = Math.min(1, Math.max(0, this.flown + ((this.bird ? 1 : -1) * seconds) / FLIGHT_S));
    if (flown !== this.flown) return true;
    const pressed = (keys) => Object.entries(keys).filter(([key]) => held.has(key)).map(([, value]) => value);
    const turn = pressed(LOOK_KEYS).reduce((sum, value) => sum + value, 0);
    const [right, ahead] = pressed(WALK_KEYS).reduce(([r, a], [x, y]) => [r + x, a + y], [0, 0]);
    const yaw = this.bird ? this.over.yaw : this.yaw;
    this.look(turn * TURN_KEYS * seconds, 0);
    const landed = !this.bird && !this.stands && this.land();
    if (!right && !ahead) return turn !== 0 || landed;
    const fast = held.has("ShiftLeft") || held.has("ShiftRight") ? RUN : 1;
    const metres = (seconds * fast * (this.bird ? 0.4 * this.over.distance : WALK_MS)) / Math.hypot(right, ahead);
    const [dx, dz] = [Math.sin(yaw) * ahead + Math.cos(yaw) * right, -Math.cos(yaw) * ahead + Math.sin(yaw) * right].map((v) => v * metres);
    if (this.bird) {
      this.over.at[0] += dx;
      this.over.at[2] += dz;
    } else if (this.stands) {
      this.feet = this.surroundings.walk(this.feet, dx, dz);
    }
    return true;
  }

  // Come to stand once there is ground under the walk's beginning.
  land() {
    const ground = this.surroundings.ground(this.feet[0], this.feet[2], this.feet[1] + 1);
    if (ground === null) return false;
    this.feet[1] = ground;
    this.stands = true;
    return true;
  }

  look(turn, rise) {
    const own = this.bird ? this.over : this;
    own.yaw += turn;
    own.pitch = Math.min(this.bird ? -0.1 : 1.4, Math.max(this.bird ? -1.5 : -1.4, own.pitch + rise));
  }

  nearer(factor) {
    if (this.bird) this.over.distance = Math.min(6 * this.reach, Math.max(15, this.over.distance * factor));
    else if (this.stands) this.feet = this.surroundings.walk(this.feet, ...[Math.sin(this.yaw), -Math.cos(this.yaw)].map((v) => v * (factor < 1 ? 1 : -1)));
  }

  said() {
    const { place, yaw, pitch } = this.pose();
    const ground = this.surroundings.ground(place[0], place[2], this.bird ? Infinity : place[1]);
    const texts = { x: place[0], y: place[1], z: place[2], yaw, pitch, overGround: ground === null ? NaN : place[1] - ground };
    const written = Object.fromEntries(Object.entries(texts).map(([name, value]) => [name, value.toFixed(3)]));
    return { ...written, mode: this.bird ? "bird" : "street", stands: String(this.stands) };
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// Directions of a view: to its right, up and ahead.
export function axes(yaw, pitch) {
  const ahead = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), -Math.cos(yaw) * Math.cos(pitch)];
  const right = [Math.cos(yaw), 0, Math.sin(yaw)];
  const up = [right[1] * ahead[2] - right[2] * ahead[1], right[2] * ahead[0] - right[0] * ahead[2], right[0] * ahead[1] - right[1] * ahead[0]];
  return { right, up, ahead };
}

// From what is seen, around the viewer's place, to the picture, and back; `wide` and `tall` are half its sides at a metre, `shift`
// where the middle of the picture is on it, in halves of its sides.
export function matrices(yaw, pitch, { wide, tall }, far, shift = [0, 0]) {
  const { right, up, ahead } = axes(yaw, pitch);
  const [a, b] = [(far + NEAR_M) / (far - NEAR_M), (-2 * far * NEAR_M) / (far - NEAR_M)];
  const camera = new Float32Array(16);
  const back = new Float32Array(16);
  for (let axis = 0; axis < 3; axis++) {
    camera.set([right[axis] / wide - shift[0] * ahead[axis], up[axis] / tall - shift[1] * ahead[axis], a * ahead[axis], ahead[axis]], 4 * axis);
    back.set([right[axis] * wide], axis);
    back.set([up[axis] * tall], 4 + axis);
    back.set([ahead[axis]], 12 + axis);
  }
  camera[14] = b;
  back[15] = 1;
  return { camera, back };
}
