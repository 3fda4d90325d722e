// Finds the bones of hands among the names of a rig, as docs/any-hand.md describes, or by a bone map.
import { JOINT_NAMES } from "./layout.js";
import { FINGER_BONES, HAND_BONES, METACARPALS, THUMB_METACARPALS } from "./rig-names.js";

/** The joint of the first bone of each finger, and the one at its tip, as numbers in JOINT_NAMES. */
export const FIRST_JOINTS = [2, 7, 12, 17, 22];
export const TIP_JOINTS = [5, 10, 15, 20, 25];
/** The joint of each of the fifteen finger bones, thumb to little finger. */
export const JOINTS = FIRST_JOINTS.flatMap((first) => [first, first + 1, first + 2]);

const SIDES = ["left", "right"];

/**
 * The names of the bones of each hand among all `names`: `{ hand, fingers, metacarpals, tips }`, by side; fingers has
 * fifteen entries, thumb to little finger, and null for a bone that is missing. Entries of the bone `map` come first.
 * A rig whose bones have WebXR's names is one hand, and `side` says which.
 */
export function findHands(names, { map = {}, side = null } = {}) {
  if (JOINT_NAMES.filter((joint) => names.includes(joint)).length > 5) {
    if (!SIDES.includes(side)) throw new Error('the rig is one hand with WebXR\'s names; say { side: "left" } or "right"');
    return { [side]: webxrHand(names) };
  }
  const byPlain = new Map();
  for (const name of names) if (!byPlain.has(plain(name))) byPlain.set(plain(name), name);
  const strip = prefix(names);
  if (strip !== "") {
    for (const name of names) {
      const short = plain(name.startsWith(strip) ? name.slice(strip.length) : name);
      if (!byPlain.has(short)) byPlain.set(short, name);
    }
  }
  for (const [known, bone] of Object.entries(map)) {
    if (!names.includes(bone)) throw new Error(`the bone map says "${bone}" for ${known}, but the rig has no such bone`);
    if (!isKnown(plain(known))) throw new Error(`the bone map names "${known}", which no known program calls a bone of a hand`);
    byPlain.set(plain(known), bone);
  }
  const mapped = new Set(Object.keys(map).map(plain));
  const found = {};
  for (const each of SIDES) {
    const hand = handOf(byPlain, mapped, each);
    const fingers = [1, 2, 3, 4].filter((finger) => hand.fingers[3 * finger] !== null).length;
    if (hand.hand !== null && fingers >= 2) found[each] = hand;
  }
  return found;
}

function handOf(byPlain, mapped, side) {
  const first = (words) => byPlain.get(words.find((word) => mapped.has(word)) ?? words.find((word) => byPlain.has(word))) ?? null;
  const fingers = FINGER_BONES[side].map(first);
  const metacarpal = first(THUMB_METACARPALS[side][0]);
  if (metacarpal !== null && fingers[0] !== null) fingers.splice(0, 2, metacarpal, fingers[0]);
  else if (byPlain.has(`thumb0${side[0]}`)) {
    for (let part = 0; part < 3; part++) fingers[part] = byPlain.get(`thumb${part}${side[0]}`) ?? null;
  }
  return { hand: first(HAND_BONES[side][0]), fingers, metacarpals: METACARPALS[side].map(first), tips: Array(5).fill(null) };
}

function webxrHand(names) {
  const bone = (joint) => (names.includes(JOINT_NAMES[joint]) ? JOINT_NAMES[joint] : null);
  return {
    hand: bone(1),
    fingers: JOINTS.map(bone),
    metacarpals: FIRST_JOINTS.slice(1).map((first) => bone(first - 1)),
    tips: TIP_JOINTS.map(bone),
  };
}

function isKnown(word) {
  const tables = [FINGER_BONES, HAND_BONES, METACARPALS, THUMB_METACARPALS];
  return tables.some((table) => SIDES.some((side) => table[side].some((words) => words.includes(word))));
}

/** A name without namespace and punctuation, in lower case, with full-width digits as ordinary ones. */
function plain(name) {
  return name.slice(name.lastIndexOf(":") + 1).normalize("NFKC").replace(/[^\p{L}\p{N}]/gu, "").toLowerCase();
}

/** What the names of a rig begin with, up to a punctuation mark, such as the skeleton's name in Motive. */
function prefix(names) {
  const hands = names.filter((name) => plain(name).includes("hand"));
  const sorted = [...(hands.length ? hands : names)].sort();
  if (sorted.length === 0) return "";
  const [a, b] = [sorted[0], sorted.at(-1)];
  let same = 0;
  while (same < a.length && a[same] === b[same]) same++;
  return a.slice(0, Math.max(...[..."_:-."].map((mark) => a.slice(0, same).lastIndexOf(mark))) + 1);
}
