// What a link holds: mesh, design, room, material, light, camera, size of a pixel, and the pixel that is followed.

import { ROOM_START, START } from "./camera.js";

export const DEFAULTS = {
  mesh: "teapot.ply",
  design: "small",
  room: "",
  photo: 1,
  gather: 1,
  material: "diffuse",
  colour: "d8c8b0",
  background: "182028",
  light: 1,
  shadows: 1,
  bounces: 4,
  pixel: 1,
  ...START,
  ...ROOM_START,
  follow: "",
};
/** What the page shows without a link: the teapot of brushed copper of scenes/metal.toml, in its room. */
const FIRST = { room: "living", material: "metal", colour: "f9d1c2", azimuth: START.azimuth + 25 };

/** The least and the largest value of each number; those of WHOLE are whole. */
export const RANGES = {
  photo: [0, 1],
  gather: [0, 1],
  light: [0, 2],
  shadows: [0, 1],
  bounces: [0, 15],
  pixel: [1, 4],
  azimuth: [-360, 360],
  elevation: [-89, 89],
  distance: [1.8, 40],
  x: [-20, 20],
  y: [-20, 20],
  roomAzimuth: [-180, 180],
  roomElevation: [-89, 89],
  roomDistance: [0.2, 5],
  roomX: [-10, 10],
  roomY: [-10, 10],
};
const WHOLE = ["photo", "gather", "shadows", "bounces", "pixel"];
/** The texts of names that are not free. */
const TEXTS = { colour: /^[0-9a-f]{6}$/, background: /^[0-9a-f]{6}$/, material: /^(file|diffuse|metal|mirror|glass)$/ };
const NUMBER = /^-?\d+(\.\d+)?$/;

/** The value in the range of its name that is nearest. */
export const within = (name, value) => Math.max(RANGES[name][0], Math.min(RANGES[name][1], value));

function isValid(name, text) {
  if (name === "follow") return text === "" || followOf(text) !== null;
  if (!Object.hasOwn(RANGES, name)) return !Object.hasOwn(TEXTS, name) || TEXTS[name].test(text);
  const value = Number(text);
  return (
    NUMBER.test(text) &&
    value === within(name, value) &&
    (!WHOLE.includes(name) || Number.isInteger(value)) &&
    (name !== "pixel" || value !== 3)
  );
}

/** The state of a link's part behind #; what is not valid, or out of its range, has its default. */
export function readState(hash) {
  const link = hash.replace(/^#/, "");
  const state = { ...DEFAULTS, ...(link === "" ? FIRST : {}) };
  for (const [name, text] of new URLSearchParams(link))
    if (Object.hasOwn(DEFAULTS, name) && isValid(name, text))
      state[name] = Object.hasOwn(RANGES, name) ? Number(text) : text;
  return state;
}

/**
 * A link's part behind #, without defaults; it is never empty, since an empty one is that of the page's first picture.
 */
export function writeState(state) {
  const changed = Object.entries(state).filter(
    ([name, value]) => Object.hasOwn(DEFAULTS, name) && value !== DEFAULTS[name],
  );
  const text = (value) => (typeof value === "number" ? String(rounded3(value)) : value);
  return String(new URLSearchParams(changed.map(([name, value]) => [name, text(value)]))) || "room=";
}

const rounded3 = (value) => Math.round(value * 1000) / 1000;

/**
 * The text of a followed pixel: its place, the size of its frame, and the frame's orbit, with that in a room if the
 * camera has moved there.
 */
export function followText({ x, y, width, height, orbit }, isMoved) {
  const names = [...Object.keys(START), ...(isMoved ? Object.keys(ROOM_START) : [])];
  return [x, y, width, height, ...names.map((name) => rounded3(orbit[name]))].join();
}

/** What followText wrote; null if a number is not one that it writes. */
export function followOf(text) {
  const values = text.split(",");
  const names = Object.keys(START).concat(values.length > 9 ? Object.keys(ROOM_START) : []);
  if (values.length !== 4 + names.length || !values.every((value) => NUMBER.test(value))) return null;
  const [x, y, width, height, ...angles] = values.map(Number);
  if (![x, y, width, height].every(Number.isInteger) || x < 0 || y < 0 || x >= width || y >= height) return null;
  if (!names.every((name, index) => angles[index] === within(name, angles[index]))) return null;
  return {
    x,
    y,
    width,
    height,
    orbit: { ...ROOM_START, ...Object.fromEntries(names.map((name, index) => [name, angles[index]])) },
  };
}
