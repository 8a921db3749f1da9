// Views: what a frame of the state is, from the open mesh and its packed form for a design. `scene` has state, mesh,
// manifest, packed, and the time of the mesh's animation.

import { CUBE, START, cameraOf, isAtMaps, lightOf, onDisc, poseOf, roomCamera } from "./camera.js";
import { decode } from "./photo.js";
import { roomRegisters } from "./roomview.js";
import { microfacetAlbedo } from "./surfaces.js";

const LIGHT = [1.2, 1.6, 1.5];
const GLASS = 1.5;
const ROUGHNESS = 0.45;
/** Of a pass's threshold of coverage, between entries (host/colonnade/scene/samples.py). */
const GOLDEN = (Math.sqrt(5) - 1) / 2;
/** Passes of a frame that rests, with gathered light and without. */
const PASSES = [4, 64];

const colourOf = (hex) => [0, 2, 4].map((at) => decode(parseInt(hex.slice(at, at + 2), 16)));

/** Whether frames gather the light of the room. */
const gathers = ({ state }, room) => Boolean(room && state.gather);

export const passesOf = (scene, room) => PASSES[Number(gathers(scene, room))];

/**
 * The material that the design has of the one that is chosen; metal as rough as this is diffuse where no light is
 * gathered.
 */
export function materialOf(scene, room) {
  const { state, mesh, manifest } = scene;
  if (state.material === "file") return mesh.hasMaterials ? "file" : "diffuse";
  if (manifest.config.frame.maxBounces === 0) return "diffuse";
  return state.material === "metal" && !gathers(scene, room) ? "diffuse" : state.material;
}

/** What packing needs to know of surfaces (worker.js). */
export const surfaceOf = (scene, room) => ({
  material: materialOf(scene, room),
  gathers: gathers(scene, room),
  headroom: room?.headroom ?? 1,
});

/** An entry in a pass of this threshold, or in the only one: itself or clear, as often as its coverage says. */
function inPass(entry, index, threshold) {
  if (!(entry.coverage < 1)) return entry;
  const clear = {
    kind: "glass",
    albedo: [1, 1, 1],
    roughness: 0,
    ior: 1,
    emission: [0, 0, 0],
    hasColours: false,
    hasTexture: false,
  };
  if (threshold !== null) return (threshold + index * GOLDEN) % 1 < entry.coverage ? entry : clear;
  return entry.coverage < 0.5
    ? { ...clear, albedo: entry.albedo.map((value) => 1 - entry.coverage * (1 - value)) }
    : entry;
}

/** The registers of the material table's entries, in a pass of this threshold. */
export const tableRegisters = (entries, frame, threshold = null) =>
  Object.assign({}, ...entries.map((entry, index) => entryRegisters(index, inPass(entry, index, threshold), frame)));

/** The registers of an entry of the material table, as host/colonnade/registers/shading.py has them. */
function entryRegisters(
  index,
  { kind, roughness, ior, albedo, emission, hasColours, hasTexture },
  { headroom, exposure, numbers },
) {
  const name = `materials[${index}]`;
  const one = 2 ** numbers.lightFraction;
  const white = 2 ** numbers.colourBits - 1;
  const rgb = (part, colour) =>
    Object.fromEntries(
      [..."rgb"].map((channel, i) => [`${name}.${part}.${channel}`, Math.min(white, Math.round(colour[i] * white))]),
    );
  const registers = {
    ...rgb(
      "albedo",
      albedo.map((value) => value / (kind === "diffuse" ? headroom : 1)),
    ),
    ...rgb(
      "emission",
      emission.map((value) => (kind === "diffuse" || kind === "metal" ? value * exposure : 0)),
    ),
    [`${name}.hasCornerColours`]: Number(hasColours),
    [`${name}.hasTexture`]: Number(hasTexture),
    [`${name}.kind`]: ["diffuse", "mirror", "glass", "metal"].indexOf(kind),
    [`${name}.lobe.alpha`]: kind === "diffuse" ? 0 : Math.min(Math.round(1024 * roughness ** 2), 255),
  };
  if (kind === "metal") {
    const alpha = Math.min(Math.max(Math.round(2 ** 8 * roughness ** 2), 1), 255) / 2 ** 8;
    registers[`${name}.lobe.alpha`] = 2 ** 8 * alpha;
    registers[`${name}.lobe.slope`] = Math.round((2 ** 6 * (1 - alpha ** 2)) / (2 * alpha ** 2));
    registers[`${name}.lobe.peak`] = Math.round(-256 * Math.log2(alpha));
  }
  if (kind === "glass") {
    registers[`${name}.etaFront`] = Math.round(2 ** numbers.etaFraction / ior);
    registers[`${name}.etaBack`] = Math.round(2 ** numbers.etaFraction * ior);
    registers[`${name}.reflectance`] = Math.round(((ior - 1) / (ior + 1)) ** 2 * one);
  }
  return registers;
}

