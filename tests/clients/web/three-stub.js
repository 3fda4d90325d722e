// The parts of three.js that the example page uses, without drawing; with it the page runs without a network.
const NUMBERS = [Symbol.toPrimitive, "length"]; // the methods that return numbers

class Anything {
  constructor() {
    return new Proxy(function () {}, {
      get: (target, key) => (NUMBERS.includes(key) ? () => 0 : (target[key] ??= new Anything())),
      set: (target, key, value) => ((target[key] = value), true),
      apply: () => new Anything(),
    });
  }
}

export const [Scene, HemisphereLight, GridHelper, PerspectiveCamera, MeshStandardMaterial, InstancedMesh] = Array(6).fill(Anything);
export const [SphereGeometry, BufferGeometry, BufferAttribute, LineSegments, LineBasicMaterial] = Array(5).fill(Anything);
export const [Group, Matrix4, AxesHelper, Vector3, OrbitControls] = Array(5).fill(Anything);

export const [CylinderGeometry, Quaternion, Box3, OBJLoader, GLTFLoader] = Array(5).fill(Anything);
export const VRButton = { createButton: () => document.createElement("button") };

export class WebGLRenderer {
  domElement = document.createElement("canvas");
  frames = 0;
  xr = {};
  setPixelRatio() {}
  setSize() {}
  setClearColor() {}
  setAnimationLoop(draw) {
    requestAnimationFrame(() => this.setAnimationLoop(draw));
    draw();
  }
  render() {
    document.body.dataset.frames = ++this.frames;
  }
}
