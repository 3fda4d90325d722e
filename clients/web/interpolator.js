// Interpolates hands by capture time, a chosen delay behind, for any display rate; holds and then fades them on loss.
import { SmoothClock } from "./clock.js";
import { HandsFrame } from "./frame.js";
import { RATE_HZ } from "./layout.js";
import { mix } from "./mix.js";
import { Ring, RING_SIZE } from "./ring.js";

const HOLD_S = 0.5;
const FADE_S = 0.5;
const BLEND_S = 0.2;
const STALE_S = 0.25;
const STALE_LIMIT_S = 0.5;

export class Interpolator {
  delayS;
  /** The number of frames that came too late to be shown. */
  late = 0;
  /** The result of the last call of `sample`. */
  output = new HandsFrame();
  /** Falls from 1 to 0 when the stream is lost; use it to blend to another animation. */
  weight = 0;
  #ring = new Ring();
  #clock = new SmoothClock();
  #shown = new HandsFrame();
  #held = new HandsFrame();
  #pair = [null, null];
  #pairWeights = [0, 0];
  #session = null;
  #seq = 0;
  #capture = 0;
  #t0 = 0;
  #now = 0;
  #resumed = 0;
  #staleSince = Number.NaN;
  #hasShown = false;
  #starved = false;
  #blending = false;

  constructor(delayS = 0.1) {
    this.delayS = delayS;
  }

  /** Adds a frame that arrived at the local time `arrival` (seconds), and returns a frame to fill next. */
  push(frame, arrival) {
    if (!this.#accept(frame, arrival)) {
      this.late++;
      return frame;
    }
    this.#clock.observe(arrival, frame.tCapture);
    this.#session = frame.session;
    this.#seq = frame.seq;
    this.#capture = frame.tCapture;
    return this.#ring.exchange(this.#gridOf(frame.tCapture), frame);
  }

  /** Sets `output` and `weight` for the local time `now`, which must not decrease. False before the first frame. */
  sample(now) {
    if (this.#session === null) return false;
    const position = (this.#clock.captureTime(now) - this.delayS - this.#t0) * RATE_HZ;
    const nearest = this.#ring.weigh(position);
    mix(this.#ring.frames, this.#ring.weights, nearest, this.output);
    const starved = (position - this.#gridOf(this.#capture)) / RATE_HZ;
    this.#ease(starved, now);
    const target = 1 - smoothstep((starved - HOLD_S) / FADE_S);
    this.weight = this.#hasShown ? Math.min(target, this.weight + (now - this.#now) / FADE_S) : target;
    this.#shown.copyFrom(this.output);
    this.#hasShown = true;
    this.#now = now;
    return true;
  }

  #accept(frame, arrival) {
    const same = this.#session !== null && frame.session === this.#session;
    if (same && frame.seq <= this.#seq) return false;
    if (!same || frame.tCapture < this.#capture - 0.5 / RATE_HZ) this.#restart(frame);
    else if (this.#isStale(frame, arrival)) return false;
    else if (frame.tCapture - this.#capture >= RING_SIZE / RATE_HZ) this.#ring.clear();
    return true;
  }

  /** Starts again, for a new session or after the sender's clock went back, as when a take loops. */
  #restart(frame) {
    this.#ring.clear();
    this.#clock.reset();
    this.#t0 = frame.tCapture;
    this.#staleSince = Number.NaN;
    this.#starved = this.#hasShown;
  }

  /** Whether the frame is backlog after a stall; if frames stay late for long, the clock has changed instead. */
  #isStale(frame, arrival) {
    if (arrival - frame.tCapture - this.#clock.target <= STALE_S) {
      this.#staleSince = Number.NaN;
      return false;
    }
    if (Number.isNaN(this.#staleSince)) this.#staleSince = arrival;
    if (arrival - this.#staleSince <= STALE_LIMIT_S) return true;
    this.#restart(frame);
    return false;
  }

  /** Blends with the held pose for a short time after a gap. */
  #ease(starved, now) {
    if (starved > 1 / RATE_HZ) {
      this.#starved = true;
    } else if (this.#starved) {
      this.#starved = false;
      this.#blending = this.#hasShown;
      this.#resumed = this.#now;
      this.#held.copyFrom(this.#shown);
    }
    const part = (now - this.#resumed) / BLEND_S;
    this.#blending &&= part < 1;
    if (!this.#blending) return;
    this.#shown.copyFrom(this.output);
    this.#pair[0] = this.#held;
    this.#pair[1] = this.#shown;
    this.#pairWeights[1] = smoothstep(part);
    this.#pairWeights[0] = 1 - this.#pairWeights[1];
    mix(this.#pair, this.#pairWeights, 1, this.output);
  }

  #gridOf(capture) {
    return Math.round((capture - this.#t0) * RATE_HZ);
  }
}

function smoothstep(x) {
  x = Math.min(Math.max(x, 0), 1);
  return x * x * (3 - 2 * x);
}
