// Rays through meshes of three.js with the interface of three-mesh-bvh, by the bit-exact model in WebAssembly
// (docs/rays.md).

import { Library } from "./library.js";

/** Bytes of a hit, and where its face is (driver/include/colonnade_rays.h). */
const [HIT_BYTES, FACE_BYTE] = [40, 28];
const MISS = 0xffffffff;
/** The mode of each `side` of three.js: faces seen from the front, from the back, or both. */
const SIDES = [0x200, 0x100, 0];
const ALL_MASKS = 0xffffffff;

/** The calls of colonnade_rays.h. A refusal ends the call, and its text is the error's. */
class RayLibrary extends Library {
  refusing(call) {
    const { value } = this.wasm.colonnade_refusal;
    this.bytes[value] = 0;
    try {
      return call();
    } catch (error) {
      throw new Error(this.text(value) || error.message);
    }
  }

  /** What a call writes to its last argument, a word. */
  word(inputs, call) {
    return this.withArrays([...inputs, new Uint32Array(1)], (...pointers) => {
      this.refusing(() => call(...pointers));
      return new DataView(this.wasm.memory.buffer).getUint32(pointers.at(-1), true);
    });
  }
}

/** A class as three-mesh-bvh's `MeshBVH`: code is that of rays.wasm. */
export async function meshTrees(code) {
  const library = /** @type {RayLibrary} */ (await RayLibrary.from(code)),
    { wasm } = library;
  const device = library.word([], (out) => wasm.colonnade_rays_open(0, 0, out));

  return class MeshBVH {
    /** Packs a geometry: its `position` and `index`, or three vertices a face without one. */
    constructor(geometry) {
      this.geometry = geometry;
      const {
        index,
        attributes: { position },
      } = geometry;
      const count = index ? index.count : position.count;
      const vertices = Float64Array.from({ length: 3 * position.count }, (_, i) =>
        [position.getX, position.getY, position.getZ][i % 3].call(position, Math.floor(i / 3)),
      );
      this.corners = Uint32Array.from({ length: count }, (_, i) => (index ? index.getX(i) : i));
      this.scene = library.word([], (out) => wasm.colonnade_rays_scene_new(device, out));
      try {
        library.word([vertices, this.corners], (v, f, mesh) =>
          wasm.colonnade_rays_mesh_add(this.scene, v, position.count, f, Math.floor(count / 3), mesh),
        );
        library.refusing(() => wasm.colonnade_rays_commit(this.scene));
      } catch (error) {
        this.dispose();
        throw error;
      }
    }

    /** Frees the packed geometry. */
    dispose() {
      wasm.colonnade_rays_scene_free(this.scene);
      this.scene = 0;
    }

    /** All hits from near to far; `near` and `far` are distances, a side is three's number or a material with it. */
    raycast(ray, side = 0, near = 0, far = Infinity) {
      return this.hits(ray, side, near, far, 64, (rays, mode, hits, capacity) =>
        library.word([], (found) =>
          wasm.colonnade_rays_all(this.scene, rays, 1, mode, ALL_MASKS, MISS, hits, capacity, found),
        ),
      );
    }

    /** The nearest hit, or null. */
    raycastFirst(ray, side = 0, near = 0, far = Infinity) {
      const closest = (rays, mode, hits) =>
        library.refusing(() => wasm.colonnade_rays_closest(this.scene, rays, 1, mode, ALL_MASKS, hits)) + 1;
      return this.hits(ray, side, near, far, 1, closest)[0] ?? null;
    }

    /** The hits that a call has found, whose number it returns; with more than there is room for once more. */
    hits({ origin, direction }, side, near, far, capacity, call) {
      const mode = SIDES[side.side ?? side];
      if (mode === undefined) throw new Error("the side is none of 0, 1, 2: give that of one material");
      const length = Math.hypot(direction.x, direction.y, direction.z);
      const ray = Float64Array.of(
        origin.x,
        origin.y,
        origin.z,
        near / length,
        direction.x,
        direction.y,
        direction.z,
        far / length,
      );
      for (;;) {
        const found = library.withArrays([ray, new Uint8Array(HIT_BYTES * capacity)], (rays, hits) => {
          const count = call(rays, mode, hits, capacity);
          if (count > capacity) return count;
          const view = new DataView(wasm.memory.buffer, hits, HIT_BYTES * capacity);
          const read = (i) => ({
            t: view.getFloat64(HIT_BYTES * i, true),
            u: view.getFloat64(HIT_BYTES * i + 8, true),
            v: view.getFloat64(HIT_BYTES * i + 16, true),
            face: view.getUint32(HIT_BYTES * i + FACE_BYTE, true),
          });
          return Array.from({ length: count }, (_, i) => read(i)).filter((hit) => hit.face !== MISS);
        });
        if (typeof found !== "number") return found.map((hit) => this.intersection(origin, direction, length, hit));
        capacity = found;
      }
    }

    /** A hit as three.js has it. */
    intersection(origin, direction, length, { t, u, v, face }) {
      const { position, uv } = this.geometry.attributes;
      const vector = (x, y, z) => (origin.clone ? origin.clone().set(x, y, z) : { x, y, z });
      const [a, b, c] = this.corners.subarray(3 * face, 3 * face + 3);
      const [p, q, r] = [a, b, c].map((i) => [position.getX(i), position.getY(i), position.getZ(i)]);
      const edge = (to) => to.map((value, axis) => value - p[axis]),
        [e, f] = [edge(q), edge(r)];
      const normal = [0, 1, 2].map(
        (axis) => e[(axis + 1) % 3] * f[(axis + 2) % 3] - e[(axis + 2) % 3] * f[(axis + 1) % 3],
      );
      const size = Math.hypot(...normal);
      const at = (get) => (1 - u - v) * get.call(uv, a) + u * get.call(uv, b) + v * get.call(uv, c);
      return {
        distance: t * length,
        point: vector(origin.x + t * direction.x, origin.y + t * direction.y, origin.z + t * direction.z),
        faceIndex: face,
        face: { a, b, c, normal: vector(normal[0] / size, normal[1] / size, normal[2] / size), materialIndex: 0 },
        barycoord: vector(1 - u - v, u, v),
        ...(uv && { uv: { x: at(uv.getX), y: at(uv.getY) } }),
      };
    }
  };
}
