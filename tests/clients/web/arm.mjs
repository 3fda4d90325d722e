// Poses a right arm of three.js bones by messages made here: `arm.mjs CLIENT MODULES` prints, for each, how far the farthest
// fingertip and the hand are from where the message says, and the lengths of both bones of the arm, in metres.
import { pathToFileURL } from "node:url";

const [client, modules] = process.argv.slice(2);
const load = (path) => import(pathToFileURL(path).href);
const THREE = await load(`${modules}/three/build/three.module.js`);
const { AvatarHands, HandsFrame } = await load(`${client}/manipnet.js`);
const { REST_JOINTS } = await load(`${client}/layout.js`);
const WORDS = ["Thumb", "Index", "Middle", "Ring", "Pinky"];
const FIRST = [2, 7, 12, 17, 22];
const WRIST = new THREE.Vector3(-0.4, 1.4, 0.2);
const root = new THREE.Group();
root.position.set(0.3, 0, 0.2);
root.rotation.y = 0.7;
root.updateMatrixWorld(true);

function bone(name, parent, place) {
  const made = new THREE.Bone();
  made.name = name;
  parent.add(made);
  made.position.copy(parent.worldToLocal(place.clone()));
  made.updateMatrixWorld(true);
  return made;
}

const chest = bone("Chest", root, new THREE.Vector3(0.3, 1.3, 0.2));
const upper = bone("RightArm", chest, new THREE.Vector3(0.1, 1.4, 0.2));
const forearm = bone("RightForeArm", upper, new THREE.Vector3(-0.15, 1.38, 0.18));
const hand = bone("RightHand", forearm, WRIST);
const turn = new THREE.Quaternion(0.1, 0.5, -0.3, 0.8).normalize();
WORDS.forEach((word, finger) => {
  let parent = hand;
  for (let k = 0; k < 4; k++) {
    const place = new THREE.Vector3(...REST_JOINTS[FIRST[finger] + k]).multiplyScalar(0.9).applyQuaternion(turn).add(WRIST);
    parent = bone(`RightHand${word}${k + 1}`, parent, place);
  }
});

const avatar = new AvatarHands(root);
const frame = new HandsFrame();
frame.right.present = true;
const at = (node) => node.getWorldPosition(new THREE.Vector3());
const there = (joint) => new THREE.Vector3().fromArray(frame.right.joints, 7 * joint);
const out = [];
for (const place of [[-0.2, 1.2, 0.5], [0.2, 1.1, 0.4], [-0.3, 1.6, 0.1]]) {
  const turned = new THREE.Quaternion(place[0], 1, place[2], 0.4).normalize();
  avatar.profile.right.joints.forEach((row, joint) => {
    const point = new THREE.Vector3(...row).applyQuaternion(turned).add(new THREE.Vector3(...place));
    const rotation = turned.clone().multiply(new THREE.Quaternion(...row.slice(3)));
    frame.right.joints.set([...point.toArray(), ...rotation.toArray()], 7 * joint);
  });
  avatar.show(frame);
  root.updateMatrixWorld(true);
  const tips = WORDS.map((word, k) => at(root.getObjectByName(`RightHand${word}4`)).distanceTo(there(FIRST[k] + 3)));
  const arm = [at(upper).distanceTo(at(forearm)), at(forearm).distanceTo(at(hand))];
  out.push({ tip: Math.max(...tips), hand: at(hand).distanceTo(there(1)), arm });
}
console.log(JSON.stringify(out));
