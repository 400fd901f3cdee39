// Which models of which blocks are shown: a 3D Tiles renderer for each block, all within one limit of bytes, and what a walker meets there.

import { Box3, Color, Float32BufferAttribute, GLTFLoader, LoadRegionPlugin, Mesh, MeshBVH, Raycaster, Sphere, SphereRegion, TilesRenderer, Vector3, acceleratedRaycast } from "./vendor/three.js";
import { evidenceColour } from "./columns.js";
import { blockBase } from "./elements.js";
import { distance } from "./geometry.js";
import { textureReader } from "./scene.js";

Mesh.prototype.raycast = acceleratedRaycast;

const MB = 1e6;
// Pixels that a texel of a coarse model may cover, more where a processor draws; the limit of bytes; the widest texture.
const [ERROR_PX, LIMIT, TEXTURE_PX] = [1, 1024 * MB, 8192];
const [ERROR_PX_SMALL, LIMIT_SMALL, TEXTURE_PX_SMALL] = [2.5, 192 * MB, 2048];
// What is nearer is loaded whole, so that a walker stands on it; a block that is smaller on the screen is not asked for.
const NEAR_M = 50;
const LEAST_PX = 6;
// Heights that are assumed of a block until its tiles are listed, over the ground of where the walk begins.
const ASSUMED_HEIGHTS = [-3, 25];
const AGAIN_MS = 10_000;
// How near a wall lets a walker come; heights over the ground at which it is met; the highest step up, and the deepest down.
const RADIUS_M = 0.45;
const MET_AT_M = [0.7, 1.5];
const STEP_UP_M = 0.6;
const STEP_DOWN_M = 4;
// Textures under colours are lightened; a wall farther from every facade's foot line is none, metres.
const SHADE_LIGHT = 1.7;
const WALL_M = 2.5;
const DOWN = new Vector3(0, -1, 0);

export class Tiles {
  // anchor: [east, north, up] in world metres of what the page draws at 0, x east, y up, z south; told: called when something new can be drawn.
  constructor(stage, city, anchor, told) {
    Object.assign(this, { stage, city, anchor, told, blocks: new Map(), failed: "", near: new Sphere(new Vector3(), NEAR_M), ray: new Raycaster() });
    this.ray.firstHitOnly = true;
    this.small = stage.bySoftware || (navigator.deviceMemory || 8) <= 4 || matchMedia("(pointer: coarse)").matches;
    this.limit = this.small ? LIMIT_SMALL : LIMIT;
    this.update();
  }

  // The list of blocks was read anew: those with another model are dropped.
  update() {
    const [east, north] = this.city.said.origin;
    const there = new Map(this.city.blocks.filter((row) => row.published && (row.outline.length || this.city.single)).map((row) => [row.number, row]));
    for (const [number, block] of this.blocks) if (there.get(number)?.published !== block.published) this.drop(block);
    for (const { number, published, outline } of there.values()) {
      if (this.blocks.has(number)) continue;
      const box = new Box3();
      for (const [x, y] of outline) for (const up of ASSUMED_HEIGHTS) box.expandByPoint(new Vector3(x + east - this.anchor[0], up, this.anchor[1] - y - north));
      this.blocks.set(number, { number, published, box, tiles: null });
    }
  }

  drop(block) {
    block.tiles?.dispose();
    this.blocks.delete(block.number);
  }

  close() {
    for (const block of this.blocks.values()) this.drop(block);
  }

  // Box of all blocks.
  box() {
    return [...this.blocks.values()].reduce((whole, { box }) => whole.union(box), new Box3());
  }

  open(block) {
    const base = blockBase(block.number, this.city.single);
    const tiles = new TilesRenderer(new URL(`${base}tiles/${block.published}/tileset.json`, location.href).href);
    tiles.errorTarget = this.small ? ERROR_PX_SMALL : ERROR_PX;
    tiles.autoDisableRendererCulling = false;
    tiles.downloadQueue.maxJobsPerOrigin = 2;
    tiles.parseQueue.maxJobs = 1;
    const { anchor, stage } = this;
    tiles.group.rotation.x = -Math.PI / 2;
    tiles.group.position.set(-anchor[0], -anchor[2], anchor[1]);
    const loader = new GLTFLoader(tiles.manager);
    loader.register(textureReader(this.small ? TEXTURE_PX_SMALL : TEXTURE_PX, this.small ? 1 : stage.renderer.capabilities.getMaxAnisotropy()));
    tiles.manager.addHandler(/\.gltf$/, loader);
    const region = new SphereRegion({ errorTarget: 0 });
    region.sphere = new Sphere(new Vector3(), NEAR_M);
    tiles.registerPlugin(new LoadRegionPlugin({ regions: [region] }));
    tiles.registerPlugin({ processTileModel: (scene, tile) => this.prepare(scene, tile) });
    tiles.setCamera(stage.camera);
    stage.scene.add(tiles.group);
    for (const change of ["needs-update", "load-model", "tile-visibility-change"]) tiles.addEventListener(change, () => { this.renewed = true; this.told(); });
    tiles.addEventListener("load-root-tileset", () => { tiles.group.updateMatrixWorld(); tiles.getBoundingBox(block.box); block.box.applyMatrix4(tiles.group.matrixWorld); this.surround(block, loader).catch((error) => { this.failed = error.message; this.told(); }); });
    tiles.addEventListener("load-model", ({ scene }) => this.shaded && this.paint(scene, block));
    tiles.addEventListener("load-error", ({ error }) => { this.failed = error.message; setTimeout(() => { this.failed = ""; tiles.resetFailedTiles(); this.told(); }, AGAIN_MS); });
    Object.assign(block, { tiles, region });
  }

