// Runs the web client for the tests, which talk to it in lines of text: `decode FILES`, `interpolate`, `live ADDRESS`
// and `garbage FILE`.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { decode, HandsFrame, Interpolator, ManipNetClient } from "../../../clients/web/manipnet.js";
import { HEADER_SEQ, HEADER_T_CAPTURE, RATE_HZ } from "../../../clients/web/layout.js";

const [verb, ...words] = process.argv.slice(2);
const lines = () => createInterface({ input: process.stdin });
const exact = (bytes) => bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);

function describe(buffer) {
  const frame = new HandsFrame();
  try {
    decode(buffer, frame);
  } catch (error) {
    return { error: error.message };
  }
  const { session, actor, seq } = frame;
  const hands = {};
  for (const side of ["left", "right"]) {
    const { present, ...hand } = frame[side];
    if (!present) continue;
    for (const field of ["angles", "rotations", "wrist", "joints"]) hand[field] = [...hand[field]];
    hands[side] = hand;
  }
  const bodies = frame.bodies.slice(0, frame.bodyCount).map((b) => ({ ...b, pose: [...b.pose] }));
  const times = { t_capture: frame.tCapture, t_publish: frame.tPublish, look_ahead: frame.lookAhead };
  return { session, actor, seq, ...times, latency_ms: [...frame.latencyMs], hands, bodies };
}

async function interpolate() {
  const interpolator = new Interpolator();
  let spare = new HandsFrame();
  for await (const line of lines()) {
    const [what, value, data] = line.split(" ");
    if (what === "delay") interpolator.delayS = Number(value);
    if (what === "push") {
      decode(exact(Buffer.from(data, "hex")), spare);
      const next = interpolator.push(spare, Number(value));
      console.log(next === spare ? 0 : 1);
      spare = next;
    }
    if (what === "show") {
      if (!interpolator.sample(Number(value))) {
        console.log("none");
        continue;
      }
      const { left, seq, bodies } = interpolator.output;
      const values = [left.wrist[0], left.wrist[5], left.wrist[6], left.angles[3], left.joints[7 * 25], bodies[0].pose[0]];
      console.log(interpolator.weight, seq, ...values);
    }
  }
}

/** Node's performance.now starts with the process; the others' clock is the machine's. */
const sinceBoot = Number(process.hrtime.bigint()) / 1e9 - performance.now() / 1000;

/** Shows at about 90 Hz until standard input ends. Answers "arrivals" with arrivals, and any other line with figures. */
async function live(address) {
  const client = new ManipNetClient(address, { delayS: 0.05 });
  let [shows, seq, arrivals] = [0, -1, []];
  const showing = setInterval(() => client.sample() && shows++, 11);
  const noting = setInterval(() => {
    const stats = client.stats();
    if (stats.received === 0 || stats.seq === seq) return;
    seq = stats.seq;
    arrivals.push([seq, sinceBoot + performance.now() / 1000 - stats.ageS]);
  }, 1);
  for await (const line of lines()) {
    if (line === "arrivals") {
      console.log(JSON.stringify(arrivals));
      arrivals = [];
      continue;
    }
    const { rateHz, ageS, ...stats } = client.stats();
    const shown = { weight: client.weight, shown_seq: client.hands.seq, session: client.hands.session };
    console.log(JSON.stringify({ ...stats, rate_hz: rateHz, age_s: ageS, ...shown, shows }));
  }
  clearInterval(showing);
  clearInterval(noting);
  client.close();
  console.log("closed");
}

/** Heap bytes per frame of reading and showing a message again and again, without what the WebSocket itself makes. */
function garbage(path) {
  const message = exact(readFileSync(path));
  const view = new DataView(message);
  const interpolator = new Interpolator();
  let spare = new HandsFrame();
  const frames = (from, to) => {
    for (let k = from; k < to; k++) {
      view.setUint32(HEADER_SEQ, k, true);
      view.setFloat64(HEADER_T_CAPTURE, k / RATE_HZ, true);
      decode(message, spare);
      spare = interpolator.push(spare, k / RATE_HZ);
      interpolator.sample(k / RATE_HZ);
    }
  };
  frames(0, 20_000); // the engine compiles it meanwhile
  globalThis.gc();
  const before = process.memoryUsage().heapUsed;
  frames(20_000, 30_000);
  console.log((process.memoryUsage().heapUsed - before) / 10_000);
}

if (verb === "decode") for (const path of words) console.log(JSON.stringify(describe(exact(readFileSync(path)))));
else if (verb === "interpolate") await interpolate();
else if (verb === "live") await live(words[0]);
else if (verb === "garbage") garbage(words[0]);
else process.exit(2);
