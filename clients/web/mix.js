// Weighted means of frames; quaternions are summed and normalised.
import { SIDES } from "./frame.js";

/** Writes the mean to `output`; names, states and the like come from `frames[reference]`. */
export function mix(frames, weights, reference, output) {
  output.copyFrom(frames[reference]);
  for (const side of SIDES) mixHand(frames, weights, side, output[side]);
  for (let i = 0; i < output.bodyCount; i++) mixBody(frames, weights, i, output.bodies[i]);
}

const sources = [];
const parts = [];

function mixHand(frames, weights, side, output) {
  if (!output.present) return;
  for (let k = 0; k < frames.length; k++) {
    if (weights[k] !== 0 && !frames[k][side].present) return; // it appears or disappears, so it is not in all frames
  }
  gatherHand(frames, weights, side, "angles");
  numbers(output.angles, 0, 1, 1);
  gatherHand(frames, weights, side, "rotations");
  quaternions(output.rotations, 0, 4);
  gatherHand(frames, weights, side, "wrist");
  poses(output.wrist);
  gatherHand(frames, weights, side, "joints");
  poses(output.joints);
}

function mixBody(frames, weights, index, output) {
  sources.length = parts.length = 0;
  for (let k = 0; k < frames.length; k++) {
    if (weights[k] === 0) continue;
    if (index >= frames[k].bodyCount || frames[k].bodies[index].name !== output.name) return;
    sources.push(frames[k].bodies[index].pose);
    parts.push(weights[k]);
  }
  poses(output.pose);
}

function gatherHand(frames, weights, side, field) {
  sources.length = parts.length = 0;
  for (let k = 0; k < frames.length; k++) {
    if (weights[k] === 0) continue;
    sources.push(frames[k][side][field]);
    parts.push(weights[k]);
  }
}

function poses(output) {
  numbers(output, 0, 7, 3);
  quaternions(output, 3, 7);
}

function numbers(output, first, stride, width) {
  for (let i = first; i < output.length; i += stride) {
    for (let j = i; j < i + width; j++) {
      let sum = 0;
      for (let k = 0; k < parts.length; k++) sum += parts[k] * sources[k][j];
      output[j] = sum;
    }
  }
}

/** Sums quaternions, each with the sign that is nearer to the reference, which `output` still holds. */
function quaternions(output, first, stride) {
  for (let i = first; i < output.length; i += stride) {
    let x = 0;
    let y = 0;
    let z = 0;
    let w = 0;
    for (let k = 0; k < parts.length; k++) {
      const q = sources[k];
      const dot =
        q[i] * output[i] + q[i + 1] * output[i + 1] + q[i + 2] * output[i + 2] + q[i + 3] * output[i + 3];
      const weight = dot < 0 ? -parts[k] : parts[k];
      x += weight * q[i];
      y += weight * q[i + 1];
      z += weight * q[i + 2];
      w += weight * q[i + 3];
    }
    const length = Math.hypot(x, y, z, w);
    if (length < 1e-6) continue;
    output[i] = x / length;
    output[i + 1] = y / length;
    output[i + 2] = z / length;
    output[i + 3] = w / length;
  }
}
