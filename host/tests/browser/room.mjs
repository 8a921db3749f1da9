// Encodes a room in WebAssembly, and derives normals, as the page does: node room.mjs FOLDER, which has job.json, the
// codes of the maps and a depth map. It writes the memories, what the encoder returns beside them, the normals, and the
// depth of a part of a photo.

import { readFileSync, writeFileSync } from "node:fs";
import { cropOf, fillHoles, readDepth } from "../../../site/depth.js";
import { encodeStill, sizesOf } from "../../../site/encoder.js";
import { Library } from "../../../site/library.js";

const folder = process.argv[2];
const bytes = (name) => Uint8Array.from(readFileSync(`${folder}/${name}`));
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
const codes = {
  ...job.codes,
  albedo: bytes("albedo.bin"),
  normals: bytes("normals.bin"),
  depth: new Uint32Array(bytes("depth.bin").buffer),
};
const { maps, tiles, ...rest } = encodeStill(library.wasm, job.manifest, codes);
for (const { memory, words } of maps) writeFileSync(`${folder}/${memory}`, words);
for (const [name, values] of Object.entries(tiles))
  writeFileSync(`${folder}/tiles.${name}`, new Uint8Array(values.buffer));

const slic = structuredClone(job.manifest);
slic.config.physicalAttributeMemory.encoding = "slic";
const refusal = (() => {
  try {
    return sizesOf(slic);
  } catch (error) {
    return error.message;
  }
})();

const depth = await readDepth("depth.png", bytes("depth.png"), job.step);
const part = cropOf(job.photo, ...job.part);
writeFileSync(`${folder}/part.bin`, new Uint8Array(library.fittedDepth(depth, job.photo, part, ...job.part).buffer));
const { width, height, values } = depth;
const { holes, count } = fillHoles(library, values, width);
const { normals, noise } = library.normals(values, holes, job.lens, width, height);
writeFileSync(`${folder}/derived.bin`, new Uint8Array(normals.buffer));
writeFileSync(`${folder}/result.json`, JSON.stringify({ ...rest, count, noise, refusal }));
