// The hands of an avatar of three.js (a GLTF scene, a SkinnedMesh with its bones): the profile on which the server solves
// contact, and the pose of the bones for each message. Needs nothing of three.js but the objects themselves.
import { FIRST_JOINTS, findHands, JOINTS, TIP_JOINTS } from "./bones.js";
import { JOINT_COUNT, REST_JOINTS, REST_RADII } from "./layout.js";
import { add, bestRotation, conjugate, dot, fromTo, multiply, norm, rotate, sub, times, unit } from "./quaternions.js";

const LEVEL = [0, 0, 0, 1];
const WRIST = 1;
const METACARPAL_BASE = 0.3; // where a metacarpal begins between wrist and knuckle, in rigs without such bones
const TIP_SHARE = 0.8; // the last bone of a finger relative to the one before, where nothing shows its end
const THUMB_BEHIND = 0.08;
const KNUCKLES_OFF_M = 0.05;
const RADIUS_SHARES = [0.5, 1.7];
const MEASURED = [0.3, 0.9]; // the part of a bone where its radius is measured; nearer to its joints, the skin bulges into the palm or ends
const PALMAR = 0.6; // cosine of the largest angle between the direction of the palm and that in which a radius is measured
const MODEL_PALM_M = 0.107;
const NEAR_M = 1e-3;

/** The hands of the rig below `root`, an object of three.js in its rest pose. */
export class AvatarHands {
  #hands = {};

