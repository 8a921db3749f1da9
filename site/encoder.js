// The live encoder of a room's maps (host/cpp/live), as the host encodes a still.

const ROUNDS = 3;
const DEPTH_STEPS = 65536;
const EXACT_TOLERANCE = 0.006;
const NOISE_DISTANCE = 3;
const TILE = 16;

/** Sizes of the maps of a design, as live.h has them. */
export function sizesOf(manifest) {
  const { width, height, encoding, paletteSize, planes, boundingPlanes, tileSize } =
    manifest.config.physicalAttributeMemory;
  if (encoding === "slic")
    throw new Error(
      "the live encoder writes two-level maps, this hardware has SLIC maps: " +
        "set physicalAttributeMemory.encoding=twoLevel",
    );
  if (tileSize !== TILE) throw new Error(`the live encoder has tiles of ${TILE} pixels, this hardware of ${tileSize}`);
  const depthOf = (name) => manifest.memories[name].depth;
  return [width, height, paletteSize, depthOf("albedo.heap"), planes, depthOf("planes.heap"), boundingPlanes];
}

/** Maps in the encoder's codes: sRGB of albedo, normals by bytes, depth in 2^-16 m. */
export function codesOf({ albedo, normals, depth, noise, lens, pose }) {
  return {
    albedo,
    normals: Uint8Array.from(normals, (value, i) =>
      Math.max(0, Math.min(255, Math.round((i % 3 === 0 ? value : -value) * 127.5 + 127.5))),
    ),
    depth: Uint32Array.from(depth, (value) => Math.min(2 ** 32 - 1, Math.round(value * DEPTH_STEPS))),
    lens: [lens.fx, lens.fy, lens.cx, lens.cy],
    toWorld: pose.rotation.flatMap((row, i) => [...row, pose.position[i]]),
    tolerance: Math.max(EXACT_TOLERANCE, noise * NOISE_DISTANCE),
  };
}

/** Repeats the last row and column up to whole tiles; `parts` values of each pixel. */
function wholeTiles(values, width, height, parts) {
  const [columns, rows] = [width, height].map((size) => TILE * Math.ceil(size / TILE));
  if (columns === width && rows === height) return values;
  const from = (i) => {
    const [pixel, part] = [Math.floor(i / parts), i % parts];
    return (
      parts * (Math.min(height - 1, Math.floor(pixel / columns)) * width + Math.min(width - 1, pixel % columns)) + part
    );
  };
  return values.constructor.from({ length: parts * columns * rows }, (_, i) => values[from(i)]);
}

/**
 * Encodes a still. `wasm`: the exports of the module; `codes` as of codesOf. Returns `maps`, [{memory, bytes, words}],
 * the depth unit, metres, the number of bounding planes, and of each tile its error, least and largest depth, metres.
 */
export function encodeStill(wasm, manifest, codes) {
  const sizes = sizesOf(manifest);
  const [width, height, palette, heap, planes, planeHeap, bounding] = sizes;
  const tiles = Math.ceil(width / TILE) * Math.ceil(height / TILE);
  const held = [];
  const take = (bytes) => {
    const pointer = wasm.malloc(Math.max(8, bytes));
    if (pointer === 0) throw new Error("the page is out of memory");
    held.push(pointer);
    return pointer;
  };
  const copy = (array) => {
    const pointer = take(array.byteLength);
    new Uint8Array(wasm.memory.buffer).set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), pointer);
    return pointer;
  };
  const encoder = wasm.colonnade_live_create(copy(Int32Array.from(sizes)));
  if (encoder === 0) throw new Error("the live encoder does not have maps of this size");
  try {
    const frame = take(152);
    const inputs = [
      wholeTiles(codes.albedo, width, height, 3),
      wholeTiles(codes.normals, width, height, 3),
      wholeTiles(codes.depth, width, height, 1),
    ].map(copy);
    const memories = [
      ["albedo.descriptors", tiles, 4],
      ["albedo.palette", palette, 8],
      ["albedo.heap", heap, 2],
      ["normals.descriptors", tiles, 4],
      ["normals.palette", palette, 8],
      ["normals.heap", heap, 2],
      ["planes.descriptors", tiles, 2],
      ["planes.planes", planes, 8],
      ["planes.heap", planeHeap, 2],
      ["planes.bounding", bounding, 24],
      ["error", tiles, 4],
      ["nearest", tiles, 4],
      ["furthest", tiles, 4],
    ].map(([name, count, bytes]) => ({ name, count, bytes, pointer: take(count * bytes) }));
    const result = take(64);
    const view = new DataView(wasm.memory.buffer);
    inputs.forEach((pointer, i) => view.setUint32(frame + 4 * i, pointer, true));
    [...codes.lens, ...codes.toWorld, codes.tolerance].forEach((value, i) =>
      view.setFloat64(frame + 16 + 8 * i, value, true),
    );
    memories.forEach(({ pointer }, i) => view.setUint32(result + 4 * i, pointer, true));
    for (let round = 0; round < ROUNDS; ++round) wasm.colonnade_live_encode(encoder, frame, result);

    const bytesOf = ({ pointer, count, bytes }) => new Uint8Array(wasm.memory.buffer, pointer, count * bytes).slice();
    const found = Object.fromEntries(memories.map((memory) => [memory.name, { ...memory, content: bytesOf(memory) }]));
    const maps = memories
      .filter(({ name }) => name in manifest.memories)
      .map(({ name }) => {
        const { content, count, bytes } = found[name];
        const own = Math.ceil(manifest.memories[name].bits / 8);
        return {
          memory: name,
          bytes: own,
          words: Uint8Array.from({ length: own * count }, (_, i) => content[bytes * Math.floor(i / own) + (i % own)]),
        };
      });
    const floats = (name) => new Float32Array(found[name].content.buffer);
    return {
      maps,
      depthUnit: new DataView(wasm.memory.buffer).getFloat64(result + 56, true),
      boundingPlanes: planesIn(found["planes.bounding"]),
      tiles: { error: floats("error"), nearest: floats("nearest"), furthest: floats("furthest") },
    };
  } finally {
    wasm.colonnade_live_destroy(encoder);
    for (const pointer of held) wasm.free(pointer);
  }
}

/** The number of entries that are not zero. */
function planesIn({ content, count, bytes }) {
  let planes = 0;
  for (let i = 0; i < count; ++i) planes += Number(content.subarray(bytes * i, bytes * (i + 1)).some(Boolean));
  return planes;
}
