// Loads avatars with three.js for the tests: `profile FILE OPTIONS` prints the profile of a GLB file, `path FILE` where it is,
// and `tips FILE OPTIONS ADDRESS TIPS` shows live hands on it and prints how far the fingertips were from where they belong, in
// metres: `arrived` from the positions of messages as they arrive, and `shown` from where bones of constant lengths reach with the
// rotations of the messages that the client shows, which are means of several.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [client, modules, verb, file, options, address, tipNames] = process.argv.slice(2);
const three = `${modules}/three`;
const load = (path) => import(pathToFileURL(path).href);
globalThis.self = globalThis; // three.js looks there for what browsers have
globalThis.ProgressEvent ??= class {};
const THREE = await load(`${three}/build/three.module.js`);
const { GLTFLoader } = await load(`${three}/examples/jsm/loaders/GLTFLoader.js`);
const { AvatarHands, decode, HandsFrame, ManipNetClient } = await load(`${client}/manipnet.js`);

const bytes = readFileSync(file);
const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), "");
const avatar = new AvatarHands(gltf.scene, JSON.parse(options));
if (verb === "path") console.log(JSON.stringify({ path: file }));
else if (verb === "profile") console.log(JSON.stringify(avatar.profile));
else {
  const { WebSocket } = await load(`${modules}/ws/wrapper.mjs`);
  const tips = JSON.parse(tipNames);
  const socket = new ManipNetClient(address, { hand: avatar.profile, delayS: 0.05, WebSocket });
  const [arrived, shown] = [[], []];
  const vector = (array, at) => new THREE.Vector3().fromArray(array, at);
  const rotation = (array, joint) => new THREE.Quaternion().fromArray(array, 7 * joint + 3);

  /** The largest distance of a fingertip of the rig from the place that `place(side, joint)` returns. */
  const worst = (hands, place) => {
    avatar.show(hands);
    gltf.scene.updateMatrixWorld(true);
    const there = (name) => gltf.scene.getObjectByName(name).getWorldPosition(new THREE.Vector3());
    return Math.max(...tips.map(([name, side, joint]) => there(name).distanceTo(place(side, joint))));
  };
  const chained = (hands) => (side, tip) => {
    const { joints } = hands[side];
    const rest = avatar.profile[side].joints.map((row) => vector(row, 0));
    const at = rest[tip - 3].clone().applyQuaternion(rotation(joints, 1)).add(vector(joints, 7));
    for (let joint = tip - 3; joint < tip; joint++) {
      const link = new THREE.Vector3(0, 0, -rest[joint].distanceTo(rest[joint + 1]));
      at.add(link.applyQuaternion(rotation(joints, joint)));
    }
    return at;
  };

  const frame = new HandsFrame();
  const raw = new WebSocket(`${address}/hand/${avatar.profile.name}`);
  raw.binaryType = "arraybuffer";
  raw.onmessage = ({ data }) => {
    if (typeof data === "string" || socket.stats().received < 60) return;
    decode(data, frame);
    arrived.push(worst(frame, (side, joint) => vector(frame[side].joints, 7 * joint)));
  };
  const timer = setInterval(() => {
    const { problem, received } = socket.stats();
    if (problem) finish({ problem });
    if (received < 60 || !socket.sample()) return;
    shown.push(worst(socket.hands, chained(socket.hands)));
    if (shown.length >= 60 && arrived.length >= 60) finish({ arrived, shown });
  }, 16);
  const finish = (result) => {
    clearInterval(timer);
    raw.close();
    socket.close();
    console.log(JSON.stringify(result));
    process.exit(0);
  };
}
