// The block in 3D: a walk along its streets at eye height, and a bird's view. Drawn by WebGL 2 from the published tiles, those
// near the viewer first; what has not come yet is shown by the small overview.

import { readGlb } from "./glb.js";
import { EYE_M, Surroundings } from "./walking.js";

const FIELD = 65; // degrees from side to side at least, and from top to bottom at most
const NEAR_M = 0.12;
const FAR_M = 8000;
const WALK_MS = 1.6; // metres a second; with Shift RUN times as fast
const RUN = 4;
const TURN_KEYS = 1.6; // radians a second
const FLIGHT_S = 0.9;
// Tiles that come within this of the viewer are loaded; those twice as far away are let go of.
const LOADED_M = 500;
// As facade_core/street/sky.py has them.
const HORIZON = [222 / 255, 231 / 255, 238 / 255];
const ZENITH = [104 / 255, 151 / 255, 205 / 255];
const LAND = [178 / 255, 184 / 255, 182 / 255];
const HAZE_M = 1500;
const ROOFLINES = [[151, 0.05, 0.035, 0.66], [89, 0.026, 0.04, 0.42]];
const HOUSES = [148 / 255, 143 / 255, 134 / 255];
const ROOFS = [122 / 255, 98 / 255, 88 / 255];
const EDGE = [0.0025, 0.014];

const SOLID = [
  `#version 300 es
  uniform mat4 camera; uniform vec3 offset;
  in vec3 position; in vec2 uv;
  out vec3 seen; out vec2 place;
  void main() { seen = position + offset; place = uv; gl_Position = camera * vec4(seen, 1.0); }`,
  `#version 300 es
  precision highp float;
  uniform sampler2D picture; uniform vec3 horizon; uniform float haze;
  in vec3 seen; in vec2 place; out vec4 colour;
  void main() { colour = vec4(mix(horizon, texture(picture, place).rgb, exp(-length(seen) / haze)), 1.0); }`,
];
const SKY = [
  `#version 300 es
  uniform mat4 back; out vec3 ray;
  void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    vec4 far = back * vec4(corner, 1.0, 1.0);
    ray = far.xyz / far.w; gl_Position = vec4(corner, 1.0, 1.0);
  }`,
  `#version 300 es
  precision highp float;
  uniform vec3 horizon; uniform vec3 zenith; uniform vec3 land; uniform vec3 walls; uniform vec3 roofs;
  uniform vec4 rows[2]; uniform vec2 edge;
  in vec3 ray; out vec4 colour;
  float drawn(uint number, uint turn) {
    uint bits = (number + 97u * turn + 1u) * 2654435769u;
    bits = (bits ^ (bits >> 15u)) * 2246822519u;
    return float(bits ^ (bits >> 13u)) / 4294967296.0;
  }
  void main() {
    vec3 to = normalize(ray);
    vec3 shown = mix(horizon, zenith, pow(clamp(to.y, 0.0, 1.0), 0.55));
    shown += (land - horizon) * clamp(-80.0 * to.y, 0.0, 1.0);
    float steep = to.y / max(length(to.xz), 1e-6);
    float around = fract(atan(to.x, -to.z) / 6.283185307179586);
    for (int row = 0; row < 2; row++) {
      float at = around * rows[row].x;
      uint house = uint(min(at, rows[row].x - 1.0));
      uint turn = 3u * uint(row);
      float height = rows[row].y + rows[row].z * drawn(house, turn);
      height *= 1.0 - (drawn(house, turn + 1u) < 0.5 ? 0.4 * abs(at - float(house) - 0.5) : 0.0);
      vec3 tone = steep > 0.8 * height ? roofs : walls * (0.9 + 0.2 * drawn(house, turn + 2u));
      float covers = clamp((height - steep) / edge.x, 0.0, 1.0) * clamp(1.0 + (steep + edge.y) / edge.x, 0.0, 1.0);
      shown = mix(shown, mix(tone, horizon, rows[row].w), covers);
    }
    colour = vec4(shown, 1.0);
  }`,
];

const WALK_KEYS = { KeyW: [0, 1], ArrowUp: [0, 1], KeyS: [0, -1], ArrowDown: [0, -1], KeyA: [-1, 0], KeyD: [1, 0] };
const LOOK_KEYS = { ArrowLeft: -1, ArrowRight: 1, KeyQ: -1, KeyE: 1 };

