// Which models of which blocks are on the graphics card: by how large their texels are on the screen, within a limit of bytes.

import { ask, blockBase } from "./elements.js";
import { axes } from "./camera.js";
import { readGlb } from "./glb.js";

const MB = 1e6;
// Pixels that a texel may cover; more where a processor draws.
const TEXEL_PX = 1;
const TEXEL_PX_BY_SOFTWARE = 2.5;
const LIMIT = 512 * MB;
const LIMIT_SMALL = 192 * MB;
// What is nearer is kept whole, so that a walker stands on it, metres.
const NEAR_M = 50;
// A block that is smaller is not loaded, pixels.
const LEAST_PX = 6;
// Models that are on their way at a time, and lists of a block's tiles.
const AT_ONCE = 2;
// The coarsest level: textures are half as wide so many times.
const COARSEST = 4;
// What is assumed until a model was here: metres of a texel, texels and bytes of geometry for a byte of its file.
const OVERVIEW_TEXEL_M = 0.4;
const TILE_TEXEL_M = 0.06;
const TEXELS_PER_BYTE = 4;
const GEOMETRY_PER_BYTE = 0.6;
// Heights that are assumed of a block until its tiles are listed, over the ground of where the walk begins.
const ASSUMED_HEIGHTS = [-3, 25];
// After a failure a model is asked for again after this time.
const AGAIN_MS = 10_000;

export class Stream {
  // told: called when something new can be drawn.
  constructor(scene, surroundings, city, anchor, told) {
    Object.assign(this, { scene, surroundings, city, anchor, told, blocks: new Map(), bytes: 0, coming: 0, listing: 0, shown: [], missing: 0, failed: "" });
    this.texelPx = scene.bySoftware ? TEXEL_PX_BY_SOFTWARE : TEXEL_PX;
    const small = scene.bySoftware || (navigator.deviceMemory || 8) <= 4 || matchMedia("(pointer: coarse)").matches;
    this.limit = small ? LIMIT_SMALL : LIMIT;
    this.update();
  }

  // The list of blocks was read anew: those with another model are dropped.
  update() {
    const [east, north] = this.city.said.origin;
    const there = new Set();
    for (const row of this.city.blocks) {
      if (!row.published || !(row.outline.length || this.city.single)) continue;
      there.add(row.number);
      const known = this.blocks.get(row.number);
      if (known?.published === row.published) continue;
      if (known) this.forget(known);
      const xs = row.outline.map(([x]) => x + east - this.anchor[0]);
      const zs = row.outline.map(([, y]) => this.anchor[1] - y - north);
      const box = [[Math.min(...xs), ASSUMED_HEIGHTS[0], Math.min(...zs)], [Math.max(...xs), ASSUMED_HEIGHTS[1], Math.max(...zs)]];
      this.blocks.set(row.number, { number: row.number, published: row.published, base: blockBase(row.number, this.city.single), box, models: null, after: 0 });
    }
    for (const block of this.blocks.values()) if (!there.has(block.number)) this.forget(block);
  }

  forget(block) {
    for (const model of block.models || []) this.drop(model);
    this.blocks.delete(block.number);
  }

  // Box of all blocks: [low, high].
  box() {
    const boxes = [...this.blocks.values()].map(({ box }) => box);
    return [0, 1].map((end) => [0, 1, 2].map((axis) => (end ? Math.max : Math.min)(...boxes.map((box) => box[end][axis]))));
  }

  // Choose what is drawn at a pose, ask for what is missing, and let go of what is not needed where bytes are short.
  select(pose, halves, heightPx) {
    const sight = new Sight(pose, halves);
    const perMetre = heightPx / (2 * halves.tall); // pixels of a metre at a metre
    const wanted = [];
    for (const block of this.blocks.values()) {
      const away = sight.away(block.box);
      const side = Math.max(block.box[1][0] - block.box[0][0], block.box[1][2] - block.box[0][2]);
      if (away > NEAR_M && (!sight.sees(block.box) || (side / away) * perMetre < LEAST_PX)) continue;
      if (!block.models) this.list(block);
      else wanted.push(...this.wantedOf(block, sight, away, this.texelPx / perMetre));
    }
    wanted.sort((a, b) => b.model.under - a.model.under || b.need - a.need);
    this.wanted = this.fitted(wanted);
    const now = performance.now();
    for (const { model } of this.wanted) model.used = now;
    if (this.bytes > this.limit) this.makeRoom(0);
    this.missing = this.wanted.filter(({ model, level }) => !model.buffers || model.level > level).length;
    this.shown = this.choose(sight);
    this.load();
  }

