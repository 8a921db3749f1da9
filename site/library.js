// The packer, the model and colonnade_view in WebAssembly (host/cpp/library, driver/src).

import { designLines, hashWords, registerWrites } from "./design.js";

const PACKED = [
  "triangles",
  "recordCount",
  "nodes",
  "leaves",
  "hasColours",
  "lowX",
  "lowY",
  "lowZ",
  "highX",
  "highY",
  "highZ",
  "shadingOffset",
  "treeDepth",
  "stackBound",
  "dropped",
  "flipped",
  "replaced",
  "reversed",
  "smoothed",
  "duration",
];
/** Those of the register map that do not depend on time. */
const COUNTERS = [
  "raysPrimary",
  "raysShadow",
  "raysReflection",
  "raysRefraction",
  "raysGather",
  "raysInBox",
  "nodeReads",
  "boxTests",
  "triangleTests",
  "hits",
  "deepestStack",
];
const VIEW_ERRORS = {
  20: "no view file",
  21: "bad pose",
  22: "bad lens",
  23: "the camera is too far away",
  24: "no such light",
};
const STEP_BYTES = 88;
/** Of light cubes: the device's, and numbers of one with 32 × 32 texels a face. */
const [CUBE_BYTES, FINE_VALUES] = [4 * 6 * 16 ** 2, 3 * 6 * 32 ** 2];
/** A point is at least so far inside the box around a room, metres. */
const INSIDE = 0.1;
const FRACTION = 2 ** 32;

/** A surface with the colours of the mesh, and a texture that no surface has. */
export const plainSurface = (mesh, isGlass = false, factor = 1) => ({
  entry: 0,
  isGlass,
  texture: -1,
  hasColours: Boolean(mesh.colours),
  factor: Array(3).fill(factor),
});
const BLANK = { pixels: new Uint8Array(3), width: 1, height: 1, wrapU: 0, wrapV: 0, isNearest: 0 };

/** The words of a colonnade_texture with its pixels at an address. */
const textureWords = ({ width, height, wrapU, wrapV, isNearest }, pixels) => [
  pixels,
  width,
  height,
  wrapU,
  wrapV,
  isNearest,
];

/** The bytes of colonnade_surface. */
function surfaceBytes(surfaces) {
  const view = new DataView(new ArrayBuffer(40 * surfaces.length));
  surfaces.forEach(({ entry, isGlass, texture, hasColours, factor }, i) => {
    [entry, Number(isGlass), texture, Number(hasColours)].forEach((value, at) =>
      view.setInt32(40 * i + 4 * at, value, true),
    );
    factor.forEach((value, at) => view.setFloat64(40 * i + 16 + 8 * at, value, true));
  });
  return new Uint8Array(view.buffer);
}

/** The bytes of colonnade_normal_map. */
function mapBytes(maps) {
  const view = new DataView(new ArrayBuffer(8 * maps.length));
  maps.forEach(({ texture, scale }, i) => {
    view.setInt32(8 * i, texture, true);
    view.setFloat32(8 * i + 4, scale, true);
  });
  return new Uint8Array(view.buffer);
}

/** What a module of WASI needs that writes nowhere and reads nothing. */
export function wasi() {
  const functions = {};
  return new Proxy(functions, {
    get:
      (_, name) =>
      (...args) => {
        if (name === "proc_exit") throw new Error(`the model stopped with status ${args[0]}`);
        return 52; // not supported
      },
  });
}

/** Instantiates a module: a WebAssembly.Module, or its bytes. @returns {Promise<any>} its exports */
export async function instantiate(code) {
  const module = code instanceof WebAssembly.Module ? code : await WebAssembly.compile(code);
  const imports = /** @type {any} */ ({});
  for (const { module: from, name } of WebAssembly.Module.imports(module)) (imports[from] ??= {})[name] = wasi()[name];
  const instance = await WebAssembly.instantiate(module, imports);
  const exports = /** @type {any} */ (instance.exports);
  exports._initialize?.();
  return exports;
}

