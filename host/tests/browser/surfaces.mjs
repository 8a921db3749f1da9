// Reads and packs a glTF file with its materials, as the page does: node surfaces.mjs FOLDER, which has job.json, the file and the
// decoded pictures. It writes records.bin, the memories of textures, and entries.json, of the material table.

import { readFileSync, writeFileSync } from "node:fs";
import { Library } from "../../../site/library.js";
import { readMesh } from "../../../site/meshes.js";
import { decodePictures, surfacesOf } from "../../../site/surfaces.js";

const folder = process.argv[2];
const read = (name) => Uint8Array.from(readFileSync(`${folder}/${name}`));
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
library.open(job.manifest);
const mesh = readMesh(job.file, read(job.file));
const pictures = job.pictures.map(({ name, width, height }) => ({ width, height, pixels: read(name) }));
await decodePictures(mesh, async () => pictures.shift());
const surfaces = surfacesOf(library, mesh, job);
const packed = library.pack(mesh, surfaces);
writeFileSync(`${folder}/records.bin`, library.records(packed));
for (const { memory, words } of library.textureMemories()) writeFileSync(`${folder}/${memory}`, words);
writeFileSync(`${folder}/entries.json`, JSON.stringify({ entries: surfaces.entries, notes: [...mesh.notes, ...surfaces.notes] }));
