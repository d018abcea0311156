// What the pages of iriftrace use of three.js, as the global THREE.
export {
  BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, FrontSide, BackSide, GLSL3, Mesh,
  OrthographicCamera, Points, Scene, ShaderMaterial, Vector3, Vector4, WebGLRenderTarget,
  WebGLRenderer, LinearFilter, MOUSE, TOUCH,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { LineMaterial } from "three/addons/lines/LineMaterial.js";
export { LineSegments2 } from "three/addons/lines/LineSegments2.js";
export { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
