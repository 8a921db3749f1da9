// Reads OBJ with MTL, PLY, STL and OFF by the readers in C++ (host/cpp/mesh/files), which the command line shares.

import { checkTriangles } from "./corners.js";
import { keptWithin } from "./surfaces.js";

const SURFACE_KINDS = ["diffuse", "mirror", "glass"];
/** That of the mesh `teapot` of the host. */
const TEAPOT_LEVEL = 10;
const MATERIAL_NUMBERS = 11;
const [MISSING, UNKNOWN, DAMAGED] = [0, 1, 2];

export const ended = (text) => new TextEncoder().encode(`${text}\0`);

/**
 * The name and the bytes of a dropped file that a mesh names, in its case or, if it is the only one, in any; without
 * bytes if there is none.
 */
export function fileOf(files, name) {
  const own = name.replaceAll("\\", "/").split("/").pop().trim();
  const alike = [...files.keys()].filter((key) => key.toLowerCase() === own.toLowerCase());
  const found = files.has(own) ? own : alike.length === 1 ? alike[0] : own;
  return [found, files.get(found) ?? null];
}

/** Whether bytes begin as those of a PNG, JPEG or WebP. */
const isPicture = (bytes) =>
  ["\x89PNG", "\xff\xd8", "RIFF"].some((mark) =>
    [...mark].every((character, i) => bytes[i] === character.charCodeAt(0)),
  );

/** A mesh, as of readMesh, of a file of a format. */
export async function readPolygons(library, format, bytes, name, files, decodePicture) {
  const { wasm } = library;
  library.withArrays([ended(format), ended(name), bytes], (kind, own, content) =>
    library.check(wasm.colonnade_read_begin(kind, own, content, bytes.length)),
  );
  for (let asked = wasm.colonnade_read_library(); asked !== 0; asked = wasm.colonnade_read_library()) {
    const [found, content] = fileOf(files, library.text(asked));
    library.withArrays([ended(found), content], (own, given) =>
      library.check(wasm.colonnade_read_materials(own, given, content?.length ?? 0)),
    );
  }
  const pictures = [];
  library.withArrays([new Int32Array(1)], (clamps) => {
    const next = () => wasm.colonnade_read_picture(pictures.length, clamps);
    for (let asked = next(); asked !== 0; asked = next())
      pictures.push([library.text(asked), 2 * new Int32Array(wasm.memory.buffer, clamps, 1)[0]]);
  });
  const read = [];
  const numbers = new Int32Array(pictures.length).fill(-1);
  for (const [index, [own, wrap]] of pictures.entries()) {
    const [, content] = fileOf(files, own);
    const decoded = content && (await decodePicture(content).catch(() => null));
    if (decoded) numbers[index] = read.push({ ...decoded, wrapU: wrap, wrapV: wrap, isNearest: 0 }) - 1;
    else wasm.colonnade_read_lost(index, content ? (isPicture(content) ? DAMAGED : UNKNOWN) : MISSING);
  }
  keptWithin(read);
  return library.withArrays([numbers, new Uint32Array(12)], (given, out) => {
    library.check(wasm.colonnade_read_finish(given, out));
    return surfaceOfFile(library, new Uint32Array(wasm.memory.buffer, out, 12).slice(), read);
  });
}

/** The teapot of the page. */
export function teapot(library) {
  return library.withArrays([new Uint32Array(12)], (out) => {
    library.wasm.colonnade_read_teapot(TEAPOT_LEVEL, out);
    const [v, vertexCount, f, faceCount] = new Uint32Array(library.wasm.memory.buffer, out, 12);
    const copy = (Values, from, count) => new Values(library.wasm.memory.buffer, from, count).slice();
    return {
      vertices: copy(Float64Array, v, 3 * vertexCount),
      faces: copy(Int32Array, f, 3 * faceCount),
      normals: null,
      colours: null,
      notes: [],
    };
  });
}

/** The mesh of a colonnade_read, whose pictures are these. */
function surfaceOfFile(library, words, read) {
  const [v, vertexCount, f, faceCount, n, c, u, of, m, materialCount, t, textureCount] = words;
  const { wasm } = library;
  checkTriangles(faceCount);
  const copy = (Values, from, count) => (from === 0 ? null : new Values(wasm.memory.buffer, from, count).slice());
  const rows = copy(Float64Array, m, MATERIAL_NUMBERS * materialCount);
  const materials = Array.from({ length: materialCount }, (_, i) => {
    const [kind, red, green, blue, ior, roughness, ...others] = rows.subarray(
      MATERIAL_NUMBERS * i,
      MATERIAL_NUMBERS * (i + 1),
    );
    const [alpha, texture] = others.slice(3);
    const shown = {
      albedo: [red, green, blue],
      ior,
      roughness: kind === 0 ? 0 : roughness,
      emission: others.slice(0, 3),
      coverage: 1,
    };
    return {
      ...shown,
      kind: SURFACE_KINDS[kind],
      alpha: alpha < 0 ? null : { factor: alpha, cutoff: 0.5, blends: false },
      base: texture < 0 ? null : { texture },
    };
  });
  const places = copy(Int32Array, t, 3 * textureCount) ?? [];
  const textures = Array.from({ length: textureCount }, (_, i) => {
    const [picture, mask, isWhite] = places.subarray(3 * i, 3 * i + 3);
    const own = read[picture];
    return {
      ...own,
      pixels: isWhite ? own.pixels.map(() => 255) : own.pixels,
      alpha: mask < 0 ? null : library.mask(read[mask], own),
    };
  });
  const notes = [];
  for (let line = wasm.colonnade_read_note(0); line !== 0; line = wasm.colonnade_read_note(notes.length))
    notes.push(library.text(line));
  const colours = copy(Float64Array, c, 9 * faceCount);
  const mesh = {
    vertices: copy(Float64Array, v, 3 * vertexCount) ?? new Float64Array(0),
    faces: copy(Int32Array, f, 3 * faceCount) ?? new Int32Array(0),
    normals: copy(Float64Array, n, 9 * faceCount),
    colours,
    notes,
  };
  const numbers = copy(Int32Array, of, faceCount) ?? new Int32Array(faceCount);
  const hasOwnColours = Int32Array.from({ length: faceCount }, (_, face) =>
    Number(colours !== null && !Number.isNaN(colours[9 * face])),
  );
  const isPlain = (one) =>
    one.kind === "diffuse" &&
    !one.base &&
    [0.8, 0.8, 0.8, 0, 0, 0].every((value, i) => value === [...one.albedo, ...one.emission][i]);
  // One material in the default colour is no material of the file
  if (materials.every(isPlain) && (colours === null || hasOwnColours.every(Boolean))) return mesh;
  // Colours of corners replace those of materials
  const coloured = materials.map((material) => ({ ...material, albedo: [1, 1, 1] }));
  return {
    ...mesh,
    colours: colours?.map((value) => (Number.isNaN(value) ? 1 : value)) ?? null,
    hasOwnColours,
    materials: [...materials, ...coloured],
    materialOf: numbers.map((number, face) => number + hasOwnColours[face] * materialCount),
    textures,
    uvs: copy(Float64Array, u, 6 * faceCount) ?? new Float64Array(6 * faceCount),
  };
}
