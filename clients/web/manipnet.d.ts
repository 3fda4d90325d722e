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
  close(): void;
}

export interface ClientOptions {
  /** The actor whose hands are received; the first one received, if null. */
  actor?: string | null;
  /** How far behind the newest frame the hands are shown, in seconds. */
  delayS?: number;
  /** The token of the server's --web-token. */
  token?: string | null;
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
