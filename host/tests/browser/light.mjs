// Sums of passes and the light cube, as the page makes them: node light.mjs FOLDER, which has job.json. It writes the
// words of the cube, and what sums show with a photo and without one.

import { readFileSync, writeFileSync } from "node:fs";
import { Library } from "../../../site/library.js";
import { Sums } from "../../../site/sums.js";

const folder = process.argv[2];
const read = (name) => Uint8Array.from(readFileSync(`${folder}/${name}`));
const job = JSON.parse(readFileSync(`${folder}/job.json`, "utf8"));
const library = await Library.from(readFileSync(job.module));
const numbers = (name) => new Float64Array(read(name).buffer);
const { radiance, share } = library.lightAt(
  { points: numbers("points.bin"), normals: numbers("normals.bin"), colours: numbers("colours.bin") },
  job.point,
);
writeFileSync(`${folder}/radiance.bin`, new Uint8Array(radiance.buffer));
writeFileSync(`${folder}/result.json`, JSON.stringify({ share }));
writeFileSync(`${folder}/words.bin`, library.cubeWords(library.radianceOf(read("fine.bin")), job.rotation));
for (const photo of [null, read("photo.bin")]) {
  const sums = new Sums(job.pixels, job.white, photo);
  for (const pass of job.passes) {
    ++sums.samples;
    sums.add(pass, 0);
  }
  writeFileSync(`${folder}/${photo ? "over" : "plain"}.bin`, sums.shown(0, job.pixels));
}
