// One message, in memory that is reused. Axes are right-handed with Y up; metres, radians, quaternions xyzw.
import * as L from "./layout.js";

export const SIDES = ["left", "right"];
const utf8 = new TextDecoder("utf-8", { fatal: true });

export class HandFrame {
  present = false;
  state = "live";
  /** The name of the body near the hand, or null. */
  object = null;
  scale = 1;
  angles = new Float32Array(L.ANGLE_COUNT);
  /** 17 quaternions relative to the parent bone. */
  rotations = new Float32Array(4 * L.BONE_COUNT);
  /** Position and quaternion in the world. */
  wrist = new Float32Array(7);
  /** Position and quaternion in the world of each of 26 joints, in the order of JOINT_NAMES. */
  joints = new Float32Array(7 * L.JOINT_COUNT);

  copyFrom(other) {
    this.present = other.present;
    this.state = other.state;
    this.object = other.object;
    this.scale = other.scale;
    this.angles.set(other.angles);
    this.rotations.set(other.rotations);
    this.wrist.set(other.wrist);
    this.joints.set(other.joints);
  }
}

export class BodyFrame {
  name = "";
  tracked = false;
  pose = new Float32Array(7);

  copyFrom(other) {
    this.name = other.name;
    this.tracked = other.tracked;
    this.pose.set(other.pose);
  }
}

export class HandsFrame {
  session = "";
  actor = "";
  seq = 0;
  tCapture = 0;
  tPublish = 0;
  lookAhead = 0;
  /** The times buffer, sense, infer, ik and total. */
  latencyMs = new Float32Array(5);
  left = new HandFrame();
  right = new HandFrame();
  bodyCount = 0;
  /** Only the first bodyCount bodies are valid. */
  bodies = [];

  setBodyCount(count) {
    while (this.bodies.length < count) this.bodies.push(new BodyFrame());
    this.bodyCount = count;
  }

  copyFrom(other) {
    this.session = other.session;
    this.actor = other.actor;
    this.seq = other.seq;
    this.tCapture = other.tCapture;
    this.tPublish = other.tPublish;
    this.lookAhead = other.lookAhead;
    this.latencyMs.set(other.latencyMs);
    this.left.copyFrom(other.left);
    this.right.copyFrom(other.right);
    this.setBodyCount(other.bodyCount);
    for (let i = 0; i < this.bodyCount; i++) this.bodies[i].copyFrom(other.bodies[i]);
  }
}

/** Decodes the payload of `pose/bin` (an ArrayBuffer) into `frame`; throws an Error that says what is wrong. */
export function decode(buffer, frame) {
  if (buffer.byteLength < L.HEADER_BYTES) throw new Error("the message is not pose/bin; it is shorter than a header");
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== L.MAGIC) throw new Error("the message is not pose/bin; it must begin with MNPL");
  const version = view.getUint16(L.HEADER_VERSION, true);
  if (version !== L.VERSION) {
    throw new Error(`the message has version ${version}; this client understands version ${L.VERSION}`);
  }
  const headerSize = view.getUint16(L.HEADER_HEADER_SIZE, true);
  const handSize = view.getUint16(L.HEADER_HAND_SIZE, true);
  const bodySize = view.getUint16(L.HEADER_BODY_SIZE, true);
  const hands = view.getUint16(L.HEADER_HAND_COUNT, true);
  const bodies = view.getUint16(L.HEADER_BODY_COUNT, true);
  if (headerSize < L.HEADER_BYTES || handSize < L.HAND_BYTES || bodySize < L.BODY_BYTES) {
    throw new Error("a record is shorter than its fields");
  }
  if (hands > 2 || bodies > L.MAX_BODIES) {
    throw new Error(`the message has ${hands} hands and ${bodies} bodies; at most 2 and ${L.MAX_BODIES} are allowed`);
  }
  const total = headerSize + hands * handSize + bodies * bodySize;
  if (buffer.byteLength !== total || view.getUint32(L.HEADER_TOTAL_SIZE, true) !== total) {
    throw new Error(`the message has ${buffer.byteLength} bytes, but its header says ${total}`);
  }
  readHeader(view, frame);
  for (let i = 0; i < hands; i++) readHand(view, headerSize + i * handSize, frame);
  frame.setBodyCount(bodies);
  const first = headerSize + hands * handSize;
  for (let i = 0; i < bodies; i++) readBody(view, first + i * bodySize, frame.bodies[i]);
}

function readHeader(view, frame) {
  frame.session = readName(view, L.HEADER_SESSION, frame.session);
  frame.actor = readName(view, L.HEADER_ACTOR, frame.actor);
  frame.seq = view.getUint32(L.HEADER_SEQ, true) + 2 ** 32 * view.getUint32(L.HEADER_SEQ + 4, true);
  frame.tCapture = finite(view.getFloat64(L.HEADER_T_CAPTURE, true));
  frame.tPublish = finite(view.getFloat64(L.HEADER_T_PUBLISH, true));
  frame.lookAhead = finite(view.getFloat64(L.HEADER_LOOK_AHEAD, true));
  readFloats(view, L.HEADER_LATENCY_MS, frame.latencyMs);
  frame.left.present = frame.right.present = false;
}

function readHand(view, at, frame) {
  const side = view.getUint8(at + L.HAND_SIDE);
  const state = view.getUint8(at + L.HAND_STATE);
  if (side > 1) throw new Error(`the side is ${side}; allowed are 0 (left) and 1 (right)`);
  if (state >= L.STATES.length) throw new Error(`the state is ${state}; allowed are 0 to 2 (${L.STATES.join(", ")})`);
  const hand = frame[SIDES[side]];
  if (hand.present) throw new Error(`the ${SIDES[side]} hand occurs twice; it may occur once`);
  const name = readName(view, at + L.HAND_OBJECT, hand.object ?? "");
  hand.present = true;
  hand.state = L.STATES[state];
  hand.object = view.getUint8(at + L.HAND_HAS_OBJECT) ? name : null;
  hand.scale = finite(view.getFloat32(at + L.HAND_SCALE, true));
  readFloats(view, at + L.HAND_ANGLES, hand.angles);
  readFloats(view, at + L.HAND_ROTATIONS, hand.rotations);
  readFloats(view, at + L.HAND_WRIST, hand.wrist);
  readFloats(view, at + L.HAND_JOINTS, hand.joints);
}

function readBody(view, at, body) {
  body.tracked = view.getUint8(at + L.BODY_TRACKED) !== 0;
  body.name = readName(view, at + L.BODY_NAME, body.name);
  readFloats(view, at + L.BODY_POSE, body.pose);
}

function readFloats(view, at, into) {
  for (let i = 0; i < into.length; i++) into[i] = finite(view.getFloat32(at + 4 * i, true));
}

function finite(value) {
  if (!Number.isFinite(value)) throw new Error("the message has a number that is not finite");
  return value;
}

function readName(view, at, known) {
  const length = view.getUint8(at);
  if (length > L.NAME_BYTES) throw new Error(`a name has ${length} bytes; at most ${L.NAME_BYTES} are allowed`);
  if (length === known.length && isSame(view, at + 1, known)) return known;
  try {
    return utf8.decode(new Uint8Array(view.buffer, view.byteOffset + at + 1, length));
  } catch {
    throw new Error("a name is not UTF-8");
  }
}

/** Whether the name is unchanged and ASCII, as most are; then no new string is needed. */
function isSame(view, at, known) {
  for (let i = 0; i < known.length; i++) {
    const byte = view.getUint8(at + i);
    if (byte !== known.charCodeAt(i) || byte > 127) return false;
  }
  return true;
}
