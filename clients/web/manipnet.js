// Receives hands from ManipNet Live in a browser.
//
//   const client = new ManipNetClient("ws://127.0.0.1:8081");
//   function draw() {
//     if (client.sample()) show(client.hands.left.joints, client.weight);
//     requestAnimationFrame(draw);
//   }
import { decode, HandsFrame } from "./frame.js";
import { Interpolator } from "./interpolator.js";
import { RATE_HZ } from "./layout.js";

export { AvatarHands } from "./avatar.js";
export { decode, HandsFrame } from "./frame.js";
export { Interpolator } from "./interpolator.js";
export { ANGLE_NAMES, BONE_NAMES, JOINT_NAMES, JOINT_PARENTS } from "./layout.js";

const BACK_OFF_MS = 100;
const BACK_OFF_LIMIT_MS = 1000;
const DEAD_AFTER_MS = 5000;
const SUBPROTOCOL = "manipnet";

/** Receives the hands of one actor (the first one received, if none is named) and reconnects by itself. */
export class ManipNetClient {
  #address;
  #protocols;
  #WebSocket;
  #actor;
  #interpolator;
  #socket = null;
  #spare = new HandsFrame();
  #arrivals = new Float64Array(RATE_HZ);
  #waitMs = BACK_OFF_MS;
  #timer = null;
  #watch;
  #closed = false;
  #session = null;
  #seq = 0;
  #receivedMs = 0;
  #newestAt = -Infinity;
  #profile;
  #counts = { state: "connecting", problem: "", received: 0, lost: 0, refused: 0, connections: 0 };

  /**
   * `address` is "ws://HOST:PORT" from the server's line `ready`, or "wss://…" behind a proxy with TLS. Throws an Error
   * for any other form. `token` is the one of the server's --web-token. `WebSocket` is the class of the sockets, for
   * programs without one of their own, such as node before version 22. `hand` is a hand profile, such as that of
   * AvatarHands, on which the server then solves contact; the profile is uploaded at each connection.
   */
  constructor(
    address,
    { actor = null, delayS = 0.1, token = null, hand = null, WebSocket = globalThis.WebSocket } = {},
  ) {
    if (!/^wss?:\/\/[^/]+/.test(address)) {
      throw new Error(`the address is "${address}"; allowed is ws://HOST:PORT, as in ws://127.0.0.1:8081`);
    }
    if (typeof WebSocket !== "function") {
      throw new Error("there is no WebSocket here; pass one, as in new ManipNetClient(address, { WebSocket })");
    }
    this.#profile = hand;
    this.#address = hand === null ? address : `${address.replace(/\/$/, "")}/hand/${encodeURIComponent(hand.name)}`;
    this.#protocols = token === null ? [] : [SUBPROTOCOL, `${SUBPROTOCOL}.token.${token}`];
    this.#WebSocket = WebSocket;
    this.#actor = actor;
    this.#interpolator = new Interpolator(delayS);
    this.#watch = setInterval(() => this.#checkAlive(), 500);
    this.#connect();
  }

  /** The result of `sample`, a HandsFrame that the next call overwrites. */
  get hands() {
    return this.#interpolator.output;
  }

  /** Falls from 1 to 0 when the stream is lost; use it to blend to another animation. */
  get weight() {
    return this.#interpolator.weight;
  }

  /** Sets `hands` and `weight` for `now` (seconds of performance.now). Returns false before the first frame. */
  sample(nowS = performance.now() / 1000) {
    return this.#interpolator.sample(nowS);
  }

  /** The state, the problem with the hand profile (or ""), and the counters: received, late, lost, refused, connections, seq (of the newest), rateHz, ageS. */
  stats() {
    const now = performance.now() / 1000;
    const known = this.#arrivals.subarray(0, Math.min(this.#counts.received, RATE_HZ));
    const recent = known.filter((t) => now - t <= 1);
    const span = recent.length > 1 ? Math.max(...recent) - Math.min(...recent) : 0;
    const rateHz = span > 0 ? (recent.length - 1) / span : 0;
    return { ...this.#counts, late: this.#interpolator.late, seq: this.#seq, rateHz, ageS: now - this.#newestAt };
  }

  close() {
    this.#closed = true;
    this.#counts.state = "closed";
    clearTimeout(this.#timer);
    clearInterval(this.#watch);
    this.#socket?.close();
  }

  #connect() {
    this.#receivedMs = performance.now();
    const socket = new this.#WebSocket(this.#address, this.#protocols);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#receivedMs = performance.now();
      this.#counts.connections++;
      this.#counts.state = "connected";
      if (this.#profile !== null) socket.send(JSON.stringify(this.#upload()));
    };
    socket.onmessage = ({ data }) => {
      if (socket !== this.#socket) return;
      if (typeof data === "string") this.#takeAnswer(data);
      else this.#take(data, performance.now() / 1000);
    };
    socket.onclose = socket.onerror = () => this.#retry(socket);
    this.#socket = socket;
  }

  #upload() {
    return { op: "hand_profile", profile: this.#profile, ...(this.#actor === null ? {} : { actor: this.#actor }) };
  }

  /** The server's answer to the profile, which says why the server refuses it, if it does. */
  #takeAnswer(text) {
    this.#receivedMs = performance.now();
    const { error } = JSON.parse(text);
    this.#counts.problem = error === undefined ? "" : `the server refuses the hand profile: ${error}`;
  }

  #retry(socket) {
    if (this.#closed || socket !== this.#socket) return; // a close event may follow an error
    this.#socket = null;
    this.#counts.state = "reconnecting";
    this.#timer = setTimeout(() => this.#connect(), this.#waitMs);
    this.#waitMs = Math.min(2 * this.#waitMs, BACK_OFF_LIMIT_MS);
  }

  /** Reconnects after silence, because the socket of a vanished server stays open, or opening, for minutes. */
  #checkAlive() {
    const socket = this.#socket;
    if (socket === null || performance.now() - this.#receivedMs < DEAD_AFTER_MS) return;
    this.#retry(socket);
    socket.close();
  }

  #take(data, arrival) {
    this.#receivedMs = 1000 * arrival;
    try {
      decode(data, this.#spare);
    } catch (error) {
      this.#counts.refused++;
      this.#counts.state = `message refused: ${error.message}`;
      return;
    }
    const frame = this.#spare;
    this.#actor ??= frame.actor;
    if (frame.actor !== this.#actor) return;
    if (frame.session === this.#session) this.#counts.lost += Math.max(frame.seq - this.#seq - 1, 0);
    this.#session = frame.session;
    this.#seq = frame.seq;
    this.#arrivals[this.#counts.received++ % RATE_HZ] = arrival;
    this.#waitMs = BACK_OFF_MS;
    this.#counts.state = "connected";
    this.#spare = this.#interpolator.push(frame, arrival);
    if (this.#spare !== frame) this.#newestAt = arrival;
  }
}
