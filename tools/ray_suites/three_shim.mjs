// three-mesh-bvh whose ray casts the library of rays answers. It finds the faces that a ray meets; distance, point and
// uv of a face are of three-mesh-bvh's own `intersectTri`.
import koffi from "koffi";
import * as bvh from "bvh-source";
import { intersectTri } from "bvh-source/src/utils/ThreeRayIntersectUtilities.js";

const library = koffi.load(process.env.COLONNADE_RAYS_LIBRARY);
const declared = (text) => library.func(text);
const open = declared("int colonnade_rays_open_environment(_Out_ void **device)");
const error = declared("const char *colonnade_rays_error(void *device)");
const newScene = declared("int colonnade_rays_scene_new(void *device, _Out_ void **scene)");
const add = declared(
  "int colonnade_rays_mesh_add(void *scene, const double *v, size_t nv, const uint32_t *f, " +
    "size_t nf, _Out_ uint32_t *mesh)",
);
const commit = declared("int colonnade_rays_commit(void *scene)");
const all = declared(
  "int colonnade_rays_all(void *scene, const double *rays, size_t count, uint32_t mode, uint32_t mask, " +
    "size_t most, void *hits, size_t capacity, _Out_ size_t *found)",
);

const HIT_BYTES = 40,
  FACE_OFFSET = 28,
  ALL_MASKS = 0xffffffff,
  CAPACITY = 4096;
export const counts = { rays: 0, faces: 0 };
const opened = [null];
if (open(opened)) throw new Error("the library of rays has no device");
const [device] = opened;

function checked(status) {
  if (status) throw new Error(error(device));
}

function made(call, ...inputs) {
  const out = [null];
  checked(call(...inputs, out));
  return out[0];
}

/** The scene of a tree's triangles, by the positions that they have. */
function sceneOf(tree) {
  if (tree.colonnade) return tree.colonnade;
  const { index, attributes } = tree.geometry,
    { position } = attributes,
    triangles = [];
  tree.shapecast({ intersectsBounds: () => true, intersectsTriangle: (_, i) => void triangles.push(i) });
  const vertices = new Float64Array(position.count * 3),
    faces = new Uint32Array(triangles.length * 3);
  for (let i = 0; i < position.count; i++) vertices.set([position.getX(i), position.getY(i), position.getZ(i)], 3 * i);
  triangles.forEach((triangle, i) =>
    faces.set(
      [0, 1, 2].map((k) => index.getX(3 * triangle + k)),
      3 * i,
    ),
  );
  const scene = made(newScene, device);
  made(add, scene, vertices, position.count, faces, triangles.length);
  checked(commit(scene));
  tree.colonnade = { scene, triangles };
  return tree.colonnade;
}

bvh.MeshBVH.prototype.raycast = function (ray, side, near = 0, far = Infinity) {
  const { scene, triangles } = sceneOf(this),
    { origin, direction } = ray,
    hits = new DataView(new ArrayBuffer(HIT_BYTES * CAPACITY));
  const found = [0],
    slack = 1e-6;
  const rays = new Float64Array([...origin.toArray(), Math.max(0, near - slack), ...direction.toArray(), far + slack]);
  checked(all(scene, rays, 1, 0, ALL_MASKS, CAPACITY, new Uint8Array(hits.buffer), CAPACITY, found));
  counts.rays++;
  counts.faces += Number(found[0]);
  const faces = Array.from(
    { length: Number(found[0]) },
    (_, i) => triangles[hits.getUint32(i * HIT_BYTES + FACE_OFFSET, true)],
  );
  return faces.map((face) => intersectTri(this.geometry, side, ray, face, null, near, far)).filter(Boolean);
};

bvh.MeshBVH.prototype.raycastFirst = function (...query) {
  const hits = this.raycast(...query);
  return hits.length ? hits.reduce((nearest, hit) => (hit.distance < nearest.distance ? hit : nearest)) : null;
};

export * from "bvh-source";