  // What stands around a block is drawn from any distance; walkers pass it, and clicks miss it.
  async surround({ tiles, number, published }, loader) {
    const name = tiles.rootTileset.asset.extras?.surroundings;
    if (!name) return;
    const { scene } = await loader.loadAsync(new URL(`${blockBase(number, this.city.single)}tiles/${published}/${name}`, location.href).href);
    if (this.blocks.get(number)?.tiles !== tiles) return; // another was published meanwhile
    scene.rotation.x = Math.PI / 2;
    scene.position.set(...scene.userData.origin);
    scene.traverse((mesh) => {
      if (!mesh.isMesh) return;
      mesh.material.dispose();
      mesh.geometry.computeVertexNormals();
      Object.assign(mesh, { material: this.stage.surroundingMaterial(), castShadow: true, receiveShadow: true, raycast: () => {} });
    });
    tiles.group.add(scene);
    scene.updateMatrixWorld(true); // the group updates only when it moves
    this.renewed = true;
    this.told();
  }

  // A model is around the place that it names; walkers and clicks find its triangles by a tree.
  prepare(scene, tile) {
    scene.position.add(new Vector3(...scene.userData.origin));
    scene.traverse((mesh) => {
      if (!mesh.isMesh) return;
      const { material } = mesh;
      mesh.material = this.stage.material(material.map, !tile.parent);
      if (!tile.parent) tile.geometricError = texelMetres(mesh.geometry, material.map.image);
      mesh.castShadow = mesh.receiveShadow = true;
      material.dispose();
      mesh.geometry.boundsTree = new MeshBVH(mesh.geometry);
    });
  }

  // Choose what is drawn, ask for what is missing, and let go of what is not needed where bytes are short.
  select(place, heightPx) {
    const { stage: { camera, renderer } } = this;
    camera.updateMatrixWorld();
    const pixels = heightPx / (2 * Math.tan((camera.fov * Math.PI) / 360));
    for (const block of this.blocks.values()) {
      const away = block.box.isEmpty() ? 0 : block.box.distanceToPoint(camera.position);
      if (!block.tiles) {
        const { x, z } = block.box.getSize(new Vector3());
        if (away > NEAR_M && (Math.max(x, z) / away) * pixels < LEAST_PX) continue;
        this.open(block);
      }
      const { tiles, region } = block;
      Object.assign(tiles.lruCache, { maxBytesSize: this.limit, minBytesSize: 0.8 * this.limit });
      tiles.group.updateMatrixWorld();
      region.sphere.center.copy(place).applyMatrix4(tiles.group.matrixWorldInverse);
      tiles.setResolution(camera, heightPx * camera.aspect, heightPx);
      tiles.update();
      // the coarse model is drawn where a tile is missing
      const { scene } = tiles.root?.engineData || {};
      if (scene) scene.visible = tiles.root.traversal.isLeaf || tiles.root.children.some(({ traversal }) => traversal?.inFrustum && !traversal.visible);
    }
  }

  // Colour walls by what they rest on, or show their textures alone.
  shade(on) {
    this.shaded = on;
    for (const block of this.blocks.values()) block.tiles?.forEachLoadedModel((scene) => this.paint(scene, block));
    this.told();
  }

  async paint(scene, { number }) {
    const map = this.shaded && await this.city.load(number);
    scene.traverse((mesh) => {
      if (!mesh.isMesh) return;
      if (map && !mesh.geometry.attributes.color) mesh.geometry.setAttribute("color", wallColours(mesh, map));
      Object.assign(mesh.material, { vertexColors: Boolean(map), needsUpdate: true }).color.setScalar(map ? SHADE_LIGHT : 1);
    });
    this.told();
  }

  get opened() {
    return [...this.blocks.values()].flatMap(({ tiles }) => tiles || []);
  }

  figures() {
    const sum = (count) => this.opened.reduce((total, tiles) => total + count(tiles), 0);
    const coming = sum(({ stats }) => stats.queued + stats.downloading + stats.parsing);
    const listing = sum(({ root }) => (root ? 0 : 1));
    return { bytes: this.opened[0]?.lruCache.cachedBytes || 0, limit: this.limit, models: sum(({ stats }) => stats.visible), missing: coming + listing, coming };
  }

