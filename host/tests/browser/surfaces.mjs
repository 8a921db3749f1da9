// Reads and packs a glTF file with its materials, as the page does: node surfaces.mjs FOLDER, which has job.json and
// the file. The first time it writes the pictures of textures, picture-N; then it reads them decoded, N.bin, and writes
// records.bin, clip.bin, the memories of textures, entries.json, of the material table and with the kinds of faces, and
// the colours of the job's frame.

import { readFileSync, writeFileSync } from "node:fs";
import { prepared } from "../../../site/coverage.js";
import { registerWrites } from "../../../site/design.js";
import { Library } from "../../../site/library.js";
import { readMesh } from "../../../site/meshes.js";
import { surfacesOf } from "../../../site/surfaces.js";
import { tableRegisters } from "../../../site/view.js";

const folder = process.argv[2];
const read = (name) => Uint8Array.from(readFileSync(name));
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
library.open(job.manifest);
let number = -1;
const decode = async (bytes) => {
  ++number;
  if (!job.pictures) return void writeFileSync(`${folder}/picture-${number}`, bytes);
  const { width, height, hasAlpha } = job.pictures[number];
  const rgba = read(`${folder}/${number}.bin`);
  const channels = (first, count) =>
    Uint8Array.from(
      { length: count * width * height },
      (_, i) => rgba[4 * Math.floor(i / count) + first + (i % count)],
    );
  return { width, height, pixels: channels(0, 3), alpha: hasAlpha ? channels(3, 1) : null };
};
const files = new Map(job.files.map((name) => [name, read(`${job.beside}/${name}`)]));
const found = await readMesh(library, job.file, read(job.path), files, job.animation ?? null, decode);
if (job.pictures) render(prepared(library, found));

function render(mesh) {
  const surfaces = surfacesOf(library, mesh, job);
  const packed = library.pack(mesh, surfaces);
  writeFileSync(`${folder}/records.bin`, library.records(packed));
  writeFileSync(`${folder}/clip.bin`, library.clipFile());
  for (const { memory, words } of library.textureMemories()) writeFileSync(`${folder}/${memory}`, words);
  writeFileSync(
    `${folder}/entries.json`,
    JSON.stringify({
      entries: surfaces.entries,
      kinds: [...mesh.materialOf].map((number) => mesh.materials[number].kind),
      packed,
      notes: [...mesh.notes, ...surfaces.notes],
    }),
  );
  if (!job.frame) return;
  const { writes, width, height, threshold } = job.frame;
  const frame = { headroom: job.headroom, exposure: 1, numbers: job.manifest.numbers };
  const of = {
    "scene.recordCount": packed.recordCount,
    "scene.hasColours": packed.hasColours,
    "shading.offset": packed.shadingOffset,
  };
  library.start([
    ...writes,
    ...registerWrites(job.manifest, { ...tableRegisters(surfaces.entries, frame, threshold), ...of }),
  ]);
  const { colours, triangles } = library.rows(0, height, width);
  writeFileSync(`${folder}/colours.bin`, new Uint8Array(colours.buffer));
  writeFileSync(`${folder}/triangles.bin`, new Uint8Array(triangles.buffer));
}
