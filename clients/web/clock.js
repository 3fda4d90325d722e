// An estimate of the sender's clock. The offset is a critically damped spring towards the smallest difference of
// arrival and capture time in about the last second, so neither jitter nor a better estimate makes a step.
const WINDOW = 64;
const STIFFNESS_HZ = 2;
const SNAP_S = 0.25;

export class SmoothClock {
  #offsets = new Float64Array(WINDOW);
  #count = 0;
  #offset = 0;
  #speed = 0;
  #now = 0;

  reset() {
    this.#count = 0;
  }

  get target() {
    let least = Infinity;
    for (let i = 0; i < Math.min(this.#count, WINDOW); i++) least = Math.min(least, this.#offsets[i]);
    return least;
  }

  observe(arrival, capture) {
    this.#offsets[this.#count % WINDOW] = arrival - capture;
    if (this.#count === 0) {
      this.#offset = arrival - capture;
      this.#speed = 0;
      this.#now = arrival;
    }
    this.#count++;
  }

  /** The sender's time at the local time `now`, which must not decrease between calls. */
  captureTime(now) {
    const step = Math.max(now - this.#now, 0);
    this.#now = Math.max(now, this.#now);
    const target = this.target;
    const error = this.#offset - target;
    if (Math.abs(error) > SNAP_S) {
      this.#offset = target;
      this.#speed = 0;
      return now - this.#offset;
    }
    const pull = this.#speed + STIFFNESS_HZ * error;
    const decay = Math.exp(-STIFFNESS_HZ * step);
    this.#offset = target + (error + pull * step) * decay;
    this.#speed = (this.#speed - STIFFNESS_HZ * pull * step) * decay;
    return now - this.#offset;
  }
}
