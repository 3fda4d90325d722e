// Shows both hands as skin over their WebXR joints, and the tracked bodies. The stream has the axes of three.js:
// right-handed, Y up, metres. `?server=ws://HOST:PORT` names another server, `#token=…` its token (which, after #, is not
// sent to the server of the page), and `?mesh=BODY=FILE.obj` the mesh of a body, in metres, once for each body. An avatar
// that is dropped on the page as a GLB or VRM file, or named by `?avatar=FILE` (and `&side=left` for a hand with WebXR's
// names), is shown with the hands that the server solves on it. Headsets get a button to enter VR.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { VRButton } from "three/addons/webxr/VRButton.js";
import { AvatarHands, JOINT_NAMES, JOINT_PARENTS, ManipNetClient } from "./manipnet.js";

const SIDES = { left: 0x6fb1ff, right: 0xffa46f };
const parameters = new URLSearchParams(location.search);
const server = parameters.get("server") ?? "ws://127.0.0.1:8081";
const token = new URLSearchParams(location.hash.slice(1)).get("token");
let client = new ManipNetClient(server, { token });
let avatar = null;
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
const VIEW_FROM = new THREE.Vector3(-0.16, 0.48, 0.86); // the direction from the hands to the camera
const MARGIN_M = 0.05; // of skin about the joints
const CATCH_UP = 0.05; // the share of its way that the camera goes in one frame, so that it follows without shaking
const box = new THREE.Box3();
let [hasLooked, visitorLooks, distance] = [false, false, 0];
controls.addEventListener("start", () => (visitorLooks = true));
let problem = "";

/** A ball at each joint and a limb along each bone; the palm is a limb to each knuckle. */
function makeHand(color) {
  const material = new THREE.MeshStandardMaterial({ color, roughness: 0.6 });
  const joints = new THREE.InstancedMesh(new THREE.SphereGeometry(1, 16, 12), material, JOINT_PARENTS.length);
  const limbs = new THREE.InstancedMesh(new THREE.CylinderGeometry(1, 1, 1, 12), material, JOINT_PARENTS.length);
  joints.frustumCulled = limbs.frustumCulled = false;
  const group = new THREE.Group();
  group.add(joints, limbs);
  scene.add(group);
  return { group, joints, limbs };
}

const matrix = new THREE.Matrix4();
const [start, end, middle, size] = [0, 1, 2, 3].map(() => new THREE.Vector3());
const up = new THREE.Vector3(0, 1, 0);
const turn = new THREE.Quaternion();

/** Radii in metres: tips are thinner than knuckles, and the wrist is thickest. */
function radius(joint) {
  if (joint < 2) return 0.016;
  return JOINT_NAMES[joint].endsWith("tip") ? 0.006 : JOINT_NAMES[joint].includes("metacarpal") ? 0.011 : 0.0085;
}

function showHand({ group, joints, limbs }, hand, weight) {
  group.visible = hand.present && weight > 0;
  if (!group.visible) return;
  for (let i = 0; i < JOINT_PARENTS.length; i++) {
    const r = radius(i) * hand.scale;
    end.fromArray(hand.joints, 7 * i);
    start.fromArray(hand.joints, 7 * Math.max(JOINT_PARENTS[i], 1));
    joints.setMatrixAt(i, matrix.compose(end, turn.identity(), size.setScalar(r)));
    middle.addVectors(start, end).multiplyScalar(0.5);
    const length = start.distanceTo(end);
    turn.setFromUnitVectors(up, end.sub(start).normalize());
    limbs.setMatrixAt(i, matrix.compose(middle, turn, size.set(r, length, r)));
  }
  joints.instanceMatrix.needsUpdate = limbs.instanceMatrix.needsUpdate = true;
}

function showBody(body) {
  if (!bodies.has(body.name)) {
    bodies.set(body.name, makeBody(body.name));
    scene.add(bodies.get(body.name));
  }
  const shown = bodies.get(body.name);
  shown.visible = body.tracked;
  shown.position.fromArray(body.pose);
  shown.quaternion.fromArray(body.pose, 3);
}

