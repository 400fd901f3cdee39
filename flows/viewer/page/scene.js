// What the 3D page draws with three.js: sky, light, haze, and materials as a graphics card, or a processor, can afford them.

import {
  BackSide, CanvasTexture, Color, DirectionalLight, FogExp2, HemisphereLight, Mesh, MeshBasicMaterial, MeshLambertMaterial, NeutralToneMapping, NoToneMapping,
  PCFShadowMap, PerspectiveCamera, Scene, SphereGeometry, SRGBColorSpace, Texture, WebGLRenderer,
} from "./vendor/three.js";

export const HAZE_M = 1500;
const FIELD = 65; // degrees from side to side at least, and from top to bottom at most
const NEAR_M = 0.12;
// Colours and rows of houses at the horizon: [houses around, least height, more height, share of haze], as in facade_core/street/sky.py.
const [ZENITH, HORIZON, LAND] = [[104, 151, 205], [222, 231, 238], [178, 184, 182]];
const ROOFLINES = [[151, 0.05, 0.035, 0.66], [89, 0.026, 0.04, 0.42]];
const [HOUSES, ROOFS] = [[148, 143, 134], [122, 98, 88]];
const SKY_PX = { software: [2048, 1024], card: [4096, 2048] };
// The sun and its shadows: from the south-west, 45 degrees high, over the surroundings of the walker.
const TO_SUN = [-0.5, 0.7, 0.5];
export const SHADOW_M = 120;
const SHADOW_PX = 4096;
// Light of the sky, of the ground and of the sun: a wall in the sun is a little brighter than its texture, one in the shade darker.
const [SKY_LIGHT, GROUND_LIGHT, SUN_LIGHT] = [0xeaf2ff, 0xd8d2c8, 0xfff1dc];
const [AROUND, DIRECT] = [2.8, 1.7];

const mix = (a, b, share) => a.map((value, i) => value + share * (b[i] - value));
const css = (colour) => `rgb(${colour.map(Math.round)})`;