// Show a model in a canvas, which says in its dataset where the viewer is. `told` is called with words when what goes on changes.
export async function show(canvas, model, told) {
  const gl = canvas.getContext("webgl2", { antialias: true, powerPreference: "high-performance" });
  if (!gl) throw new Error("this browser has no WebGL 2, which the 3D view needs; block.glb opens in any glTF viewer");
  const scene = new Scene(gl, model);
  const viewer = new Viewer(model, scene.surroundings);
  const held = new Set();
  listen(canvas, viewer, held);
  let before = performance.now();
  const frame = (now) => {
    if (!canvas.isConnected) {
      scene.close();
      return;
    }
    viewer.move(held, Math.min(0.1, (now - before) / 1000));
    before = now;
    scene.load(viewer, told);
    scene.draw(viewer);
    Object.assign(canvas.dataset, viewer.said());
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  return viewer;
}

class Viewer {
  constructor(model, surroundings) {
    this.surroundings = surroundings;
    const [low, high] = [0, 1].map((end) => [0, 1, 2].map((axis) => (end ? Math.max : Math.min)(...model.tiles.map(({ box }) => box[end][axis]))));
    const at = yUp([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]], model.anchor);
    this.middle = at;
    this.reach = Math.max(high[0] - low[0], high[1] - low[1], 30);
    this.feet = [0, 0, 0]; // the anchor is where the walk begins
    this.stands = false; // on ground that is loaded
    this.yaw = model.heading === null ? 0 : (model.heading * Math.PI) / 180;
    this.pitch = 0.06;
    this.over = { at: [...at], distance: 1.05 * this.reach, yaw: this.yaw, pitch: -0.62 };
    this.bird = model.heading === null;
    this.flown = this.bird ? 1 : 0; // share of the way from the street to the bird's place
  }

  fly() {
    this.bird = !this.bird;
    if (this.bird) Object.assign(this.over, { yaw: this.yaw, at: [...this.middle] });
  }

  // The viewer's place and view: between street and bird's place while flying from one to the other.
  pose() {
    const share = this.flown * this.flown * (3 - 2 * this.flown);
    const { at, distance, yaw, pitch } = this.over;
    const ahead = direction(yaw, pitch);
    const above = at.map((value, axis) => value - distance * ahead[axis]);
    const below = [this.feet[0], this.feet[1] + EYE_M, this.feet[2]];
    const mix = (a, b) => a + share * (b - a);
    const turn = ((((yaw - this.yaw) % (2 * Math.PI)) + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
    return { place: below.map((value, axis) => mix(value, above[axis])), yaw: this.yaw + share * turn, pitch: mix(this.pitch, pitch) };
  }

  move(held, seconds) {
    const flown = this.flown;
    this.flown = Math.min(1, Math.max(0, this.flown + ((this.bird ? 1 : -1) * seconds) / FLIGHT_S));
    if (flown !== this.flown) return;
    const pressed = (keys) => Object.entries(keys).filter(([key]) => held.has(key)).map(([, value]) => value);
    const turn = pressed(LOOK_KEYS).reduce((sum, value) => sum + value, 0);
    const [right, ahead] = pressed(WALK_KEYS).reduce(([r, a], [x, y]) => [r + x, a + y], [0, 0]);
    const yaw = this.bird ? this.over.yaw : this.yaw;
    this.look(turn * TURN_KEYS * seconds, 0);
    if (!this.bird && !this.stands) this.land();
    if (!right && !ahead) return;
    const fast = held.has("ShiftLeft") || held.has("ShiftRight") ? RUN : 1;
    const metres = (seconds * fast * (this.bird ? 0.4 * this.over.distance : WALK_MS)) / Math.hypot(right, ahead);
    const [dx, dz] = [Math.sin(yaw) * ahead + Math.cos(yaw) * right, -Math.cos(yaw) * ahead + Math.sin(yaw) * right].map((v) => v * metres);
    if (this.bird) {
      this.over.at[0] += dx;
      this.over.at[2] += dz;
    } else if (this.stands) {
      this.feet = this.surroundings.walk(this.feet, dx, dz);
    }
  }

  // Come to stand once there is ground under the walk's beginning.
  land() {
    const ground = this.surroundings.ground(this.feet[0], this.feet[2], this.feet[1] + 1);
    if (ground === null) return;
    this.feet[1] = ground;
    this.stands = true;
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

class Scene {
  constructor(gl, model) {
    this.gl = gl;
    this.model = model;
    this.surroundings = new Surroundings();
    this.loaded = new Map(); // address -> buffers of a model, null while it is on its way
    this.coming = 0;
    this.sharp = gl.getExtension("EXT_texture_filter_anisotropic");
    this.solid = program(gl, ...SOLID);
    this.sky = program(gl, ...SKY);
    this.empty = gl.createVertexArray();
    this.fetch(model.overview, null);
  }

  close() {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  // The nearest tile that is missing is asked for, two at a time.
  load(viewer, told) {
    const { place } = viewer.pose();
    const near = this.model.tiles
      .map((tile) => ({ tile, away: away(tile.box, place, this.model.anchor) }))
      .sort((a, b) => a.away - b.away);
    for (const { tile, away: distance } of near) {
      const wanted = distance < LOADED_M;
      if (wanted && !this.loaded.has(tile.address) && this.coming < 2) this.fetch(tile.address, tile);
      if (distance > 2 * LOADED_M && this.loaded.get(tile.address)) this.drop(tile.address);
    }
    const count = this.model.tiles.filter((tile) => this.loaded.get(tile.address)).length;
    const wanted = near.filter(({ away: distance }) => distance < LOADED_M).length;
    told(this.failed || (count < wanted ? `Loading: ${count} of ${wanted} tiles` : ""));
  }

  async fetch(address, tile) {
    this.loaded.set(address, null);
    this.coming += tile ? 1 : 0;
    try {
      const answer = await fetch(address);
      if (!answer.ok) throw new Error(`a tile cannot be read (${answer.status})`);
      const { origin, parts, pictures } = readGlb(await answer.arrayBuffer());
      const at = yUp(tile ? tile.origin : origin, this.model.anchor);
      // of the page's own bytes, not premultiplied or turned: JPEGs are as they are
      const images = await Promise.all(pictures.map((picture) => createImageBitmap(picture)));
      if (tile) this.surroundings.add(parts, at);
      this.loaded.set(address, { at, under: !tile, ...this.buffers(parts, images) });
    } catch (error) {
      this.failed = error.message;
    }
    this.coming -= tile ? 1 : 0;
  }

  buffers(parts, images) {
    const { gl } = this;
    const textures = images.map((image) => {
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, image);
      image.close();
      gl.generateMipmap(gl.TEXTURE_2D);
      // pages keep eight texels around each piece: further levels would show its neighbours
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAX_LEVEL, 4);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
      for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
      if (this.sharp) {
        const most = gl.getParameter(this.sharp.MAX_TEXTURE_MAX_ANISOTROPY_EXT);
        gl.texParameterf(gl.TEXTURE_2D, this.sharp.TEXTURE_MAX_ANISOTROPY_EXT, Math.min(16, most));
      }
      return texture;
    });
    const drawn = parts.map(({ position, uv, triangles, picture }) => {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      const held = [[position, "position", 3], [uv, "uv", 2]].map(([values, name, size]) => {
        const buffer = gl.createBuffer();
        const at = gl.getAttribLocation(this.solid, name);
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
        gl.enableVertexAttribArray(at);
        gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0);
        return buffer;
      });
      held.push(gl.createBuffer());
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, held[2]);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
      gl.bindVertexArray(null);
      return { array, held, count: triangles.length, picture };
    });
    return { textures, drawn };
  }

  drop(address) {
    const { textures, drawn } = this.loaded.get(address);
    for (const texture of textures) this.gl.deleteTexture(texture);
    for (const { array, held } of drawn) {
      this.gl.deleteVertexArray(array);
      for (const buffer of held) this.gl.deleteBuffer(buffer);
    }
    this.loaded.delete(address);
  }

  draw(viewer) {
    const { gl } = this;
    const scale = Math.min(2, devicePixelRatio || 1);
    const [width, height] = [gl.canvas.clientWidth, gl.canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
    if (gl.canvas.width !== width || gl.canvas.height !== height) Object.assign(gl.canvas, { width, height });
    gl.viewport(0, 0, width, height);
    const { place, yaw, pitch } = viewer.pose();
    const across = Math.tan((FIELD * Math.PI) / 360);
    const tall = Math.min(across, (across * height) / width);
    const wide = (tall * width) / height;
    const { camera, back } = matrices(yaw, pitch, wide, tall);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.sky);
    const set = (used, name, kind, ...values) => gl[`uniform${kind}`](gl.getUniformLocation(used, name), ...values);
    set(this.sky, "back", "Matrix4fv", false, back);
    for (const [name, colour] of [["horizon", HORIZON], ["zenith", ZENITH], ["land", LAND], ["walls", HOUSES], ["roofs", ROOFS]]) set(this.sky, name, "3fv", colour);
    set(this.sky, "rows", "4fv", ROOFLINES.flat());
    set(this.sky, "edge", "2fv", EDGE);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.useProgram(this.solid);
    set(this.solid, "camera", "Matrix4fv", false, camera);
    set(this.solid, "horizon", "3fv", HORIZON);
    set(this.solid, "haze", "1f", HAZE_M);
    const all = this.model.tiles.every((tile) => this.loaded.get(tile.address));
    for (const model of this.loaded.values()) {
      if (!model || (model.under && all)) continue;
      gl.polygonOffset(model.under ? 2 : 0, model.under ? 8 : 0); // the overview lies behind the tile that shows the same
      set(this.solid, "offset", "3fv", model.at.map((value, axis) => value - place[axis]));
      for (const { array, count, picture } of model.drawn) {
        gl.bindTexture(gl.TEXTURE_2D, model.textures[picture]);
        gl.bindVertexArray(array);
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
      }
    }
    gl.bindVertexArray(null);
  }
}

function listen(canvas, viewer, held) {
  const touches = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.focus();
    canvas.setPointerCapture(event.pointerId);
    touches.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!touches.has(event.pointerId)) return;
    const [x, y] = touches.get(event.pointerId);
    const apart = () => { const [a, b] = [...touches.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    const before = touches.size === 2 ? apart() : 0;
    touches.set(event.pointerId, [event.clientX, event.clientY]);
    const turn = (FIELD * Math.PI) / 180 / canvas.clientWidth;
    if (touches.size === 1) viewer.look(-turn * (event.clientX - x), turn * (event.clientY - y));
    else if (touches.size === 2 && Math.abs(apart() - before) > 0.5) viewer.nearer(before / apart());
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => touches.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); viewer.nearer(event.deltaY > 0 ? 1.12 : 1 / 1.12); }, { passive: false });
  canvas.addEventListener("blur", () => held.clear());
  canvas.addEventListener("keyup", (event) => held.delete(event.code));
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.code === "KeyB" && !event.repeat) viewer.fly();
    else if (event.code in WALK_KEYS || event.code in LOOK_KEYS || event.code.startsWith("Shift")) held.add(event.code);
    else return;
    event.preventDefault();
  });
  // buttons for fingers walk as long as they are held
  for (const button of canvas.parentElement.querySelectorAll("button[data-key]")) {
    button.addEventListener("pointerdown", () => held.add(button.dataset.key));
    for (const end of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(end, () => held.delete(button.dataset.key));
  }
}

