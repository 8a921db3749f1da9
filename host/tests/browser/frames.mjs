// Packs a mesh and renders frames in WebAssembly: node frames.mjs FOLDER, which has job.json and the mesh's arrays.
// It writes records.bin, and colours, triangles and counters of the frame, by the RTL too if the job names its module.

import { readFileSync, writeFileSync } from "node:fs";
import { Library, plainSurface } from "../../../site/library.js";
import { renderRtl } from "../../../site/rtl.js";

const folder = process.argv[2];
const read = (name, Array) => new Array(Uint8Array.from(readFileSync(`${folder}/${name}`)).buffer);
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
library.open(job.manifest);
const mesh = {
  vertices: read("vertices.bin", Float64Array),
  faces: read("faces.bin", Int32Array),
  normals: read("normals.bin", Float64Array),
};
const packed = library.pack(mesh, {
  surfaces: [plainSurface(mesh, job.isGlass)],
  surfaceOf: new Int32Array(mesh.faces.length / 3),
});
writeFileSync(`${folder}/records.bin`, library.records(packed));
writeFileSync(`${folder}/packed.json`, JSON.stringify(packed));
const { writes, width, height } = job.frame;
library.start(writes);
write("model", { ...library.rows(0, height, width), counters: library.counters() });
if (job.rtl)
  write(
    "rtl",
    await renderRtl(
      readFileSync(job.rtl),
      job.manifest,
      { records: library.records(packed), writes, width, height },
      () => {},
    ),
  );

function write(name, { colours, triangles, counters }) {
  writeFileSync(`${folder}/${name}-colours.bin`, new Uint8Array(colours.buffer));
  writeFileSync(`${folder}/${name}-triangles.bin`, new Uint8Array(triangles.buffer));
  writeFileSync(`${folder}/${name}-counters.json`, JSON.stringify(counters));
}
