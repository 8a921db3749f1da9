// SPDX-License-Identifier: Apache-2.0
// Views: what a frame of the state is, from the open mesh and its packed form for a design. `scene` has state, mesh,
// manifest and packed.

import { CUBE, START, cameraOf, isAtMaps, lightOf, poseOf, roomCamera } from "./camera.js";
import { decode } from "./photo.js";
import { roomRegisters } from "./roomview.js";

const LIGHT = [1.2, 1.6, 1.5];
const GLASS = 1.5;

const colourOf = (hex) => [0, 2, 4].map((at) => decode(parseInt(hex.slice(at, at + 2), 16)));

/** The material that the design has of the one that is chosen. */
export const materialOf = ({ state, manifest }) => (manifest.config.frame.maxBounces > 0 ? state.material : "diffuse");

/** The registers that the mesh and the controls set. */
function registersOf(scene, room) {
  const { state, mesh, manifest, packed } = scene;
  const { numbers, config } = manifest;
  const material = materialOf(scene);
  const white = 2 ** numbers.colourBits - 1;
  const one = 2 ** numbers.lightFraction;
  const rgb = (name, colour) => Object.fromEntries([..."rgb"].map((channel, i) => [`${name}.${channel}`, Math.round(colour[i] * white)]));
  const registers = {
    ...(room ? {} : rgb("background", colourOf(state.background))),
    ...(room?.encoded ? roomRegisters(room, manifest) : {}),
    ...rgb("materials[0].albedo", colourOf(state.colour).map((value) => value / (material === "diffuse" ? (room?.headroom ?? 1) : 1))),
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
    "materials[0].kind": ["diffuse", "mirror", "glass"].indexOf(material),
    "frame.watchdogCycles": 0,
  };
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

/** A frame in a room, or without one. In a room an orbit turns the object, and moves the camera from that of the maps. */
export function viewOf(scene, room, width, height, orbit) {
  const registers = registersOf(scene, room);
  if (room)
    return {
      file: String(room.height / height),
      camera: roomCamera(room, width, height, orbit),
      object: poseIn(scene, room, orbit),
      lights: [],
      registers,
      inPhoto: Boolean(scene.state.photo) && isAtMaps(orbit),
    };
  const light = { position: lightOf(cameraOf(START, width, height), LIGHT), colour: [0.9, 0.9, 0.9].map((value) => value * scene.state.light) };
  return { file: "plain", camera: cameraOf(orbit, width, height), lights: [light], registers };
}
