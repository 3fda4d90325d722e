// The last frames on the 60 Hz grid of their capture times, and the weights of frames that show an instant between
// them. The weights are those of a uniform cubic B-spline, whose acceleration never exceeds the frames' second
// differences. A lost frame is replaced by the cubic through two neighbours on each side, and beyond the ends the first
// or last two frames are continued in a straight line.
import { HandsFrame } from "./frame.js";

export const RING_SIZE = 32;

export class Ring {
  frames = Array.from({ length: RING_SIZE }, () => new HandsFrame());
  weights = new Float64Array(RING_SIZE);
  #grid = new Float64Array(RING_SIZE).fill(Number.NaN);
  #nodes = new Float64Array(4);
  #first = 0;
  #last = 0;
  #empty = true;

  clear() {
    this.#empty = true;
  }

  /** Stores a frame and returns another one, which may be overwritten. */
  exchange(grid, frame) {
    const slot = slotOf(grid);
    const free = this.frames[slot];
    this.frames[slot] = frame;
    if (this.#empty) {
      this.#grid.fill(Number.NaN);
      this.#first = this.#last = grid;
      this.#empty = false;
    }
    this.#grid[slot] = grid;
    this.#last = Math.max(this.#last, grid);
    while (!this.#isPresent(this.#first)) this.#first++;
    return free;
  }

  /** Sets `weights` for a position on the grid and returns the slot of the nearest frame. */
  weigh(position) {
    this.weights.fill(0);
    position = Math.min(Math.max(position, this.#first), this.#last);
    if (this.#first === this.#last) {
      this.weights[slotOf(this.#last)] = 1;
      return slotOf(this.#last);
    }
    const start = Math.min(Math.floor(position), this.#last - 1);
    const f = position - start;
    const g = 1 - f;
    this.#add(start - 1, (g * g * g) / 6);
    this.#add(start, (3 * f * f * f - 6 * f * f + 4) / 6);
    this.#add(start + 1, (-3 * f * f * f + 3 * f * f + 3 * f + 1) / 6);
    this.#add(start + 2, (f * f * f) / 6);
    return this.#nearest(position);
  }

  #nearest(position) {
    let nearest = slotOf(this.#last);
    let least = Infinity;
    for (let i = this.#first; i <= this.#last; i++) {
      const distance = Math.abs(i - position);
      if (!this.#isPresent(i) || distance >= least) continue;
      least = distance;
      nearest = slotOf(i);
    }
    return nearest;
  }

  #add(index, weight) {
    if (this.#isPresent(index)) {
      this.weights[slotOf(index)] += weight;
    } else if (index > this.#last) {
      this.#add(this.#last, 2 * weight);
      this.#add(this.#last - 1, -weight);
    } else if (index < this.#first) {
      this.#add(this.#first, 2 * weight);
      this.#add(this.#first + 1, -weight);
    } else {
      this.#fill(index, weight);
    }
  }

  /** Adds a lost frame by the polynomial through up to two frames on each side of it. */
  #fill(index, weight) {
    const nodes = this.#nodes;
    const count = this.#collect(index, 1, this.#collect(index, -1, 0));
    for (let i = 0; i < count; i++) {
      let part = weight;
      for (let j = 0; j < count; j++) if (j !== i) part *= (index - nodes[j]) / (nodes[i] - nodes[j]);
      this.weights[slotOf(nodes[i])] += part;
    }
  }

  #collect(index, step, count) {
    const limit = count + 2;
    for (let i = index + step; i >= this.#first && i <= this.#last && count < limit; i += step) {
      if (this.#isPresent(i)) this.#nodes[count++] = i;
    }
    return count;
  }

  #isPresent(index) {
    const inside = index >= this.#first && index <= this.#last && index > this.#last - RING_SIZE;
    return inside && this.#grid[slotOf(index)] === index;
  }
}

function slotOf(grid) {
  return ((grid % RING_SIZE) + RING_SIZE) % RING_SIZE;
}