  // What a ray from `from` meets first: {point, object, block}, or null.
  hit(from, direction) {
    this.ray.set(from, direction);
    let first = null;
    for (const block of this.blocks.values()) {
      const [found] = block.tiles ? this.ray.intersectObject(block.tiles.group) : [];
      if (found && (!first || found.distance < first.distance)) first = { ...found, block: block.number };
    }
    return first;
  }

  // Height of the highest surface below `from` at a place; null where there is none.
  ground(x, z, from = 1e4) {
    return this.hit(new Vector3(x, from, z), DOWN)?.point.y ?? null;
  }

  // Where a walker with feet at `place` comes to who wants to go by (dx, dz): along walls, and no farther than there is ground.
  walk(place, dx, dz) {
    const steps = Math.max(1, Math.ceil(Math.hypot(dx, dz) / (0.5 * RADIUS_M)));
    for (let step = 0; step < steps; step++) {
      const to = place.clone().add(new Vector3(dx / steps, 0, dz / steps));
      for (let again = 0; again < 3 && this.push(to); again++);
      to.y = this.ground(to.x, to.z, place.y + STEP_UP_M) ?? -Infinity;
      if (to.y < place.y - STEP_DOWN_M || this.push(to.clone())) break;
      place.copy(to);
    }
  }

  // Move a place out of the reach of the walls around it; whether it was within.
  push(place) {
    let pushed = false;
    for (const mesh of this.meshesNear(place)) {
      for (const height of MET_AT_M) {
        const own = mesh.worldToLocal(new Vector3(place.x, place.y + height, place.z));
        const nearest = mesh.geometry.boundsTree.closestPointToPoint(own, {}, 0, RADIUS_M);
        if (!nearest || nearest.distance >= RADIUS_M) continue;
        const away = own.sub(nearest.point).setY(0);
        const far = away.length();
        if (far >= RADIUS_M - 0.01) continue;
        place.addScaledVector(away.divideScalar(far || 1), RADIUS_M - far + 1e-3);
        pushed = pushed || far < RADIUS_M - 0.05;
      }
    }
    return pushed;
  }

  meshesNear(place) {
    const found = [];
    for (const tiles of this.opened) {
      for (const tile of tiles.activeTiles) {
        if (tile.parent) tile.engineData.scene?.traverse((mesh) => mesh.isMesh && found.push(mesh));
      }
    }
    return found.filter((mesh) => mesh.geometry.boundingBox.distanceToPoint(mesh.worldToLocal(place.clone())) < 3);
  }
}

// Metres of a texel: of a mesh's area, and of that on its page.
function texelMetres({ index, attributes: { position, uv } }, { width, height }) {
  let [metres, texels] = [0, 0];
  const [a, b, c] = [new Vector3(), new Vector3(), new Vector3()];
  const area = (values) => {
    [a, b, c].forEach((point, k) => point.set(...values(k)));
    return b.sub(a).cross(c.sub(a)).length();
  };
  for (let corner = 0; corner < index.count; corner += 3) {
    const at = (k) => index.getX(corner + k);
    metres += area((k) => [position.getX(at(k)), position.getY(at(k)), position.getZ(at(k))]);
    texels += area((k) => [width * uv.getX(at(k)), height * uv.getY(at(k)), 0]);
  }
  return Math.sqrt(metres / Math.max(texels, 1));
}

// Colours of a mesh's vertices: of the nearest facade of its building on walls, else of nothing in particular.
function wallColours(mesh, block) {
  const { geometry: { index, attributes: { position } } } = mesh;
  const building = mesh.userData.name ?? mesh.parent.userData.name;
  const own = block.facades.filter((facade) => facade.building === building);
  const walls = (own.length ? own : block.facades).map(({ line, ...facade }) => ({ line, colour: new Color(evidenceColour(facade)).toArray() }));
  const origin = mesh.parent.userData.origin ?? mesh.parent.parent.userData.origin;
  const [east, north] = [0, 1].map((axis) => origin[axis] - block.origin[axis]);
  const colours = new Float32Array(position.count * 3).fill(0.55);
  const [a, b, c] = [new Vector3(), new Vector3(), new Vector3()];
  for (let corner = 0; corner < index.count; corner += 3) {
    const corners = [0, 1, 2].map((k) => index.getX(corner + k));
    [a, b, c].forEach((point, k) => point.fromBufferAttribute(position, corners[k]));
    const place = [east + (a.x + b.x + c.x) / 3, north - (a.z + b.z + c.z) / 3];
    const normal = b.sub(a).cross(c.sub(a));
    if (Math.abs(normal.y) > 0.7 * normal.length()) continue; // roofs and ground
    let [nearest, least] = [null, WALL_M];
    for (const wall of walls) {
      const away = distance(place, wall.line);
      if (away < least) [nearest, least] = [wall, away];
    }
    if (nearest) for (const vertex of corners) colours.set(nearest.colour, 3 * vertex);
  }
  return new Float32BufferAttribute(colours, 3);
}