  // Models of a block that are wanted, at a level: {model, level, need}. `texel`: metres of a pixel's share at a metre.
  wantedOf(block, sight, away, texel) {
    const level = (model, metres) => Math.max(0, Math.min(COARSEST, Math.floor(Math.log2(Math.max(metres * texel, 1e-6) / model.texel))));
    const [overview, ...tiles] = block.models;
    const found = [{ model: overview, level: level(overview, away), need: 1 / Math.max(away, 1) }];
    for (const model of tiles) {
      const far = sight.away(model.box);
      const fine = far * texel < overview.texel;
      if (far < NEAR_M || (fine && sight.sees(model.box))) found.push({ model, level: level(model, far), need: overview.texel / Math.max(far * texel, 1e-6) });
    }
    return found;
  }

  // What of it fits the limit, the most needed first; textures of what does not fit are coarser.
  fitted(wanted) {
    let left = this.limit;
    const found = [];
    for (const { model, level, need } of wanted) {
      for (let coarser = level; coarser <= COARSEST; coarser++) {
        if (size(model, coarser) > left) continue;
        left -= size(model, coarser);
        found.push({ model, level: coarser, need });
        break;
      }
    }
    return found;
  }

  // Models that are drawn: tiles that are here, and the overview where one that is wanted is not, or where none is wanted.
  choose(sight) {
    const levels = new Map(this.wanted.map(({ model, level }) => [model, level]));
    const shown = [];
    for (const { models } of this.blocks.values()) {
      if (!models) continue;
      const [overview, ...tiles] = models;
      const seen = tiles.filter((tile) => sight.sees(tile.box));
      const fine = seen.filter((tile) => tile.buffers && (levels.has(tile) || !overview.buffers));
      shown.push(...fine);
      if (overview.buffers && fine.length < seen.length) shown.push(overview);
    }
    return shown;
  }

  // The list of a block's models.
  async list(block) {
    if (this.listing >= AT_ONCE || block.asked || performance.now() < block.after) return;
    block.asked = true;
    this.listing += 1;
    try {
      const { overview, tiles } = await ask("api/model", block.base);
      const model = (under, { address, bytes }, box, texel) => ({
        address: block.base + address, under, block: block.number, box, texel, level: 0, buffers: null, used: 0, after: 0,
        texels: TEXELS_PER_BYTE * bytes, geometry: GEOMETRY_PER_BYTE * bytes,
      });
      const boxes = tiles.map(({ box: [low, high] }) => {
        const [a, b] = [yUp(low, this.anchor), yUp(high, this.anchor)];
        return [[a[0], a[1], b[2]], [b[0], b[1], a[2]]];
      });
      block.box = [0, 1].map((end) => [0, 1, 2].map((axis) => (end ? Math.max : Math.min)(...boxes.map((box) => box[end][axis]))));
      block.models = [model(1, overview, block.box, OVERVIEW_TEXEL_M), ...tiles.map((tile, i) => model(0, tile, boxes[i], TILE_TEXEL_M))];
      this.told();
    } catch (error) {
      block.after = performance.now() + AGAIN_MS;
      this.failed = error.message;
    }
    block.asked = false;
    this.listing -= 1;
  }

  // Ask for the models that are needed most, where there is room.
  load() {
    for (const { model, level } of this.wanted) {
      if (this.coming >= AT_ONCE) return;
      if (model.coming || performance.now() < model.after || (model.buffers && model.level <= level)) continue;
      if (!this.makeRoom(size(model, level) - (model.buffers ? model.bytes : 0))) continue;
      this.fetch(model, level);
    }
  }

  // Let go of models that are not wanted, those first that were not for the longest time, then of those finer than they need be.
  makeRoom(bytes) {
    const wanted = new Map(this.wanted.map(({ model, level }) => [model, level]));
    const held = [...this.blocks.values()].flatMap(({ models }) => models || []).filter((model) => model.buffers && !model.coming);
    const idle = held.filter((model) => !wanted.has(model)).sort((a, b) => a.used - b.used);
    const finer = held.filter((model) => wanted.has(model) && model.level < wanted.get(model)).sort((a, b) => b.bytes - a.bytes);
    for (const model of [...idle, ...finer]) {
      if (this.bytes + bytes <= this.limit) break;
      this.drop(model);
    }
    return this.bytes + bytes <= this.limit;
  }

