// What the 3D page draws by WebGL 2: the sky, textured models, and which of them is at a pixel.

import { matrices } from "./camera.js";

// As facade_core/street/sky.py has them.
const HORIZON = [222 / 255, 231 / 255, 238 / 255];
const ZENITH = [104 / 255, 151 / 255, 205 / 255];
const LAND = [178 / 255, 184 / 255, 182 / 255];
export const HAZE_M = 1500;
const ROOFLINES = [[151, 0.05, 0.035, 0.66], [89, 0.026, 0.04, 0.42]];
const HOUSES = [148 / 255, 143 / 255, 134 / 255];
const ROOFS = [122 / 255, 98 / 255, 88 / 255];
const EDGE = [0.0025, 0.014];

// Bytes of a texel on the graphics card, with its smaller levels.
const TEXEL_BYTES = (4 * 4) / 3;
// Further levels of a texture would show what is beside a piece of a page: pages keep eight texels around each.
const LEVELS = 4;

const VERTEX = `#version 300 es
  uniform mat4 camera; uniform vec3 offset;
  in vec3 position; in vec2 uv;
  out vec3 seen; out vec2 place;
  void main() { seen = position + offset; place = uv; gl_Position = camera * vec4(seen, 1.0); }`;
const SOLID = [
  VERTEX,
  `#version 300 es
  precision highp float;
  uniform sampler2D picture; uniform vec3 horizon; uniform float haze;
  in vec3 seen; in vec2 place; out vec4 colour;
  void main() { colour = vec4(mix(horizon, texture(picture, place).rgb, exp(-length(seen) / haze)), 1.0); }`,
];
// How far away the surface at a pixel is, and of which block.
const PICK = [
  VERTEX,
  `#version 300 es
  precision highp float; precision highp int;
  uniform uint block;
  in vec3 seen; in vec2 place; out uvec2 found;
  void main() { found = uvec2(floatBitsToUint(length(seen)), block + 1u); }`,
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

export class Scene {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, powerPreference: "high-performance" });
    if (!gl) throw new Error("this browser has no WebGL 2, which the 3D view needs; block.glb opens in any glTF viewer");
    this.gl = gl;
    this.sharp = gl.getExtension("EXT_texture_filter_anisotropic");
    this.solid = program(gl, ...SOLID);
    this.pick = program(gl, ...PICK);
    this.sky = program(gl, ...SKY);
    this.empty = gl.createVertexArray();
    this.places = new Map();
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    const renderer = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    // a processor draws: fewer texels, and none of the costly filters
    this.bySoftware = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
  }

  close() {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  // Buffers of a model on the graphics card: {textures, drawn, bytes}. images: of its pages, each half as wide `level` times.
  upload(parts, images, level) {
    const { gl } = this;
    let bytes = 0;
    const textures = images.map((image) => {
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, image);
      bytes += TEXEL_BYTES * image.width * image.height;
      image.close();
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAX_LEVEL, Math.max(0, LEVELS - level));
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
      for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
      if (this.sharp && !this.bySoftware) {
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
        bytes += values.byteLength;
        return buffer;
      });
      held.push(gl.createBuffer());
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, held[2]);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
      bytes += triangles.byteLength;
      gl.bindVertexArray(null);
      return { array, held, count: triangles.length, picture };
    });
    return { textures, drawn, bytes };
  }

  drop({ textures, drawn }) {
    for (const texture of textures) this.gl.deleteTexture(texture);
    for (const { array, held } of drawn) {
      this.gl.deleteVertexArray(array);
      for (const buffer of held) this.gl.deleteBuffer(buffer);
    }
  }

  set(used, name, kind, ...values) {
    const key = `${used === this.solid ? "solid" : used === this.sky ? "sky" : "pick"} ${name}`;
    if (!this.places.has(key)) this.places.set(key, this.gl.getUniformLocation(used, name));
    this.gl[`uniform${kind}`](this.places.get(key), ...values);
  }

  // models: [{buffers, at, under, block}]; scale: pixels drawn for one of the page.
  draw(models, pose, halves, { scale, haze, far }) {
    const { gl } = this;
    const [width, height] = [gl.canvas.clientWidth, gl.canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
    if (gl.canvas.width !== width || gl.canvas.height !== height) Object.assign(gl.canvas, { width, height });
    gl.viewport(0, 0, width, height);
    const { camera, back } = matrices(pose.yaw, pose.pitch, halves, far);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.sky);
    this.set(this.sky, "back", "Matrix4fv", false, back);
    for (const [name, colour] of [["horizon", HORIZON], ["zenith", ZENITH], ["land", LAND], ["walls", HOUSES], ["roofs", ROOFS]]) this.set(this.sky, name, "3fv", colour);
    this.set(this.sky, "rows", "4fv", ROOFLINES.flat());
    this.set(this.sky, "edge", "2fv", EDGE);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.solid);
    this.set(this.solid, "horizon", "3fv", HORIZON);
    this.set(this.solid, "haze", "1f", haze);
    this.drawModels(this.solid, models, camera, pose.place);
  }

  drawModels(used, models, camera, place) {
    const { gl } = this;
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    this.set(used, "camera", "Matrix4fv", false, camera);
    for (const { buffers, at, under, block } of models) {
      gl.polygonOffset(under ? 2 : 0, under ? 8 : 0); // the overview lies behind the tile that shows the same
      this.set(used, "offset", "3fv", at.map((value, axis) => value - place[axis]));
      if (used === this.pick) this.set(used, "block", "1ui", block);
      for (const { array, count, picture } of buffers.drawn) {
        gl.bindTexture(gl.TEXTURE_2D, buffers.textures[picture]);
        gl.bindVertexArray(array);
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
      }
    }
    gl.bindVertexArray(null);
  }

  // What is at [x, y] of the picture, from -1 to 1 and up: {block, away} in metres, or null for the sky.
  at([x, y], models, pose, halves, far) {
    const { gl } = this;
    if (!this.target) this.target = pickTarget(gl);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, 1, 1);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.pick);
    const tiny = { wide: halves.wide / 1000, tall: halves.tall / 1000 };
    this.drawModels(this.pick, models, matrices(pose.yaw, pose.pitch, tiny, far, [1000 * x, 1000 * y]).camera, pose.place);
    const found = new Uint32Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, found);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return found[1] ? { block: found[1] - 1, away: new Float32Array(found.buffer, 0, 1)[0] } : null;
  }
}

function pickTarget(gl) {
  const target = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  const attach = (format, attachment) => {
    const buffer = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorage(gl.RENDERBUFFER, format, 1, 1);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, buffer);
  };
  attach(gl.RG32UI, gl.COLOR_ATTACHMENT0);
  attach(gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT);
  return target;
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  // all programs draw the same buffers
  gl.bindAttribLocation(made, 0, "position");
  gl.bindAttribLocation(made, 1, "uv");
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
