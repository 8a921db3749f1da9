// Reads and packs glTF files with an animation, as the page does: node clips.mjs FOLDER, which has job.json and the
// files. It writes result.json: of each file the error, or its animations, the one that moves it, notes and duration;
// of one that was read its records, clip file, and records at the job's times, 2^-16 s, NAME.rest, NAME.clip and
// NAME.TIME.

import { readFileSync, writeFileSync } from "node:fs";
import { prepared } from "../../../site/coverage.js";
import { Library } from "../../../site/library.js";
import { readMesh } from "../../../site/meshes.js";
import { surfacesOf } from "../../../site/surfaces.js";

const folder = process.argv[2];
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const { manifest } = job;
const [library, other] = await Promise.all([1, 2].map(() => Library.from(readFileSync(job.module))));
for (const each of [library, other]) each.open(manifest);
const result = {};
for (const name of job.files) {
  try {
    const mesh = prepared(
      library,
      await readMesh(library, name, Uint8Array.from(readFileSync(`${folder}/${name}`)), new Map(), job.animation),
    );
    const packed = library.pack(mesh, surfacesOf(library, mesh, { manifest, gathers: false, headroom: 1 }));
    const [rest, clip] = [library.records(packed), library.clipFile()];
    writeFileSync(`${folder}/${name}.rest`, rest);
    writeFileSync(`${folder}/${name}.clip`, clip);
    other.load(rest, clip);
    for (const time of job.times) {
      const flat = [library, other].map((each) => each.pose(time));
      const [own, loaded] = [library, other].map((each) => each.records(packed));
      if (flat[0] !== flat[1] || Buffer.compare(own, loaded) !== 0)
        throw new Error("a worker that loads the records poses them otherwise");
      writeFileSync(`${folder}/${name}.${time}`, own);
    }
    result[name] = { animations: mesh.animations, animation: mesh.animation, notes: mesh.notes, packed };
  } catch (error) {
    result[name] = { error: error.message };
  }
}
writeFileSync(`${folder}/result.json`, JSON.stringify(result));