  async fetch(model, level) {
    model.coming = true;
    this.coming += 1;
    try {
      const answer = await fetch(model.address);
      if (!answer.ok) throw new Error(`a tile cannot be read (${answer.status})`);
      const { origin, parts, pictures } = readGlb(await answer.arrayBuffer());
      // of the page's own bytes, not premultiplied or turned: JPEGs are as they are
      const images = await Promise.all(pictures.map(({ blob, size: [width, height] }) =>
        createImageBitmap(blob, level ? { resizeWidth: Math.max(1, width >> level), resizeHeight: Math.max(1, height >> level), resizeQuality: "medium" } : {})));
      if (!this.blocks.get(model.block)?.models?.includes(model)) return images.forEach((image) => image.close());
      this.drop(model);
      model.at = yUp(origin, this.anchor);
      model.texels = pictures.reduce((sum, { size: [width, height] }) => sum + width * height, 0);
      model.texel = texelMetres(parts, pictures) || model.texel;
      model.buffers = this.scene.upload(parts, images, level);
      // a walker's triangles are in memory beside what is drawn
      model.geometry = model.buffers.bytes - textureBytes(model.texels, level) + (model.under ? 0 : parts.reduce((sum, { triangles }) => sum + 12 * triangles.length, 0));
      model.bytes = size(model, level);
      model.level = level;
      this.bytes += model.bytes;
      if (!model.under) this.surroundings.add(model.address, parts, model.at);
      this.failed = "";
      this.told();
    } catch (error) {
      model.after = performance.now() + AGAIN_MS;
      this.failed = error.message;
    } finally {
      model.coming = false;
      this.coming -= 1;
    }
  }

  drop(model) {
    if (!model.buffers) return;
    this.scene.drop(model.buffers);
    this.bytes -= model.bytes;
    model.buffers = null;
    this.surroundings.remove(model.address);
    this.shown = this.shown.filter((other) => other !== model);
  }
}

const textureBytes = (texels, level) => ((4 * 4) / 3) * (texels / 4 ** level);
const size = (model, level) => model.geometry + textureBytes(model.texels, level);

// World metres [east, north, up] as the page draws them: x east, y up, z south of the anchor.
export const yUp = (world, anchor) => [world[0] - anchor[0], world[2] - anchor[2], anchor[1] - world[1]];

// Metres of a texel in the middle of a model: of its area, and of that on its pages.
function texelMetres(parts, pictures) {
  let [metres, texels] = [0, 0];
  for (const { position, uv, triangles, picture } of parts) {
    const [width, height] = pictures[picture].size;
    for (let t = 0; t < triangles.length; t += 3) {
      const [i, j, k] = [triangles[t], triangles[t + 1], triangles[t + 2]];
      const [a, b] = [j, k].map((corner) => [0, 1, 2].map((axis) => position[3 * corner + axis] - position[3 * i + axis]));
      metres += Math.hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
      texels += Math.abs((uv[2 * j] - uv[2 * i]) * (uv[2 * k + 1] - uv[2 * i + 1]) - (uv[2 * j + 1] - uv[2 * i + 1]) * (uv[2 * k] - uv[2 * i])) * width * height;
    }
  }
  return texels > 0 ? Math.sqrt(metres / texels) : 0;
}

// What a viewer sees of boxes.
class Sight {
  constructor({ place, yaw, pitch }, { wide, tall }) {
    Object.assign(this, { place, wide, tall, ...axes(yaw, pitch) });
  }

  // Metres to a box.
  away([low, high]) {
    return Math.hypot(...this.place.map((value, axis) => Math.max(low[axis] - value, 0, value - high[axis])));
  }

  // Whether a part of a box may be in the picture.
  sees([low, high]) {
    const outside = [0, 0, 0, 0, 0];
    for (let k = 0; k < 8; k++) {
      const from = [k & 1 ? high : low, k & 2 ? high : low, k & 4 ? high : low].map((corner, axis) => corner[axis] - this.place[axis]);
      const [x, y, z] = [this.right, this.up, this.ahead].map((along) => along[0] * from[0] + along[1] * from[1] + along[2] * from[2]);
      [z < 0, x > this.wide * z, x < -this.wide * z, y > this.tall * z, y < -this.tall * z].forEach((is, side) => (outside[side] += is));
    }
    return outside.every((count) => count < 8);
  }
}
