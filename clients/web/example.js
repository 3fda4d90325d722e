// Shows both hands as spheres at their WebXR joints with lines along the bones, and the tracked bodies. The stream has
// the axes of three.js: right-handed, Y up, metres. `?server=ws://HOST:PORT` names another server.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { JOINT_PARENTS, ManipNetClient } from "./manipnet.js";

const SIDES = { left: 0x6fb1ff, right: 0xffa46f };
const server = new URLSearchParams(location.search).get("server") ?? "ws://127.0.0.1:8081";
const client = new ManipNetClient(server);
const status = document.getElementById("status");

const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.setPixelRatio(devicePixelRatio);
renderer.setClearColor(0x16181d);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.add(new THREE.HemisphereLight(0xffffff, 0x30343c, 3), new THREE.GridHelper(2, 20, 0x3a3f4a, 0x262a33));
const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 20);
camera.position.set(0, 1.5, 1.2);
const controls = new OrbitControls(camera, renderer.domElement);
controls.target.set(0, 1, 0);

const hands = Object.fromEntries(Object.entries(SIDES).map(([side, color]) => [side, makeHand(color)]));
const bodies = new Map();
let hasLooked = false;

function makeHand(color) {
  const material = new THREE.MeshStandardMaterial({ color, roughness: 0.6 });
  const joints = new THREE.InstancedMesh(new THREE.SphereGeometry(0.007, 16, 12), material, JOINT_PARENTS.length);
  const lines = new THREE.BufferGeometry();
  lines.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6 * JOINT_PARENTS.length), 3));
  const bones = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color }));
  joints.frustumCulled = bones.frustumCulled = false;
  const group = new THREE.Group();
  group.add(joints, bones);
  scene.add(group);
  return { group, joints, bones };
}

const matrix = new THREE.Matrix4();

function showHand({ group, joints, bones }, hand, weight) {
  group.visible = hand.present && weight > 0;
  if (!group.visible) return;
  const ends = bones.geometry.attributes.position;
  for (let i = 0; i < JOINT_PARENTS.length; i++) {
    const [x, y, z] = hand.joints.subarray(7 * i, 7 * i + 3);
    joints.setMatrixAt(i, matrix.makeTranslation(x, y, z));
    const from = 7 * Math.max(JOINT_PARENTS[i], 1);
    ends.setXYZ(2 * i, hand.joints[from], hand.joints[from + 1], hand.joints[from + 2]);
    ends.setXYZ(2 * i + 1, x, y, z);
  }
  joints.instanceMatrix.needsUpdate = ends.needsUpdate = true;
}

function showBody(body) {
  if (!bodies.has(body.name)) {
    bodies.set(body.name, new THREE.AxesHelper(0.06));
    scene.add(bodies.get(body.name));
  }
  const axes = bodies.get(body.name);
  axes.visible = body.tracked;
  axes.position.fromArray(body.pose);
  axes.quaternion.fromArray(body.pose, 3);
}

/** Points the camera at the hands once, because the origin may be far from them. */
function lookAtHands({ left, right }) {
  const hand = left.present ? left : right;
  if (hasLooked || !hand.present) return;
  hasLooked = true;
  controls.target.fromArray(hand.wrist);
  camera.position.copy(controls.target).add(new THREE.Vector3(-0.1, 0.3, 0.55));
}

function describe() {
  const s = client.stats();
  if (s.received === 0) return `${server}: ${s.state}\nNothing has arrived. Is manipnet-serve running?`;
  const sides = Object.keys(SIDES).filter((side) => client.hands[side].present);
  const states = sides.map((side) => {
    const { state, object } = client.hands[side];
    return `${side}: ${state}${object ? `, ${object}` : ""}`;
  });
  const age = `age ${(1000 * s.ageS).toFixed(0)} ms`;
  return [`${s.state} · ${s.rateHz.toFixed(1)} Hz · ${age} · ${s.lost} lost`, ...states].join("\n");
}

function resize() {
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
}

function draw() {
  requestAnimationFrame(draw);
  if (client.sample()) {
    for (const side of Object.keys(SIDES)) showHand(hands[side], client.hands[side], client.weight);
    for (let i = 0; i < client.hands.bodyCount; i++) showBody(client.hands.bodies[i]);
    lookAtHands(client.hands);
  }
  controls.update();
  renderer.render(scene, camera);
}

addEventListener("resize", resize);
setInterval(() => (status.textContent = describe()), 250);
resize();
draw();