/** Axes, and the mesh that the page's address names for the body. */
function makeBody(name) {
  const group = new THREE.Group();
  group.add(new THREE.AxesHelper(0.06));
  const file = parameters.getAll("mesh").find((each) => each.startsWith(`${name}=`));
  if (file !== undefined) {
    const material = new THREE.MeshStandardMaterial({ color: 0xb8c0cc, roughness: 0.8 });
    new OBJLoader().load(
      file.slice(name.length + 1),
      (mesh) => {
        mesh.traverse((part) => (part.material = material));
        group.add(mesh);
      },
      undefined,
      (error) => (problem = `the mesh of ${name} cannot be loaded: ${error.message ?? error}`),
    );
  }
  return group;
}

/** Keeps all hands in view, wherever they are, until the visitor moves the camera. */
function followHands({ left, right }) {
  const present = [left, right].filter((hand) => hand.present);
  if (visitorLooks || renderer.xr.isPresenting || present.length === 0) return;
  box.makeEmpty();
  for (const hand of present) {
    for (let i = 0; i < JOINT_PARENTS.length; i++) box.expandByPoint(end.fromArray(hand.joints, 7 * i));
  }
  box.getCenter(middle);
  const half = Math.min(1, camera.aspect) * Math.tan((camera.fov * Math.PI) / 360);
  const wanted = (1.2 * (0.5 * box.getSize(size).length() + MARGIN_M)) / half;
  const share = hasLooked ? CATCH_UP : 1;
  distance += share * (wanted - distance);
  controls.target.lerp(middle, share);
  camera.position.copy(controls.target).addScaledVector(VIEW_FROM, distance);
  hasLooked = true;
}

/** Shows the avatar of a GLB or VRM file, and lets the server solve on its hands. */
async function showAvatar(url, name) {
  try {
    const { scene: root } = await new GLTFLoader().loadAsync(url);
    const rig = new AvatarHands(root, { name, side: parameters.get("side") });
    if (avatar !== null) scene.remove(avatar.root);
    avatar = { rig, root, sides: rig.sides };
    root.traverse((part) => (part.frustumCulled = false)); // a skin's bounds are those of its rest pose
    scene.add(root);
    client.close();
    client = globalThis.client = new ManipNetClient(server, { token, hand: rig.profile });
    problem = "";
  } catch (error) {
    problem = `${name} cannot be shown: ${error.message ?? error}`;
  }
}

function dropped(event) {
  event.preventDefault();
  const file = event.dataTransfer.files[0];
  if (file === undefined) return;
  const url = URL.createObjectURL(file);
  showAvatar(url, file.name.replace(/\.[^.]*$/, "")).finally(() => URL.revokeObjectURL(url));
}

function describe() {
  const s = client.stats();
  const nothing = s.problem || problem || "Nothing has arrived. Is manipnet-serve running?";
  if (s.received === 0) return `${server}: ${s.state}\n${nothing}`;
  const sides = Object.keys(SIDES).filter((side) => client.hands[side].present);
  const states = sides.map((side) => {
    const { state, object } = client.hands[side];
    return `${side}: ${state}${object ? `, ${object}` : ""}`;
  });
  const age = `age ${(1000 * s.ageS).toFixed(0)} ms`;
  return [`${s.state} · ${s.rateHz.toFixed(1)} Hz · ${age} · ${s.lost} lost`, ...states, s.problem, problem].join("\n");
}

/** Shows the button to enter VR, unless there is no headset. */
function offerVR(isSupported) {
  if (!isSupported) return;
  renderer.xr.enabled = true;
  document.body.append(VRButton.createButton(renderer));
}

function resize() {
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
}

function draw() {
  if (client.sample()) {
    const balls = (side) => (avatar?.sides.includes(side) ? 0 : client.weight);
    for (const side of Object.keys(SIDES)) showHand(hands[side], client.hands[side], balls(side));
    if (avatar !== null && client.weight > 0) avatar.rig.show(client.hands);
    for (let i = 0; i < client.hands.bodyCount; i++) showBody(client.hands.bodies[i]);
    followHands(client.hands);
  }
  controls.update();
  renderer.render(scene, camera);
}

globalThis.client = client; // for the console
addEventListener("resize", resize);
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", dropped);
if (parameters.has("avatar")) showAvatar(parameters.get("avatar"), "avatar");
navigator.xr?.isSessionSupported("immersive-vr").then(offerVR, () => offerVR(false)); // a page may be forbidden to ask
setInterval(() => (status.textContent = describe()), 250);
resize();
renderer.setAnimationLoop(draw); // at the rate of the headset, in VR
