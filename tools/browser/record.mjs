// The registers of frames of one pixel of the page's first view, for a design: node record.mjs JOB, whose arrays and
// module are files. It prints a list of pairs of word address and value for each pixel.

import { readFileSync } from "node:fs";
import { START } from "../../site/camera.js";
import { Library } from "../../site/library.js";
import { ofPixel } from "../../site/recording.js";
import { DEFAULTS } from "../../site/state.js";
import { viewOf } from "../../site/view.js";

const job = JSON.parse(readFileSync(process.argv[2], "utf8"));
const read = (name, Array) => new Array(Uint8Array.from(readFileSync(name)).buffer);
const { width, height, manifest } = job;
const library = await Library.from(readFileSync(job.module));
library.open(manifest);
const packed = library.pack({ vertices: read(job.vertices, Float64Array), faces: read(job.faces, Int32Array) });
const scene = {
  state: { ...DEFAULTS, design: job.design },
  mesh: { hasColours: false },
  manifest,
  packed: { ...packed, entries: null, notes: [] },
};
library.openView(new Uint8Array(readFileSync(job.view)));
const frames = job.pixels.map(([x, y]) => {
  const { camera, lights, registers } = ofPixel(viewOf(scene, null, width, height, START), { x, y, width, height });
  library.setCamera(camera);
  lights.forEach((light, index) => library.setLight(index, light));
  return library.frame(registers);
});
process.stdout.write(JSON.stringify(frames));
