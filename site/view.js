// Views: what a frame of the state is, from the open mesh and its packed form for a design. `scene` has state, mesh,
// manifest and packed.

import { CUBE, START, cameraOf, isAtMaps, lightOf, onDisc, poseOf, roomCamera } from "./camera.js";
import { decode } from "./photo.js";
import { roomRegisters } from "./roomview.js";

const LIGHT = [1.2, 1.6, 1.5];
const GLASS = 1.5;
const ROUGHNESS = 0.45;
/** Passes of a frame that rests, with gathered light and without. */
const PASSES = [4, 64];

const colourOf = (hex) => [0, 2, 4].map((at) => decode(parseInt(hex.slice(at, at + 2), 16)));

/** Whether frames gather the light of the room. */
const gathers = ({ state }, room) => Boolean(room?.light && state.gather);

export const passesOf = (scene, room) => PASSES[Number(gathers(scene, room))];

/** The material that the design has of the one that is chosen; metal as rough as this is diffuse where no light is gathered. */
export function materialOf(scene, room) {
  const { state, manifest } = scene;
  if (manifest.config.frame.maxBounces === 0) return "diffuse";
  return state.material === "metal" && !gathers(scene, room) ? "diffuse" : state.material;
}

/** The registers of the lobe of rough metal, and the share of light that its microfacets reflect at once (docs/gather.md). */
function lobe() {
  const alpha = Math.round(2 ** 8 * ROUGHNESS ** 2) / 2 ** 8;
  return {
    registers: {
      "materials[0].lobe.alpha": 2 ** 8 * alpha,
      "materials[0].lobe.slope": Math.round((2 ** 6 * (1 - alpha ** 2)) / (2 * alpha ** 2)),
      "materials[0].lobe.peak": Math.round(-256 * Math.log2(alpha)),
    },
    share: 1 - ROUGHNESS ** 4 / (0.25 + 0.9 * ROUGHNESS ** 2 + 0.55 * ROUGHNESS ** 4),
  };
}

/** The registers that the mesh and the controls set. */
function registersOf(scene, room) {
  const { state, mesh, manifest, packed } = scene;
  const { numbers, config } = manifest;
  const material = materialOf(scene, room);
  const metal = lobe();
  const share = { diffuse: 1 / (room?.headroom ?? 1), metal: metal.share }[material] ?? 1;
  const white = 2 ** numbers.colourBits - 1;
  const one = 2 ** numbers.lightFraction;
  const rgb = (name, colour) => Object.fromEntries([..."rgb"].map((channel, i) => [`${name}.${channel}`, Math.round(colour[i] * white)]));
  const registers = {
    ...(room ? {} : rgb("background", colourOf(state.background))),
    ...(room?.encoded ? roomRegisters(room, manifest) : {}),
    ...rgb("materials[0].albedo", colourOf(state.colour).map((value) => value * share)),
    "bounds.low.x": packed.lowX, "bounds.low.y": packed.lowY, "bounds.low.z": packed.lowZ,
    "bounds.high.x": packed.highX, "bounds.high.y": packed.highY, "bounds.high.z": packed.highZ,
    "scene.recordCount": packed.recordCount,
    "scene.triangleBase": packed.triangleBase,
    "scene.triangleRecords": packed.triangleRecords,
    "scene.attributeBase": packed.attributeBase,
    "shading.offset": packed.shadingOffset,
    "shading.shadows": state.shadows,
    "shading.bounces": Math.min(state.bounces, config.frame.maxBounces),
    "materials[0].hasCornerColours": Number(mesh.hasColours && material === "diffuse"),
    "materials[0].kind": ["diffuse", "mirror", "glass", "metal"].indexOf(material),
    "materials[0].lobe.alpha": 0,
    "gather.bounces": Number(gathers(scene, room)),
    "frame.watchdogCycles": 0,
  };
  if (material === "metal") Object.assign(registers, metal.registers);
  if (material === "glass") {
    registers["materials[0].etaFront"] = Math.round(2 ** numbers.etaFraction / GLASS);
    registers["materials[0].etaBack"] = Math.round(2 ** numbers.etaFraction * GLASS);
    registers["materials[0].reflectance"] = Math.round(((GLASS - 1) / (GLASS + 1)) ** 2 * one);
  }
  return registers;
}

/** The object's pose in the room, turned by the orbit. */
export function poseIn({ manifest, packed }, room, orbit) {
  return room ? poseOf(room, orbit.azimuth - START.azimuth, packed.lowY / (2 ** manifest.config.geometry.vertexBits - 1)) : CUBE;
}

/**
 * A frame in a room, or without one. In a room an orbit turns the object, and moves the camera from that of the maps.
 * `sample`: index and count of a pass; `discs`: the points of lights' discs in each pass, by the number of passes.
 */
export function viewOf(scene, room, width, height, orbit, sample = null, discs = {}) {
  const registers = registersOf(scene, room);
  const points = sample ? discs[sample.count][sample.index] : [];
  if (room) {
    const inPhoto = Boolean(scene.state.photo) && isAtMaps(orbit);
    // Where there is no photo, the room is the device's
    const window = inPhoto ? {} : { "environment.window.x0": 0, "environment.window.y0": 0, "environment.window.x1": width, "environment.window.y1": height };
    return {
      file: String(room.height / height),
      camera: roomCamera(room, width, height, orbit),
      object: poseIn(scene, room, orbit),
      lights: (room.light?.lamps ?? []).map((lamp, index) => ({ ...lamp, position: onDisc(lamp, room.object.position, points[index]) })),
      registers: { ...registers, ...window },
      sample,
      exposure: room.light?.exposure ?? 1,
      inPhoto,
    };
  }
  const light = { position: lightOf(cameraOf(START, width, height), LIGHT), colour: [0.9, 0.9, 0.9].map((value) => value * scene.state.light) };
  return { file: "plain", camera: cameraOf(orbit, width, height), lights: [light], registers, sample, exposure: 1 };
}
