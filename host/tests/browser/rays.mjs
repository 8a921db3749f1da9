// Casts rays of a job by out/browser/rays.js, into hits.json: node rays.mjs FOLDER
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2],
  file = (name) => readFileSync(`${folder}/${name}`);
const job = JSON.parse(file("job.json").toString());
const { MeshBVH } = await import(pathToFileURL(job.module).href);

const attribute = (values, width) => ({
  count: values.length / width,
  getX: (i) => values[width * i],
  getY: (i) => values[width * i + 1],
  getZ: (i) => values[width * i + 2],
});
const vector = (values) => ({ x: values[0], y: values[1], z: values[2] });
const floats = new Float64Array(new Uint8Array(file("vertices.bin")).buffer),
  rays = new Float64Array(new Uint8Array(file("rays.bin")).buffer);
const faces = new Uint32Array(new Uint8Array(file("faces.bin")).buffer);
const tree = new MeshBVH({
  attributes: { position: attribute(floats, 3), uv: attribute(floats, 3) },
  index: attribute(faces, 1),
});

const found = job.sides.map((side) =>
  Array.from({ length: rays.length / 8 }, (_, i) => {
    const [x, y, z, near, dx, dy, dz, far] = rays.subarray(8 * i, 8 * i + 8);
    const query = [{ origin: vector([x, y, z]), direction: vector([dx, dy, dz]) }, side, near, far];
    return { all: tree.raycast(...query), first: tree.raycastFirst(...query) };
  }),
);
const refusals = [];
for (const run of [
  () => new MeshBVH({ attributes: { position: attribute(floats, 3) }, index: attribute(Uint32Array.of(0, 1, 1e6), 1) }),
  () => tree.raycastFirst({ origin: vector([0, 0, 0]), direction: vector([0, 0, 1]) }, [{ side: 0 }]),
])
  try {
    run();
  } catch (error) {
    refusals.push(error.message);
  }
// After a refusal the others go on
const again = tree.raycastFirst(
  { origin: vector(rays.subarray(0, 3)), direction: vector(rays.subarray(4, 7)) },
  { side: 2 },
);
tree.dispose();
writeFileSync(`${folder}/hits.json`, JSON.stringify({ found, refusals, again }));
