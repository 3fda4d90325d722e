// Loads avatars with three.js for the tests: `profile FILE OPTIONS` prints the profile of a GLB file, `path FILE` where it is,
// and `tips FILE OPTIONS ADDRESS TIPS` shows live hands on it and prints how far each fingertip was from where the message says, in metres.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [client, modules, verb, file, options, address, tipNames] = process.argv.slice(2);
const three = `${modules}/three`;
const load = (path) => import(pathToFileURL(path).href);
globalThis.self = globalThis; // three.js looks there for what browsers have
globalThis.ProgressEvent ??= class {};
const THREE = await load(`${three}/build/three.module.js`);
const { GLTFLoader } = await load(`${three}/examples/jsm/loaders/GLTFLoader.js`);
const { AvatarHands, ManipNetClient } = await load(`${client}/manipnet.js`);

const bytes = readFileSync(file);
const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), "");
const avatar = new AvatarHands(gltf.scene, JSON.parse(options));
if (verb === "path") console.log(JSON.stringify({ path: file }));
else if (verb === "profile") console.log(JSON.stringify(avatar.profile));
else {
  const { WebSocket } = await load(`${modules}/ws/wrapper.mjs`);
  const socket = new ManipNetClient(address, { hand: avatar.profile, delayS: 0.05, WebSocket });
  const tips = JSON.parse(tipNames);
  const far = [];
  const timer = setInterval(() => {
    const { problem, received } = socket.stats();
    if (problem) finish({ problem });
    if (received < 60 || !socket.sample()) return;
    avatar.show(socket.hands);
    gltf.scene.updateMatrixWorld(true);
    let worst = 0;
    for (const [name, side, joint] of tips) {
      const there = new THREE.Vector3().fromArray(socket.hands[side].joints, 7 * joint);
      worst = Math.max(worst, gltf.scene.getObjectByName(name).getWorldPosition(new THREE.Vector3()).distanceTo(there));
    }
    far.push(worst);
    if (far.length === 60) finish({ far });
  }, 16);
  const finish = (result) => {
    clearInterval(timer);
    socket.close();
    console.log(JSON.stringify(result));
    process.exit(0);
  };
}
