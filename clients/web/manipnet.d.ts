// Types of the client; `Float32Array`s have the layouts that README.md describes.
export type Side = "left" | "right";
export type HandState = "live" | "hold" | "rest";

export class HandFrame {
  present: boolean;
  state: HandState;
  /** The name of the body near the hand, or null. */
  object: string | null;
  scale: number;
  /** 20 joint angles in radians, in the order of ANGLE_NAMES. */
  angles: Float32Array;
  /** 17 quaternions x y z w relative to the parent bone, in the order of BONE_NAMES. */
  rotations: Float32Array;
  /** Position and quaternion in the world. */
  wrist: Float32Array;
  /** Position and quaternion in the world of each of 26 joints, in the order of JOINT_NAMES. */
  joints: Float32Array;
  copyFrom(other: HandFrame): void;
}

export class BodyFrame {
  name: string;
  tracked: boolean;
  /** Position and quaternion in the world. */
  pose: Float32Array;
  copyFrom(other: BodyFrame): void;
}

export class HandsFrame {
  session: string;
  actor: string;
  seq: number;
  tCapture: number;
  tPublish: number;
  lookAhead: number;
  latencyMs: Float32Array;
  left: HandFrame;
  right: HandFrame;
  bodyCount: number;
  /** Only the first bodyCount bodies are valid. */
  bodies: BodyFrame[];
  setBodyCount(count: number): void;
  copyFrom(other: HandsFrame): void;
}

/** Decodes the payload of `pose/bin` into `frame`; throws an Error that says what is wrong. */
export function decode(buffer: ArrayBuffer, frame: HandsFrame): void;

export class Interpolator {
  constructor(delayS?: number);
  delayS: number;
  late: number;
  output: HandsFrame;
  weight: number;
  push(frame: HandsFrame, arrival: number): HandsFrame;
  sample(now: number): boolean;
}

export interface ClientStats {
  state: string;
  /** Why the server does not solve on the hand profile, or an empty text. */
  problem: string;
  received: number;
  late: number;
  lost: number;
  refused: number;
  connections: number;
  seq: number;
  rateHz: number;
  ageS: number;
}

/** What the client uses of a WebSocket, so that other implementations fit. */
export interface SocketLike {
  binaryType: string;
  onopen: ((event: any) => void) | null;
  onmessage: ((event: any) => void) | null;
  onclose: ((event: any) => void) | null;
  onerror: ((event: any) => void) | null;
  send(text: string): void;
  close(): void;
}

/** A hand of a profile: 26 joints at rest (position in metres, quaternion) in the frame of the wrist joint, and radii. */
export interface ProfileHand {
  joints: (number[] | null)[];
  radii?: (number | null)[];
}

/** A hand profile, as docs/any-hand.md describes it. */
export interface HandProfile {
  name: string;
  left?: ProfileHand;
  right?: ProfileHand;
}

export interface AvatarOptions {
  /** The beginning of the profile's name in the server; the name of the object, if missing. */
  name?: string;
  /** A bone map: names that a known program gives to bones, and the names of this rig's bones. */
  map?: Record<string, string>;
  /** Which hand a rig is whose bones have WebXR's names. */
  side?: Side | null;
}

/** What AvatarHands uses of an object of three.js, with its bones below it in their rest pose. */
export interface RigObject {
  name: string;
  traverse(callback: (object: any) => void): void;
  updateWorldMatrix(updateParents: boolean, updateChildren: boolean): void;
}

/** The hands of an avatar of three.js. Throws an Error that says why the server cannot solve on them. */
export class AvatarHands {
  constructor(root: RigObject, options?: AvatarOptions);
  readonly profile: HandProfile;
  readonly sides: Side[];
  /** Poses the finger bones and, with `wrists`, moves the hands to their wrists. */
  show(hands: HandsFrame, options?: { wrists?: boolean }): void;
}

export interface ClientOptions {
  /** The actor whose hands are received; the first one received, if null. */
  actor?: string | null;
  /** How far behind the newest frame the hands are shown, in seconds. */
  delayS?: number;
  /** The token of the server's --web-token. */
  token?: string | null;
  /** The profile of the hands on which the server solves contact, such as that of AvatarHands. */
  hand?: HandProfile | null;
  /** The class of the sockets, where there is no global WebSocket. */
  WebSocket?: new (address: string, protocols?: string[]) => SocketLike;
}

export class ManipNetClient {
  constructor(address: string, options?: ClientOptions);
  /** The result of `sample`, a frame that the next call overwrites. */
  readonly hands: HandsFrame;
  /** Falls from 1 to 0 when the stream is lost; use it to blend to another animation. */
  readonly weight: number;
  /** Sets `hands` and `weight` for `nowS` (seconds of performance.now). Returns false before the first frame. */
  sample(nowS?: number): boolean;
  stats(): ClientStats;
  close(): void;
}

export const ANGLE_NAMES: readonly string[];
export const BONE_NAMES: readonly string[];
export const JOINT_NAMES: readonly string[];
export const JOINT_PARENTS: readonly number[];