export class Stage {
  constructor(canvas) {
    this.bySoftware = drawsBySoftware();
    try {
      this.renderer = new WebGLRenderer({ canvas, antialias: !this.bySoftware, powerPreference: "high-performance" });
    } catch {
      throw new Error("this browser has no WebGL 2, which the 3D view needs; block.glb opens in any glTF viewer");
    }
    Object.assign(this.renderer, { toneMapping: this.bySoftware ? NoToneMapping : NeutralToneMapping });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD, 1, NEAR_M, 8000);
    this.camera.rotation.order = "YXZ";
    this.scene.fog = new FogExp2(new Color(css(HORIZON)), 1 / HAZE_M);
    this.sky = new Mesh(new SphereGeometry(1, 64, 32), new MeshBasicMaterial({ map: paintedSky(SKY_PX[this.bySoftware ? "software" : "card"]), side: BackSide, fog: false, depthWrite: false, toneMapped: false }));
    this.sky.renderOrder = -1;
    this.scene.add(this.sky);
    if (!this.bySoftware) this.light();
  }

  light() {
    this.sun = new DirectionalLight(SUN_LIGHT, DIRECT);
    this.sun.castShadow = true;
    Object.assign(this.sun.shadow, { bias: -0.0005, autoUpdate: false });
    this.sun.shadow.mapSize.set(SHADOW_PX, SHADOW_PX);
    Object.assign(this.renderer.shadowMap, { enabled: true, type: PCFShadowMap });
    this.scene.add(new HemisphereLight(SKY_LIGHT, GROUND_LIGHT, AROUND), this.sun, this.sun.target);
  }

  // Shadows around a place are drawn anew where the viewer has come far, or something new casts them.
  castShadows(at, reach, renewed) {
    if (!this.sun || !(renewed || this.reach !== reach || this.sun.target.position.distanceTo(at) > reach / 4)) return;
    const { position, shadow, target } = this.sun;
    this.reach = reach;
    target.position.copy(at);
    position.set(...TO_SUN).multiplyScalar(2 * reach).add(at);
    Object.assign(shadow, { needsUpdate: true, normalBias: reach / 2000 });
    Object.assign(shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 1, far: 4 * reach }).updateProjectionMatrix();
  }

  // Draw at `scale` pixels for one of the page.
  draw(scale, haze) {
    const { renderer, camera, sky } = this;
    const { clientWidth, clientHeight } = renderer.domElement;
    renderer.setPixelRatio(scale);
    renderer.setSize(clientWidth, clientHeight, false);
    sky.position.copy(camera.position);
    sky.scale.setScalar(0.9 * camera.far);
    this.scene.fog.density = 1 / haze;
    renderer.render(this.scene, camera);
  }

  resize(width, height, far) {
    const across = Math.tan((FIELD * Math.PI) / 360);
    const aspect = width / Math.max(1, height);
    Object.assign(this.camera, { aspect, far, fov: (Math.atan(Math.min(across, across / aspect)) * 360) / Math.PI });
    this.camera.updateProjectionMatrix();
  }

  // The material that shows a texture; `under`: behind what shows the same more finely.
  material(map, under) {
    const kind = this.bySoftware ? MeshBasicMaterial : MeshLambertMaterial;
    const behind = under ? { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8 } : {};
    return new kind({ map, ...(this.bySoftware ? {} : { flatShading: true }), ...behind });
  }

  // The material of what stands around: the colours of their vertices.
  surroundingMaterial() {
    return new (this.bySoftware ? MeshBasicMaterial : MeshLambertMaterial)({ vertexColors: true });
  }

  close() {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

// A plugin of GLTFLoader: textures out of their own bytes, as the page's policy forbids addresses of blobs, at most `side` pixels wide.
export const textureReader = (side, anisotropy) => (parser) => ({
  name: "bitmaps",
  async loadTexture(index) {
    const { bufferView, mimeType } = parser.json.images[parser.json.textures[index].source];
    const bytes = await parser.getDependency("bufferView", bufferView);
    const [width, height] = jpegSize(new DataView(bytes)) || [side, side];
    const share = Math.min(1, side / Math.max(width, height));
    const resized = share < 1 ? { resizeWidth: Math.ceil(share * width), resizeHeight: Math.ceil(share * height), resizeQuality: "medium" } : {};
    const image = await createImageBitmap(new Blob([bytes], { type: mimeType }), { colorSpaceConversion: "none", ...resized });
    return Object.assign(new Texture(image), { flipY: false, anisotropy, needsUpdate: true, onUpdate: () => image.close() });
  },
});

// Width and height of a JPEG, from its frame header; null of another file.
function jpegSize(view) {
  for (let at = 2; view.getUint16(0) === 0xffd8 && at < view.byteLength - 9; at += 2 + view.getUint16(at + 2)) {
    const marker = view.getUint8(at + 1);
    if (marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker)) return [view.getUint16(at + 7), view.getUint16(at + 5)];
  }
  return null;
}

// Whether a processor draws: then there are fewer texels and pixels, and none of the costly filters.
function drawsBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

// The sky all around: from the horizon to the zenith, houses in haze along the horizon, land below.
function paintedSky([width, height]) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const picture = canvas.getContext("2d");
  const gradient = picture.createLinearGradient(0, 0, 0, height / 2);
  for (let step = 0; step <= 16; step++) gradient.addColorStop(1 - step / 16, css(mix(HORIZON, ZENITH, Math.sin((step * Math.PI) / 32) ** 0.55)));
  picture.fillStyle = gradient;
  picture.fillRect(0, 0, width, height / 2);
  picture.fillStyle = css(LAND);
  picture.fillRect(0, height / 2, width, height / 2);
  let state = 1;
  const drawn = () => (state = (state * 16807) % 2147483647) / 2147483647;
  for (const [houses, least, more, haze] of ROOFLINES) {
    for (let house = 0; house < houses; house++) {
      const [x, wide, tall, gable, tone] = [(house * width) / houses, width / houses, ((least + more * drawn()) * height) / Math.PI, drawn() < 0.5 ? 0.8 : 1, 0.9 + 0.2 * drawn()];
      for (const [colour, share] of [[ROOFS, 1], [HOUSES.map((value) => tone * value), 0.8]]) {
        picture.fillStyle = css(mix(colour, HORIZON, haze));
        picture.beginPath();
        for (const [along, up] of [[0, -0.1], [0, gable * share], [0.5, share], [1, gable * share], [1, -0.1]]) picture.lineTo(x + along * wide, height / 2 - up * tall);
        picture.fill();
      }
    }
  }
  return Object.assign(new CanvasTexture(canvas), { colorSpace: SRGBColorSpace });
}
