// SPDX-License-Identifier: Apache-2.0
// Packs a mesh and renders frames in WebAssembly: node frames.mjs FOLDER, which has job.json and the mesh's arrays.
// It writes records.bin, and colours and triangles of each frame.

import { readFileSync, writeFileSync } from "node:fs";
import { Library } from "../../../site/library.js";

const folder = process.argv[2];
const read = (name, Array) => new Array(Uint8Array.from(readFileSync(`${folder}/${name}`)).buffer);
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
library.open(job.manifest);
const packed = library.pack(
  { vertices: read("vertices.bin", Float64Array), faces: read("faces.bin", Int32Array), normals: read("normals.bin", Float64Array) },
  job.isGlass,
);
writeFileSync(`${folder}/records.bin`, library.records(packed));
writeFileSync(`${folder}/packed.json`, JSON.stringify(packed));
job.frames.forEach(({ writes, width, height }, index) => {
  library.start(writes);
  const { colours, triangles } = library.rows(0, height, width);
  writeFileSync(`${folder}/colours${index}.bin`, new Uint8Array(colours.buffer));
  writeFileSync(`${folder}/triangles${index}.bin`, new Uint8Array(triangles.buffer));
  writeFileSync(`${folder}/counters${index}.json`, JSON.stringify(library.counters()));
});
