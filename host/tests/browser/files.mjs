// Reads and packs mesh files with their materials, as the page does: node files.mjs FOLDER, which has job.json: of each
// file its path and the folder of the files beside it. It writes result.json: of each the refusal, or digests of its
// records and texture memories, and notes of the file. A picture, named by its digest, is written there until it is
// there decoded, as KEY.json and KEY.bin.

import { createHash } from "node:crypto";
import { existsSync, readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { prepared } from "../../../site/coverage.js";
import { Library, plainSurface } from "../../../site/library.js";
import { readMesh } from "../../../site/meshes.js";
import { surfacesOf } from "../../../site/surfaces.js";

const folder = process.argv[2];
const read = (name) => Uint8Array.from(readFileSync(name));
const digest = (bytes) => createHash("sha256").update(bytes).digest("hex");
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const open = async () => {
  const found = await Library.from(readFileSync(job.module));
  found.open(job.manifest);
  return found;
};
let library = await open();

async function decode(bytes) {
  const key = `${folder}/${digest(bytes)}`;
  if (!existsSync(`${key}.json`)) {
    writeFileSync(`${key}.picture`, bytes);
    return null;
  }
  const { width, height, hasAlpha } = JSON.parse(readFileSync(`${key}.json`, "utf8"));
  if (!width) throw new Error("no picture");
  const rgba = read(`${key}.bin`);
  const channels = (first, count) =>
    Uint8Array.from(
      { length: count * width * height },
      (_, i) => rgba[4 * Math.floor(i / count) + first + (i % count)],
    );
  return { width, height, pixels: channels(0, 3), alpha: hasAlpha ? channels(3, 1) : null };
}

/** The files beside a mesh, also of folders, that it may name. */
function beside(path, found = new Map()) {
  for (const name of readdirSync(path)) {
    const own = `${path}/${name}`;
    if (statSync(own).isDirectory()) beside(own, found);
    else if (/\.(mtl|png|jpe?g|webp|tga)$/i.test(name)) found.set(name, read(own));
  }
  return found;
}

async function pack({ path, folder: place }) {
  const found = await readMesh(
    library,
    path.split("/").pop(),
    read(path),
    place ? beside(place) : new Map(),
    null,
    decode,
  );
  const mesh = prepared(library, found);
  const plain = { surfaces: [plainSurface(mesh)], surfaceOf: new Int32Array(mesh.faces.length / 3) };
  const surfaces = mesh.materials
    ? surfacesOf(library, mesh, { manifest: job.manifest, gathers: false, headroom: 1 })
    : plain;
  const packed = library.pack(mesh, surfaces);
  const memories = Object.fromEntries(library.textureMemories().map(({ memory, words }) => [memory, digest(words)]));
  return { records: digest(library.records(packed)), memories, triangles: found.faces.length / 3, notes: mesh.notes };
}

const result = {};
for (const file of job.files) {
  try {
    result[file.path] = await pack(file);
  } catch (error) {
    result[file.path] = { error: error.message };
    if (error instanceof WebAssembly.RuntimeError) library = await open();
  }
}
writeFileSync(`${folder}/result.json`, JSON.stringify(result));