/** The entries of the material table: those of the file, or the one that the controls set. */
function entriesOf(scene, room) {
  const { state, mesh, packed } = scene;
  if (packed.entries) return packed.entries;
  const kind = materialOf(scene, room);
  const share = kind === "metal" ? microfacetAlbedo(ROUGHNESS) : 1;
  const albedo = colourOf(state.colour).map((value) => value * share);
  return [
    {
      kind,
      albedo,
      roughness: kind === "metal" ? ROUGHNESS : 0,
      ior: GLASS,
      emission: [0, 0, 0],
      hasColours: mesh.hasColours && kind === "diffuse",
      hasTexture: false,
    },
  ];
}

/** The registers that the mesh and the controls set. */
function registersOf(scene, room, threshold) {
  const { state, manifest, packed } = scene;
  const { numbers, config } = manifest;
  const white = 2 ** numbers.colourBits - 1;
  const frame = { headroom: room?.headroom ?? 1, exposure: room?.light?.exposure ?? 1, numbers };
  const rgb = (name, colour) =>
    Object.fromEntries([..."rgb"].map((channel, i) => [`${name}.${channel}`, Math.round(colour[i] * white)]));
  const registers = {
    ...(room ? {} : rgb("background", colourOf(state.background))),
    ...(room?.encoded ? roomRegisters(room, manifest) : {}),
    ...tableRegisters(entriesOf(scene, room), frame, threshold),
    "bounds.low.x": packed.lowX,
    "bounds.low.y": packed.lowY,
    "bounds.low.z": packed.lowZ,
    "bounds.high.x": packed.highX,
    "bounds.high.y": packed.highY,
    "bounds.high.z": packed.highZ,
    "scene.recordCount": packed.recordCount,
    "scene.root": 0,
    "scene.hasColours": packed.hasColours,
    "shading.offset": packed.shadingOffset,
    "shading.shadows": state.shadows,
    "shading.bounces": Math.min(state.bounces, config.frame.maxBounces),
    "gather.bounces": Number(gathers(scene, room)),
    "frame.watchdogCycles": 0,
  };
  return registers;
}

/** The object's pose in the room, turned by the orbit. */
export function poseIn({ manifest, packed }, room, orbit) {
  return room
    ? poseOf(room, orbit.azimuth - START.azimuth, packed.lowY / (2 ** manifest.config.geometry.vertexBits - 1))
    : CUBE;
}

/**
 * A frame in a room, or without one. In a room an orbit turns the object, and moves the camera from that of the maps.
 * `sample`: index and count of a pass; `samples`: by the number of passes, for each the points of lights' discs, and by
 * the number of lights the threshold of coverage.
 */
export function viewOf(scene, room, width, height, orbit, sample = null, samples = {}) {
  const { discs, coverage } = sample ? samples[sample.count] : {};
  const threshold = coverage?.[room ? room.light.lamps.length : 1][sample.index];
  const registers = registersOf(scene, room, threshold ?? null);
  const points = discs?.[sample.index] ?? [];
  if (room) {
    const inPhoto = Boolean(scene.state.photo) && isAtMaps(orbit);
    // Where there is no photo, the room is the device's
    const window = inPhoto
      ? {}
      : {
          "environment.window.x0": 0,
          "environment.window.y0": 0,
          "environment.window.x1": width,
          "environment.window.y1": height,
        };
    return {
      file: String(room.height / height),
      camera: roomCamera(room, width, height, orbit),
      object: poseIn(scene, room, orbit),
      lights: room.light.lamps.map((lamp, index) => ({
        ...lamp,
        position: onDisc(lamp, room.object.position, points[index]),
      })),
      registers: { ...registers, ...window },
      sample,
      time: scene.time,
      exposure: room.light.exposure,
      inPhoto,
    };
  }
  const light = {
    position: lightOf(cameraOf(START, width, height), LIGHT),
    colour: [0.9, 0.9, 0.9].map((value) => value * scene.state.light),
  };
  return {
    file: "plain",
    camera: cameraOf(orbit, width, height),
    lights: [light],
    registers,
    sample,
    time: scene.time,
    exposure: 1,
  };
}