  /**
   * `name` begins the profile's name in the server. `map` is a bone map of clients/README.md. `side` says which hand a
   * rig with WebXR's names is. Throws an Error that says why the server cannot solve on these hands.
   */
  constructor(root, { name = root.name || "avatar", map = {}, side = null } = {}) {
    root.updateWorldMatrix(true, true);
    const nodes = new Map();
    root.traverse((node) => {
      for (const known of [node.userData?.name, node.name]) if (known && !nodes.has(known)) nodes.set(known, node);
    });
    const found = findHands([...nodes.keys()], { map, side });
    if (Object.keys(found).length === 0) {
      throw new Error("the avatar has no hand whose bones are recognised; name them in a bone map");
    }
    for (const [each, bones] of Object.entries(found)) this.#hands[each] = new AvatarHand(each, bones, nodes, root);
    const content = Object.fromEntries(Object.entries(this.#hands).map(([each, hand]) => [each, hand.content()]));
    const plain = name.replace(/[^A-Za-z0-9]/g, "-").slice(0, 40);
    /** What ManipNetClient takes as `hand`: a hand profile as docs/any-hand.md describes it. */
    this.profile = { name: `${plain}-${digest(content)}`, ...content };
  }

  /** The sides of the hands that the avatar has. */
  get sides() {
    return Object.keys(this.#hands);
  }

  /**
   * Poses the finger bones as `hands` of the client say. With `wrists`, the hand bones also go to their wrists, and the
   * arms follow where the rig has them; otherwise the fingers follow the hands wherever the page has put them.
   */
  show(hands, { wrists = true } = {}) {
    for (const [side, hand] of Object.entries(this.#hands)) if (hands[side].present) hand.show(hands[side].joints, wrists);
  }
}

class AvatarHand {
  #side;
  #hand;
  #arm;
  #bones;
  #bind = [];
  #loose = []; // bones of rigs without a hierarchy, whose places are set too, as in WebXR's generic hand
  #toWrist; // from the frame of the wrist joint to the space of the hand bone
  #joints = Array(JOINT_COUNT).fill(null);
  #radii = Array(JOINT_COUNT).fill(null);

  constructor(side, { hand, fingers, metacarpals, tips }, nodes, root) {
    this.#side = side;
    this.#hand = nodes.get(hand);
    const [forearm, upper] = [this.#hand.parent, this.#hand.parent?.parent];
    this.#arm = [forearm, upper, upper?.parent].every((node) => node?.isBone) ? { upper, forearm } : null;
    this.#bones = fingers.map((bone) => (bone === null ? null : nodes.get(bone)));
    const origin = placeOf(this.#hand);
    const toHand = conjugate(worldRotation(this.#hand));
    const local = (point) => rotate(toHand, sub(point, origin));
    const positions = this.#bones.map((bone) => bone && local(placeOf(bone)));
    this.#toWrist = palmFrame(side, positions);
    const points = positions.map((point) => point && rotate(conjugate(this.#toWrist), point));
    const inWrist = (point) => rotate(conjugate(this.#toWrist), local(point));
    const skin = skinOf(root, this.#bones).map((own) => own.map(inWrist));
    for (let finger = 0; finger < 5; finger++) {
      const tip = tips[finger] === null ? this.#endOf(finger) : nodes.get(tips[finger]);
      this.#addFinger(finger, points, skin, tip && inWrist(placeOf(tip)), toHand);
    }
    this.#addPalm(metacarpals.map((bone) => bone && inWrist(placeOf(nodes.get(bone)))));
    const others = [...metacarpals.map((bone, k) => [bone, FIRST_JOINTS[k + 1] - 1]), ...tips.map((bone, k) => [bone, TIP_JOINTS[k]])];
    const all = [...fingers.map((bone, row) => [bone, JOINTS[row]]), ...others];
    for (const [name, joint] of all) {
      const node = name === null ? null : nodes.get(name);
      if (node === null || this.#joints[joint] === null || isBelow(node, this.#hand)) continue;
      const row = JOINTS.indexOf(joint);
      const rest = multiply(conjugate(this.#toWrist), multiply(toHand, worldRotation(node)));
      const bind = row >= 0 ? this.#bind[row] : multiply(conjugate(this.#joints[joint].slice(3)), rest);
      this.#loose.push({ node, joint, bind });
    }
  }

  content() {
    const tidy = (row) => row && row.map((x) => Math.round(1e7 * x) / 1e7);
    return { joints: this.#joints.map(tidy), radii: this.#radii };
  }

  show(joints, wrists) {
    const joint = (number) => Array.from(joints.subarray(7 * number + 3, 7 * number + 7));
    const wrist = joint(WRIST);
    const wanted = multiply(wrist, conjugate(this.#toWrist));
    if (wrists) this.#moveHand(Array.from(joints.subarray(7 * WRIST, 7 * WRIST + 3)), wanted);
    const turned = multiply(worldRotation(this.#hand), conjugate(wanted)); // the identity, if the hand is at its wrist
    const driven = new Map();
    for (let row = 0; row < this.#bones.length; row++) {
      const bone = this.#bones[row];
      if (bone === null) continue;
      const world = multiply(turned, multiply(joint(JOINTS[row]), this.#bind[row]));
      bone.quaternion.fromArray(multiply(conjugate(worldRotation(bone.parent, driven)), world)).normalize();
      driven.set(bone, world);
    }
    if (this.#loose.length > 0) this.#placeLoose(joints, turned);
  }

  #placeLoose(joints, turned) {
    this.#hand.updateWorldMatrix(true, false);
    const at = placeOf(this.#hand);
    const place = (number) => Array.from(joints.subarray(7 * number, 7 * number + 3));
    const wrist = place(WRIST);
    for (const { node, joint, bind } of this.#loose) {
      const rotation = Array.from(joints.subarray(7 * joint + 3, 7 * joint + 7));
      const world = multiply(turned, multiply(rotation, bind));
      node.parent.worldToLocal(node.position.fromArray(add(at, rotate(turned, sub(place(joint), wrist)))));
      node.quaternion.fromArray(multiply(conjugate(worldRotation(node.parent)), world)).normalize();
    }
  }

  #moveHand(place, rotation) {
    if (this.#arm) reach(this.#arm.upper, this.#arm.forearm, this.#hand, place);
    else {
      this.#hand.parent.updateWorldMatrix(true, false);
      this.#hand.parent.worldToLocal(this.#hand.position.fromArray(place));
    }
    this.#hand.quaternion.fromArray(multiply(conjugate(worldRotation(this.#hand.parent)), rotation)).normalize();
  }

  /** The bone at the end of a finger, as Mixamo's fourth ones. */
  #endOf(finger) {
    const last = this.#bones.slice(3 * finger, 3 * finger + 3).findLast((bone) => bone !== null);
    return last?.children.find((child) => !child.isMesh && norm(sub(placeOf(child), placeOf(last))) > NEAR_M) ?? null;
  }

  #addFinger(finger, points, skin, tip, toHand) {
    const rows = [0, 1, 2].map((part) => 3 * finger + part).filter((row) => points[row] !== null);
    if (rows.length === 0) return;
    const heads = rows.map((row) => points[row]);
    const model = this.#mirrored(REST_JOINTS[JOINTS[rows[0]]].slice(3));
    const ends = [...heads.slice(1), tip ?? endBySkin(heads, skin[rows.at(-1)], model)];
    const along = unit(sub(ends[0], heads[0]));
    const frame = boneFrame(along, model);
    let [at, bent, direction] = [heads[0], frame, along];
    rows.forEach((row, k) => {
      const joint = JOINTS[row];
      const guess = (REST_RADII[joint] * norm(points[6] ?? heads[k])) / MODEL_PALM_M;
      this.#joints[joint] = [...at, ...frame];
      bent = multiply(fromTo(direction, sub(ends[k], heads[k])), bent);
      direction = sub(ends[k], heads[k]);
      this.#radii[joint] = radiusOf(skin[row], heads[k], ends[k], rotate(bent, [0, -1, 0]), guess);
      const inWrist = multiply(conjugate(this.#toWrist), multiply(toHand, worldRotation(this.#bones[row])));
      this.#bind[row] = multiply(conjugate(frame), multiply(fromTo(sub(ends[k], heads[k]), along), inWrist));
      at = add(at, times(norm(sub(ends[k], heads[k])), along));
    });
    this.#joints[TIP_JOINTS[finger]] = [...at, ...frame];
    this.#radii[TIP_JOINTS[finger]] = this.#radii[JOINTS[rows.at(-1)]];
  }

  #addPalm(metacarpals) {
    this.#joints[WRIST] = [0, 0, 0, ...LEVEL];
    const knuckles = [];
    for (let finger = 1; finger < 5; finger++) {
      const first = FIRST_JOINTS[finger];
      const knuckle = [0, 1, 2].map((part) => this.#joints[first + part]).find((joint) => joint !== null)?.slice(0, 3);
      if (knuckle === undefined) continue;
      knuckles.push(knuckle);
      this.#joints[first - 1] = [...(metacarpals[finger - 1] ?? times(METACARPAL_BASE, knuckle)), ...LEVEL];
    }
    const mean = times(1 / knuckles.length, knuckles.reduce(add));
    const middle = this.#joints[FIRST_JOINTS[2]]?.slice(0, 3) ?? mean;
    this.#joints[0] = [...times(0.5 * (1 + METACARPAL_BASE), middle), ...LEVEL];
  }

  #mirrored([x, y, z, w]) {
    return this.#side === "left" ? [x, -y, -z, w] : [x, y, z, w];
  }
}

/** The rotation from the frame in which the knuckles lie as the model's do to that of `positions`, by side. */
function palmFrame(side, positions) {
  const right = (point) => (side === "left" ? [-point[0], point[1], point[2]] : point);
  const roots = [3, 6, 9, 12].filter((row) => positions[row] !== null);
  const ours = roots.map((row) => right(positions[row]));
  const theirs = roots.map((row) => REST_JOINTS[JOINTS[row]].slice(0, 3));
  const turn = bestRotation(ours, theirs);
  const turned = ours.map((point) => rotate(turn, point));
  const size = (points) => Math.sqrt(points.reduce((sum, point) => sum + dot(point, point), 0));
  const off = Math.max(...turned.map((point, k) => norm(sub(times(size(theirs) / size(ours), point), theirs[k]))));
  if (off > KNUCKLES_OFF_M) {
    throw new Error(`the knuckles of the ${side} hand do not lie side by side as on a hand; check the names of its bones`);
  }
  const thumb = [2, 1, 0].find((row) => positions[row] !== null);
  if (thumb !== undefined) {
    const last = rotate(turn, right(positions[thumb]));
    const middle = times(1 / turned.length, turned.reduce(add));
    if (last[0] > middle[0] || last[1] > middle[1] + THUMB_BEHIND * norm(middle)) {
      throw new Error(`the thumb of the ${side} hand lies on the wrong side: it is the other hand, or a mirrored one`);
    }
  }
  const [x, y, z, w] = conjugate(turn);
  return side === "left" ? [x, -y, -z, w] : [x, y, z, w];
}

/** The rotation of a joint whose bone points along: the model's, turned by as little as possible. */
function boneFrame(along, model) {
  return multiply(fromTo(rotate(model, [0, 0, -1]), along), model);
}

/** Where a finger ends, by its skin, or by the length of the bone before. */
function endBySkin(heads, skin, model) {
  const head = heads.at(-1);
  const before = heads.length > 1 ? sub(head, heads.at(-2)) : [0, 0, -0.03];
  const along = unit(before);
  if (skin.length <= 8) return add(head, times(TIP_SHARE, before));
  const beyond = skin.map((point) => sub(point, head));
  const away = beyond.map((point) => sub(point, times(dot(point, along), along)));
  const facing = facingPalm(away, rotate(boneFrame(along, model), [0, -1, 0]));
  const radius = median((facing.length ? facing : away).map(norm));
  const reach = Math.max(...beyond.map((point) => dot(point, along)));
  return add(head, times(Math.max(reach - radius, 0.3 * norm(before)), along));
}

/** The distance of the skin from a bone on the palmar side; null where there is little skin, or it is not a finger's. */
function radiusOf(skin, start, end, palmar, guess) {
  const along = unit(sub(end, start));
  const length = norm(sub(end, start));
  const own = skin.map((point) => sub(point, start));
  const isMeasured = (at) => at > MEASURED[0] * length && at < MEASURED[1] * length;
  const middle = own.filter((point) => isMeasured(dot(point, along)));
  const facing = facingPalm(middle.map((point) => sub(point, times(dot(point, along), along))), palmar);
  if (middle.length < 6 || facing.length === 0) return null;
  const radius = median(facing.map(norm));
  return radius > RADIUS_SHARES[0] * guess && radius < RADIUS_SHARES[1] * guess ? radius : null;
}

/** Those of the vectors from a bone to its skin that point to the palm. */
function facingPalm(away, palmar) {
  return away.filter((vector) => dot(vector, palmar) > PALMAR * norm(vector));
}

function median(values) {
  const sorted = values.sort((a, b) => a - b);
  const half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : 0.5 * (sorted[half - 1] + sorted[half]);
}

/** For each bone, the points in the world of the skin that it moves most, at rest. */
function skinOf(root, bones) {
  const rows = new Map(bones.map((bone, row) => [bone, row]));
  const points = bones.map(() => []);
  root.traverse((mesh) => {
    if (!mesh.isSkinnedMesh) return;
    const { position, skinIndex, skinWeight } = mesh.geometry.attributes;
    const { skeleton, bindMatrix } = mesh;
    for (let k = 0; k < position.count; k++) {
      let best = 0;
      for (let i = 1; i < 4; i++) if (skinWeight.getComponent(k, i) > skinWeight.getComponent(k, best)) best = i;
      const number = skinIndex.getComponent(k, best);
      const row = rows.get(skeleton.bones[number]);
      if (row === undefined) continue;
      const bound = transform(bindMatrix.elements, [position.getX(k), position.getY(k), position.getZ(k)]);
      const inBone = transform(skeleton.boneInverses[number].elements, bound);
      points[row].push(transform(skeleton.bones[number].matrixWorld.elements, inBone));
    }
  });
  return points;
}

/** A point, transformed by the elements of a three.js matrix, which go down its columns. */
function transform(e, [x, y, z]) {
  return [0, 1, 2].map((i) => e[i] * x + e[4 + i] * y + e[8 + i] * z + e[12 + i]);
}

function isBelow(node, above) {
  for (let each = node; each; each = each.parent) if (each === above) return true;
  return false;
}

function placeOf(node) {
  return Array.from(node.matrixWorld.elements.slice(12, 15));
}

/** The rotation of a node in the world, from the rotations of the nodes above it, or from a map of those known. */
function worldRotation(node, known = new Map()) {
  let rotation = LEVEL;
  for (let each = node; each; each = each.parent) {
    if (known.has(each)) return multiply(known.get(each), rotation);
    rotation = multiply(each.quaternion.toArray(), rotation);
  }
  return rotation;
}

/** Turns an arm so that the hand is at `place`, with the elbow bent about its present direction. */
function reach(upper, forearm, hand, place) {
  upper.updateWorldMatrix(true, true);
  const [shoulder, elbow, wrist] = [upper, forearm, hand].map(placeOf);
  const [a, b] = [norm(sub(elbow, shoulder)), norm(sub(wrist, elbow))];
  const c = Math.min(Math.max(norm(sub(place, shoulder)), Math.abs(a - b) + 1e-4), a + b - 1e-4);
  const to = unit(sub(place, shoulder));
  const bent = sub(elbow, shoulder);
  let pole = sub(bent, times(dot(bent, to), to));
  if (norm(pole) < 1e-3) pole = sub([0, -1, 0], times(-to[1], to)); // a straight arm bends downwards
  const along = (a * a + c * c - b * b) / (2 * c);
  const aside = Math.sqrt(Math.max(a * a - along * along, 0));
  const wanted = add(shoulder, add(times(along, to), times(aside, unit(pole))));
  turn(upper, fromTo(sub(elbow, shoulder), sub(wanted, shoulder)));
  upper.updateWorldMatrix(false, true);
  const [from, now] = [forearm, hand].map(placeOf);
  turn(forearm, fromTo(sub(now, from), sub(add(shoulder, times(c, to)), from)));
}

/** Turns a node by a rotation in the world. */
function turn(node, rotation) {
  const world = multiply(rotation, worldRotation(node));
  node.quaternion.fromArray(multiply(conjugate(worldRotation(node.parent)), world)).normalize();
}

/** Eight characters that depend on where the joints of a profile are. */
function digest(content) {
  const places = Object.entries(content).map(([side, { joints }]) => [side, joints.map((row) => row?.slice(0, 3).map((x) => x.toFixed(4)))]);
  let hash = 2166136261; // FNV-1a
  for (const letter of JSON.stringify(places)) hash = Math.imul(hash ^ letter.codePointAt(0), 16777619);
  return (hash >>> 0).toString(16).padStart(8, "0");
}