/** A design, a mesh packed for it, and frames of it. Errors are thrown, with a text for the visitor. */
export class Library {
  constructor(exports) {
    this.wasm = exports;
    this.view = 0;
  }

  static async from(code) {
    return new this(await instantiate(code));
  }

  get bytes() {
    return new Uint8Array(this.wasm.memory.buffer);
  }

  text(pointer) {
    const end = this.bytes.indexOf(0, pointer);
    return new TextDecoder().decode(this.bytes.slice(pointer, end));
  }

  /** `mesh`: what an error about the mesh is of, `animation` its name. */
  check(pointer, mesh = "the mesh", animation = "") {
    if (pointer !== 0)
      throw new Error(
        this.text(pointer).replace(/^the mesh(: its animation)?/, (_, its) =>
          its ? `${mesh}${its} ${animation}` : mesh,
        ),
      );
  }

  /** Calls `use` with the addresses of copies of typed arrays; 0 for null. */
  withArrays(arrays, use) {
    const pointers = arrays.map((array) => {
      if (array === null) return 0;
      const pointer = this.wasm.malloc(Math.max(8, array.byteLength));
      if (pointer === 0) throw new Error("the page is out of memory");
      this.bytes.set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), pointer);
      return pointer;
    });
    try {
      return use(...pointers);
    } finally {
      for (const pointer of pointers) if (pointer !== 0) this.wasm.free(pointer);
    }
  }

  /** Opens a design by its manifest. */
  open(manifest) {
    this.manifest = manifest;
    this.withArrays([new TextEncoder().encode(designLines(manifest) + "\0")], (lines) =>
      this.check(this.wasm.colonnade_model_open(lines)),
    );
  }

  /**
   * Packs a mesh: vertices and normals are Float64Array, faces Int32Array; the model has it then. After an error it has
   * the mesh before. `surfaces` and `surfaceOf`, of each face, are those of surfacesOf (surfaces.js).
   */
  pack(
    mesh,
    { surfaces, surfaceOf } = { surfaces: [plainSurface(mesh)], surfaceOf: new Int32Array(mesh.faces.length / 3) },
  ) {
    const {
      name,
      vertices,
      faces,
      normals = null,
      colours = null,
      uvs = null,
      textures = [],
      relief = null,
      clip = null,
      parts = null,
    } = mesh;
    const used = textures.map((texture) => (texture.pixels ? texture : BLANK));
    const reliefs = [
      relief && mapBytes(relief.maps),
      relief?.mapOf ?? null,
      relief?.uvs ?? null,
      relief?.tangents ?? null,
      parts?.faces ?? null,
      parts?.owners ?? null,
      parts?.weights ?? null,
    ];
    return this.withArrays(
      [
        vertices,
        faces,
        normals,
        colours,
        uvs,
        surfaceOf,
        surfaceBytes(surfaces),
        new Int32Array(PACKED.length),
        ...reliefs,
        ...used.map(({ pixels }) => pixels),
      ],
      (v, f, n, c, u, of, s, out, maps, mapOf, mapUvs, tangents, whole, owners, weights, ...pixels) =>
        this.withArrays([Int32Array.from(used.flatMap((texture, i) => textureWords(texture, pixels[i])))], (t) => {
          const given = (moved) =>
            Uint32Array.of(
              v,
              vertices.length / 3,
              f,
              faces.length / 3,
              n,
              c,
              u,
              of,
              s,
              t,
              used.length,
              maps,
              relief?.maps.length ?? 0,
              mapOf,
              mapUvs,
              tangents,
              moved,
              whole,
              owners,
              weights,
            );
          this.withClip(clip, (moved) =>
            this.withArrays([given(moved)], (pointer) =>
              this.check(this.wasm.colonnade_model_pack(pointer, out), name && `mesh ${name}`, clip?.name),
            ),
          );
          const values = new Int32Array(this.wasm.memory.buffer, out, PACKED.length);
          return Object.fromEntries(PACKED.map((name, index) => [name, values[index]]));
        }),
    );
  }

  /** Calls `use` with the address of a clip (gltfclip.js); 0 for null. */
  withClip(clip, use) {
    if (!clip) return use(0);
    const { nodes, tracks, bones, vertices, targets, changes } = clip;
    const groups = [nodes, bones, vertices, targets, changes];
    return this.withArrays(
      [...groups.flat(), ...tracks.flatMap(({ times, values }) => [times, values])],
      (...pointers) => {
        const words = tracks.flatMap(({ node, path, interpolation, times, values }, i) => [
          node,
          path,
          interpolation,
          times.length,
          values.length,
          ...pointers.slice(groups.flat().length + 2 * i).slice(0, 2),
        ]);
        return this.withArrays([Int32Array.from(words)], (ofTracks) => {
          const taken = (group) => pointers.splice(0, group.length);
          const counts = [
            nodes[0].length,
            bones[0].length,
            vertices[1].length / 4,
            targets[0].length,
            changes[0].length,
          ];
          const [ofNodes, ...others] = groups.map((group, i) => [counts[i], ...taken(group)]);
          return this.withArrays([Uint32Array.of(...ofNodes, tracks.length, ofTracks, ...others.flat())], use);
        });
      },
    );
  }

  /**
   * The vertices of a mesh in the rest pose of its clip, the normals of its corners there, or null, and which faces are
   * mirrored.
   */
  rest({ name, clip, faces, normals }) {
    const [vertexCount, faceCount] = [clip.vertices[0].length, faces.length / 3];
    return this.withClip(clip, (moved) =>
      this.withArrays([faces, normals, new Float64Array(vertexCount), new Uint8Array(faceCount)], (f, n, v, is) => {
        this.check(this.wasm.colonnade_model_rest(moved, f, faceCount, n, v, is), `mesh ${name}`);
        const copy = (Values, from, count) => new Values(this.wasm.memory.buffer, from, count).slice();
        return {
          vertices: copy(Float64Array, v, vertexCount),
          normals: normals && copy(Float64Array, n, 9 * faceCount),
          isMirrored: copy(Uint8Array, is, faceCount),
        };
      }),
    );
  }

  /** Which faces are metal by a map, and their roughness; `uvs` of their corners in it. */
  metal(texture, uvs, factors) {
    const count = uvs.length / 6;
    return this.withArrays(
      [texture.pixels, uvs, Float64Array.from(factors), new Uint8Array(count), new Float64Array(count)],
      (pixels, u, f, is, rough) =>
        this.withArrays([Int32Array.from(textureWords(texture, pixels))], (map) => {
          this.check(this.wasm.colonnade_model_metal(map, u, count, f, is, rough));
          return {
            isMetal: new Uint8Array(this.wasm.memory.buffer, is, count).slice(),
            roughness: new Float64Array(this.wasm.memory.buffer, rough, count).slice(),
          };
        }),
    );
  }

  /** What faces emit by a map, three values each; `uvs` of their corners in it. */
  emission(texture, uvs, areas) {
    const count = areas.length;
    return this.withArrays([texture.pixels, uvs, areas, new Float64Array(3 * count)], (pixels, u, a, found) =>
      this.withArrays([Int32Array.from(textureWords(texture, pixels))], (map) => {
        this.check(this.wasm.colonnade_model_emission(map, u, a, count, found));
        return new Float64Array(this.wasm.memory.buffer, found, 3 * count).slice();
      }),
    );
  }

  /**
   * The faces of a mesh in pieces where what they emit by a map varies, at most so many more: `owners` and `weights`,
   * as of cut.
   */
  emissionPieces(texture, factors, { vertices, faces }, shows, uvs, budget) {
    return this.withArrays(
      [texture.pixels, Float64Array.from(factors), vertices, faces, shows, uvs, new Uint32Array(3)],
      (pixels, f, v, corners, is, u, out) =>
        this.withArrays([Int32Array.from(textureWords(texture, pixels))], (map) => {
          this.check(
            this.wasm.colonnade_model_emission_pieces(
              map,
              f,
              v,
              vertices.length / 3,
              corners,
              faces.length / 3,
              is,
              u,
              budget,
              out,
            ),
          );
          const [count, owners, weights] = new Uint32Array(this.wasm.memory.buffer, out, 3);
          return {
            owners: new Int32Array(this.wasm.memory.buffer, owners, count).slice(),
            weights: new Float64Array(this.wasm.memory.buffer, weights, 9 * count).slice(),
          };
        }),
    );
  }

  /**
   * What of the faces of a material its alpha shows: `kinds`, the `owners` and `weights` of pieces, `panes`, and the
   * pixels of the texture, `filled` (colonnade_cut). `corners`, `uvs` and `alphas` are of the faces, `values` and
   * `budget` as there.
   */
  cut({ corners, uvs, alphas, texture, values, budget }) {
    const count = alphas.length / 3;
    const alpha = texture?.alpha ?? null;
    return this.withArrays(
      [corners, uvs, alphas, Float64Array.from(values), texture?.pixels ?? null, alpha, new Uint32Array(8)],
      (c, u, a, v, pixels, shown, out) =>
        this.withArrays([texture ? Int32Array.from(textureWords(texture, pixels)) : null], (picture) => {
          this.withArrays([Uint32Array.of(c, u, a, count, picture, shown, v, budget)], (job) =>
            this.check(this.wasm.colonnade_model_cut(job, out)),
          );
          const [kinds, pieces, owners, weights, panes, isCoarse, isBlended, filled] = new Uint32Array(
            this.wasm.memory.buffer,
            out,
            8,
          );
          const copy = (Values, from, length) =>
            from ? new Values(this.wasm.memory.buffer, from, length).slice() : new Values(0);
          return {
            kinds: copy(Int8Array, kinds, count),
            owners: copy(Int32Array, pieces ? owners : 0, pieces),
            weights: copy(Float64Array, weights, 9 * pieces),
            panes: copy(Float64Array, panes, 4 * count),
            isCoarse: isCoarse !== 0,
            isBlended: isBlended !== 0,
            filled: alpha && copy(Uint8Array, filled, texture.pixels.length),
          };
        }),
    );
  }

  /** Which faces show one colour of a texture, and the colours of their corners; `uvs` of their corners in it. */
  swatches(texture, uvs) {
    const count = uvs.length / 6;
    return this.withArrays(
      [texture.pixels, uvs, new Uint8Array(count), new Float64Array(9 * count)],
      (pixels, u, is, colours) =>
        this.withArrays([Int32Array.from(textureWords(texture, pixels))], (picture) => {
          this.check(this.wasm.colonnade_model_swatches(picture, u, count, is, colours));
          return {
            isPlain: new Uint8Array(this.wasm.memory.buffer, is, count).slice(),
            colours: new Float64Array(this.wasm.memory.buffer, colours, 9 * count).slice(),
          };
        }),
    );
  }

  /** The alpha of a texture by another picture. */
  mask({ pixels, alpha, ...mask }, { width, height }) {
    return this.result([pixels, alpha], Uint8Array, width * height, (p, a, to) =>
      this.wasm.colonnade_read_mask(p, a, mask.width, mask.height, width, height, to),
    );
  }

  /** Values, of which those of equal kinds are merged until so many are left. */
  merged(values, weights, kinds, left) {
    return this.result(
      [Float64Array.from(values), Float64Array.from(weights), Int32Array.from(kinds)],
      Float64Array,
      values.length,
      (v, w, k, to) => this.wasm.colonnade_model_merge(v, w, k, values.length, left, to),
    );
  }

  /** The memories of the packed mesh's textures, as of loadMemories; none for a design without. */
  textureMemories() {
    const own = Object.entries(this.manifest.memories).filter(([name]) => name.startsWith("texture."));
    return own.map(([memory, { depth, bits }]) => {
      const bytes = Math.ceil(bits / 8);
      const start = this.withArrays([new TextEncoder().encode(memory + "\0")], (name) =>
        this.wasm.colonnade_model_texture(name),
      );
      return { memory, bytes, words: this.bytes.slice(start, start + bytes * depth) };
    });
  }

  /** The records of a packed mesh, copied. */
  records(packed) {
    const start = this.wasm.colonnade_model_records();
    return this.bytes.slice(start, start + (packed.recordCount * this.manifest.records.bits) / 8);
  }

  /** The clip file of the packed mesh, copied; empty if nothing moves. */
  clipFile() {
    return this.withArrays([new Uint32Array(1)], (size) => {
      const start = this.wasm.colonnade_model_clip(size);
      return this.bytes.slice(start, start + new DataView(this.wasm.memory.buffer).getUint32(size, true));
    });
  }

  /** Gives the model records that another one has packed, and their clip file. */
  load(records, clip) {
    const count = records.length / (this.manifest.records.bits / 8);
    this.withArrays([records, clip], (pointer, file) => {
      this.check(this.wasm.colonnade_model_load(pointer, count));
      this.check(this.wasm.colonnade_model_load_clip(file, clip.length));
    });
  }

  /**
   * Bends the records to a time of their clip, 2^-16 s. Returns how many pairs of triangles are shaded flat, since they
   * are too stretched.
   */
  pose(time) {
    return this.withArrays([new Uint32Array(1)], (flat) => {
      this.check(this.wasm.colonnade_model_pose(time, flat));
      return new DataView(this.wasm.memory.buffer).getUint32(flat, true);
    });
  }

  /**
   * Gives the model memories of a room, its maps or light cube: {memory, words, bytes}, words as a Uint8Array, of so
   * many bytes each.
   */
  loadMemories(memories) {
    for (const { memory, words, bytes } of memories)
      this.withArrays([new TextEncoder().encode(memory + "\0"), words], (name, pointer) =>
        this.check(this.wasm.colonnade_model_load_memory(name, pointer, words.length / bytes, bytes)),
      );
  }

  /** Calls `use` with the addresses of inputs, and of a result of so many numbers, which it returns. */
  result(inputs, Values, count, use) {
    const result = new Values(count);
    return this.withArrays([...inputs, result], (...pointers) => {
      use(...pointers);
      return new Values(this.wasm.memory.buffer, pointers.at(-1), count).slice();
    });
  }

  /** The nearest pixel of each that is not missing (Uint8Array). */
  nearest(missing, width) {
    return this.result([missing], Int32Array, missing.length, (from, to) =>
      this.wasm.colonnade_environment_nearest(from, width, missing.length / width, to),
    );
  }

  /** Depth of the part `crop` of a photo (depth.js), in the size of the maps; a hole is 0. */
  fittedDepth(depth, photo, { left, top, scale }, width, height) {
    const sizes = [depth, photo].map((picture) => Int32Array.of(picture.width, picture.height));
    return this.result(
      [depth.values, ...sizes, Float64Array.of(left, top, scale)],
      Float64Array,
      width * height,
      (values, size, whole, part, to) =>
        this.wasm.colonnade_environment_depth(values, size, whole, part, width, height, to),
    );
  }

  /** Unit normals of depth towards the camera, view space, three of each pixel; the noise of the depth. */
  normals(depth, holes, { fx, fy, cx, cy }, width, height) {
    let noise;
    const normals = this.result(
      [depth, holes, Float64Array.of(fx, fy, cx, cy)],
      Float64Array,
      3 * depth.length,
      (d, h, lens, to) => {
        noise = this.wasm.colonnade_environment_normals(d, h, width, height, lens, to);
      },
    );
    return { normals, noise };
  }

  /** The plane m with m · p = 1 at points, three numbers each, by least squares. */
  plane(points) {
    return this.result([points], Float64Array, 3, (from, to) =>
      this.wasm.colonnade_environment_plane(from, points.length / 3, to),
    );
  }

  /** The bytes of the device's cube for an object: world = rotation · its own axes. */
  cubeWords(radiance, rotation) {
    return this.result([radiance, Float64Array.from(rotation.flat())], Uint8Array, CUBE_BYTES, (...pointers) =>
      this.wasm.colonnade_environment_cube(...pointers),
    );
  }

  /** The radiance that the bytes of a cube hold. */
  radianceOf(words) {
    return this.result([words], Float64Array, (3 * words.length) / 4, (from, to) =>
      this.wasm.colonnade_environment_radiance(from, words.length / 4, to),
    );
  }

  /**
   * The light of a photo around a point, where its surface is seen from there, and its mean elsewhere; the share that
   * is seen.
   */
  lightAt({ points, normals, colours }, point) {
    let share;
    const radiance = this.result(
      [points, normals, colours, Float64Array.from(point)],
      Float64Array,
      FINE_VALUES,
      (p, n, c, at, to) => {
        share = this.wasm.colonnade_environment_seen(p, n, c, points.length / 3, at, to);
      },
    );
    return { radiance, share };
  }

  /** The register `gather.parallax` of a point in a box, for an object whose cube has this edge. */
  parallax(box, point, edge) {
    const inside = point.map((value, axis) => Math.max(box[0][axis] + INSIDE, Math.min(box[1][axis] - INSIDE, value)));
    return this.withArrays([Float64Array.from(box.flat()), Float64Array.from(inside)], (bounds, at) =>
      this.wasm.colonnade_environment_parallax(bounds, at, edge),
    );
  }

  /** Starts a frame: `writes` are pairs of word address and value. */
  start(writes) {
    this.withArrays([new Uint32Array(writes.flat())], (pointer) =>
      this.check(this.wasm.colonnade_model_start(pointer, writes.length)),
    );
  }

  /** Rows of the frame: `colours`, linear, and `ratios`, Uint16Array, three for each pixel; `triangles` Int32Array. */
  rows(first, last, width) {
    const pixels = (last - first) * width;
    return this.withArrays(
      [new Uint16Array(3 * pixels), new Uint16Array(3 * pixels), new Int32Array(pixels)],
      (c, r, t) => {
        this.check(this.wasm.colonnade_model_rows(first, last, c, r, t));
        return {
          ratios: new Uint16Array(this.wasm.memory.buffer, r, 3 * pixels).slice(),
          colours: new Uint16Array(this.wasm.memory.buffer, c, 3 * pixels).slice(),
          triangles: new Int32Array(this.wasm.memory.buffer, t, pixels).slice(),
        };
      },
    );
  }

  /** Counters of the rendered rows. */
  counters() {
    const values = new Float64Array(this.wasm.memory.buffer, this.wasm.colonnade_model_counters(), COUNTERS.length);
    return Object.fromEntries(COUNTERS.map((name, index) => [name, values[index]]));
  }

  /** The steps of the rays of a pixel: {kind, value, isHit, isLeaf, values}. */
  trace(x, y) {
    return this.withArrays([new Uint32Array(1)], (out) => {
      const count = this.wasm.colonnade_model_trace(x, y, out);
      const view = new DataView(this.wasm.memory.buffer);
      const start = view.getUint32(out, true);
      return Array.from({ length: count }, (_, index) => {
        const at = start + STEP_BYTES * index;
        const word = (place) => view.getInt32(at + 4 * place, true);
        const values = Array.from({ length: 9 }, (_, place) => view.getFloat64(at + 16 + 8 * place, true));
        return { kind: word(0), value: word(1), isHit: word(2) !== 0, isLeaf: word(3) !== 0, values };
      });
    });
  }

  /** Opens a view file. Its device has the word addresses of the manifest. */
  openView(file) {
    if (!file) throw new Error("this design has no such view");
    const registers = this.manifest.registers.fields.filter((field) => field.access === "rw");
    const design = new Uint32Array(64);
    design.set(hashWords(this.manifest));
    design[8] = 0x8000 + 4 * Math.max(...registers.map((field) => field.address + field.words));
    design[9] = 0x8000 + 4 * Math.min(...registers.map((field) => field.address));
    if (this.view !== 0) for (const pointer of [this.view, this.file]) this.wasm.free(pointer);
    this.view = this.wasm.malloc(this.wasm.colonnade_view_size());
    this.file = this.wasm.malloc(file.length); // the view points into it
    this.bytes.set(file, this.file);
    this.withArrays([design], (pointer) =>
      this.checkView(this.wasm.colonnade_view_open(this.view, pointer, this.file, file.length)),
    );
  }

  checkView(error) {
    if (error !== 0) throw new Error(VIEW_ERRORS[error] ?? `the view was refused: error ${error}`);
  }

  /**
   * Sets the camera: position, and columns right, down and forward of its rotation; focal length and centre in pixels.
   */
  setCamera({
    position,
    right,
    down,
    forward,
    focal,
    focalY = focal,
    width,
    height,
    centre = [width / 2, height / 2],
  }) {
    const camera = new DataView(new ArrayBuffer(104));
    position.forEach((value, axis) => camera.setBigInt64(8 * axis, BigInt(Math.round(value * FRACTION)), true));
    for (let row = 0; row < 3; ++row)
      [right, down, forward].forEach((axis, column) =>
        camera.setInt32(24 + 4 * (3 * row + column), Math.round(axis[row] * 2 ** 30), true),
      );
    [focal, focalY, ...centre].forEach((value, i) =>
      camera.setBigInt64(64 + 8 * i, BigInt(Math.round(value * FRACTION)), true),
    );
    camera.setUint32(96, width, true);
    camera.setUint32(100, height, true);
    this.withArrays([new Uint8Array(camera.buffer)], (pointer) =>
      this.checkView(this.wasm.colonnade_view_set_camera(this.view, pointer)),
    );
  }

  /** Sets the object's pose: position, and rotation by rows. */
  setObject({ position, rotation }) {
    const pose = new DataView(new ArrayBuffer(64));
    position.forEach((value, axis) => pose.setBigInt64(8 * axis, BigInt(Math.round(value * FRACTION)), true));
    rotation.flat().forEach((value, index) => pose.setInt32(24 + 4 * index, Math.round(value * 2 ** 30), true));
    this.withArrays([new Uint8Array(pose.buffer)], (pointer) =>
      this.checkView(this.wasm.colonnade_view_set_object(this.view, pointer)),
    );
  }

  /** Sets a light; `reach` is the distance of its intensity, 0 for a constant one. */
  setLight(index, { position, colour, reach = 0 }) {
    const light = new DataView(new ArrayBuffer(48));
    position.forEach((value, axis) => light.setBigInt64(8 * axis, BigInt(Math.round(value * FRACTION)), true));
    colour.forEach((value, channel) => light.setUint32(24 + 4 * channel, Math.round(value * 2 ** 16), true));
    light.setBigUint64(40, BigInt(Math.round(reach * FRACTION)), true);
    this.withArrays([new Uint8Array(light.buffer)], (pointer) =>
      this.checkView(this.wasm.colonnade_view_set_light(this.view, index, pointer)),
    );
  }

  /** Selects a pass of a frame of several ones. */
  setSample({ index, count }) {
    this.checkView(this.wasm.colonnade_view_set_sample(this.view, index, count));
  }

  /** The writes of the view's frame, all of its registers, and those of `values` by name. */
  frame(values) {
    const most = this.wasm.colonnade_view_most_writes(this.view);
    const writes = this.withArrays([new Uint32Array(2 * most), new Uint32Array(4)], (pairs, frame) => {
      this.checkView(this.wasm.colonnade_view_frame(this.view, pairs, most, frame));
      const count = new DataView(this.wasm.memory.buffer).getUint32(frame + 4, true);
      const words = new Uint32Array(this.wasm.memory.buffer, pairs, 2 * count);
      return Array.from({ length: count }, (_, index) => [words[2 * index], words[2 * index + 1]]);
    });
    return [...writes, ...registerWrites(this.manifest, values)];
  }
}
