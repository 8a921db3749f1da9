// SPDX-License-Identifier: Apache-2.0
// What a link holds: mesh, design, room, material, light, camera, size of a pixel, and the pixel that is followed.

import { ROOM_START, START } from "./camera.js";

export const DEFAULTS = {
  mesh: "teapot.ply",
  design: "textured",
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

/** The state of a link's part behind #; what is not valid has its default. */
export function readState(hash) {
  const state = { ...DEFAULTS };
  for (const [name, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (!(name in DEFAULTS)) continue;
    const isNumber = typeof DEFAULTS[name] === "number";
    if (isNumber && !Number.isFinite(Number(text))) continue;
    if (["colour", "background"].includes(name) && !/^[0-9a-f]{6}$/.test(text)) continue;
    if (name === "follow" && !/^(-?[\d.]+(,-?[\d.]+){8}((,-?[\d.]+){5})?)?$/.test(text)) continue;
    if (name === "material" && !["diffuse", "metal", "mirror", "glass"].includes(text)) continue;
    state[name] = isNumber ? Number(text) : text;
  }
  state.elevation = Math.max(-89, Math.min(89, state.elevation));
  state.distance = Math.max(1.8, Math.min(40, state.distance));
  state.roomElevation = Math.max(-89, Math.min(89, state.roomElevation));
  state.roomDistance = Math.max(0.2, Math.min(5, state.roomDistance));
  state.pixel = [1, 2, 4].includes(state.pixel) ? state.pixel : 1;
  return state;
}

/** A link's part behind #, without defaults. */
export function writeState(state) {
  const changed = Object.entries(state).filter(([name, value]) => name in DEFAULTS && value !== DEFAULTS[name]);
  const text = (value) => (typeof value === "number" ? String(Math.round(value * 1000) / 1000) : value);
  return String(new URLSearchParams(changed.map(([name, value]) => [name, text(value)])));
}
