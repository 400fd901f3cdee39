// What the 3D page uses of three.js, 3d-tiles-renderer and three-mesh-bvh, as one file; `make engines` writes it.
export {
  BackSide, Box3, CanvasTexture, Color, DirectionalLight, Float32BufferAttribute, FogExp2, HemisphereLight, MathUtils, Mesh, MeshBasicMaterial, MeshLambertMaterial, NeutralToneMapping,
  NoToneMapping, PCFShadowMap, PerspectiveCamera, Raycaster, Scene, Sphere, SphereGeometry, SRGBColorSpace, Texture, Vector2, Vector3, WebGLRenderer,
} from "three";
export { MapControls } from "three/addons/controls/MapControls.js";
export { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
export { TilesRenderer } from "3d-tiles-renderer/three";
export { LoadRegionPlugin, SphereRegion } from "3d-tiles-renderer/src/three/plugins/LoadRegionPlugin.js";
export { MeshBVH, acceleratedRaycast } from "three-mesh-bvh";