// World metres [east, north, up] as the page draws them: x east, y up, z south of the anchor.
const yUp = (world, anchor) => [world[0] - anchor[0], world[2] - anchor[2], anchor[1] - world[1]];

const direction = (yaw, pitch) => [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), -Math.cos(yaw) * Math.cos(pitch)];

// Metres from a place to a box of the world, seen from above.
function away(box, place, anchor) {
  const [x, y] = [place[0] + anchor[0], anchor[1] - place[2]];
  return Math.hypot(Math.max(box[0][0] - x, 0, x - box[1][0]), Math.max(box[0][1] - y, 0, y - box[1][1]));
}

// From what is seen, around the viewer's place, to the picture, and back; `wide` and `tall` are half its sides at a metre.
function matrices(yaw, pitch, wide, tall) {
  const ahead = direction(yaw, pitch);
  const right = [Math.cos(yaw), 0, Math.sin(yaw)];
  const up = [right[1] * ahead[2] - right[2] * ahead[1], right[2] * ahead[0] - right[0] * ahead[2], right[0] * ahead[1] - right[1] * ahead[0]];
  const [a, b] = [(FAR_M + NEAR_M) / (FAR_M - NEAR_M), (-2 * FAR_M * NEAR_M) / (FAR_M - NEAR_M)];
  const camera = new Float32Array(16);
  const back = new Float32Array(16);
  for (let axis = 0; axis < 3; axis++) {
    camera.set([right[axis] / wide, up[axis] / tall, a * ahead[axis], ahead[axis]], 4 * axis);
    back.set([right[axis] * wide], axis);
    back.set([up[axis] * tall], 4 + axis);
    back.set([ahead[axis]], 12 + axis);
  }
  camera[14] = b;
  back[15] = 1;
  return { camera, back };
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(`the 3D view cannot be drawn here: ${gl.getProgramInfoLog(made)}`);
  return made;
}
