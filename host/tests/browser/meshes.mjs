// Reads and packs mesh files, as the page does: node meshes.mjs FOLDER, which has job.json and the files. It writes
// result.json: of each file the error, or the corners of its triangles, one after the other, with normals and colours.

import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { Library } from "../../../site/library.js";
import { readMesh } from "../../../site/meshes.js";

const folder = process.argv[2];
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
library.open(job.manifest);
const result = {};
for (const name of readdirSync(folder).filter((each) => each !== "job.json")) {
  try {
    const mesh = await readMesh(library, name, Uint8Array.from(readFileSync(`${folder}/${name}`)), new Map(), null);
    library.pack(mesh);
    const corners = [...mesh.faces].flatMap((vertex) => [...mesh.vertices.subarray(3 * vertex, 3 * vertex + 3)]);
    result[name] = { corners, normals: mesh.normals && [...mesh.normals], colours: mesh.colours && [...mesh.colours] };
  } catch (error) {
    result[name] = { error: error.message };
  }
}
writeFileSync(`${folder}/result.json`, JSON.stringify(result));
