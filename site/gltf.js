// Reads glTF as host/colonnade/mesh/files/gltf.py does, with its errors: the triangles of the default scene with
// normals, colours and materials. Draco is not read.

import { Corners } from "./corners.js";
import { ClipReader, EYE, animationNames, firstAnimation } from "./gltfclip.js";
import { COMPRESSION, DRACO, GltfDocument, grouped } from "./gltfdocument.js";
import { GltfMaterials } from "./gltfmaterials.js";

/** As host/colonnade/mesh/materials/texture.py. */
const MOST_UV = 1e6;
const [POINTS, TRIANGLES, FAN] = [0, 4, 6];

/**
 * A mesh, as of readMesh; `files` has the other dropped files by name. `chosen` is the number of the animation that
 * moves it, null for none, the first that can unless given. Vertices of a mesh with a clip are where they are bound,
 * until they are at rest (coverage.js).
 */
export function readGltf(library, bytes, name, files, chosen) {
  const document = new GltfDocument(library, bytes, name, files);
  const { json } = document;
  const animation = chosen === undefined ? firstAnimation(json) : chosen;
  const corners = new Corners();
  const materials = new GltfMaterials(document, corners.notes);
  const vertices = [];
  const left = { "point primitive": 0, "line primitive": 0 };
  const animations = animationNames(json);
  const clip = animation !== null ? new ClipReader(document, animation, corners.notes) : null;
  for (const { index, matrices } of document.placements(Boolean(clip), corners.notes))
    for (const primitive of document.entry("meshes", document.entry("nodes", index).mesh).primitives ?? [])
      for (const matrix of clip ? [EYE] : matrices) {
        const before = vertices.length / 3;
        const into = { corners, materials, vertices, left, isBent: Boolean(clip) };
        if (addPrimitive(document, primitive, matrix, into)) clip?.add(index, primitive, vertices.length / 3 - before);
      }
  for (const [noun, count] of Object.entries(left))
    if (count > 0)
      corners.notes.add(`${grouped(count)} ${noun}${count > 1 ? "s are" : " is"} not shown: only faces are rendered`);
  if (!clip && (animations.length > 0 || json.skins)) corners.notes.add("animations and skins are left out");
  const mesh = corners.mesh(vertices);
  const moved = clip && mesh.faces.length > 0 ? clip.clip(mesh.vertices) : null;
  return {
    ...mesh,
    animations,
    animation,
    clip: moved,
    relief: mesh.relief && { ...mesh.relief, maps: materials.maps },
    materials: materials.materials,
    textures: materials.textures,
  };
}

/** The triangles of a primitive's corners. */
function trianglesOf(indices, mode) {
  if (mode === TRIANGLES)
    return Array.from({ length: Math.floor(indices.length / 3) }, (_, i) => [...indices.subarray(3 * i, 3 * i + 3)]);
  const corner = (i) => (mode === FAN ? [i + 1, i + 2, 0] : [i, i + 1 + (i % 2), i + 2 - (i % 2)]);
  return Array.from({ length: Math.max(0, indices.length - 2) }, (_, i) => corner(i).map((at) => indices[at]));
}

/** Adds the triangles of a primitive; false if it has none. */
function addPrimitive(document, primitive, matrix, { corners, materials, vertices, left, isBent }) {
  const { mode = TRIANGLES, attributes = {}, extensions = {} } = primitive;
  if (mode < TRIANGLES) {
    ++left[mode === POINTS ? "point primitive" : "line primitive"];
    return false;
  }
  if (mode > FAN) throw document.error(`a primitive has the unknown mode ${mode}`);
  for (const name of COMPRESSION)
    if (name in extensions && document.entry("accessors", attributes.POSITION).bufferView === undefined)
      throw document.compressed(name);
  if (attributes.POSITION === undefined) throw document.error("a primitive has no positions");
  if (DRACO in extensions && document.entry("accessors", attributes.POSITION).bufferView === undefined)
    throw document.error(`its meshes are compressed (${DRACO}), which the tab does not read: the command line does`);
  const positions = document.array(attributes.POSITION);
  if (positions.width !== 3) throw document.error("the positions of a primitive are not of type VEC3: export it again");
  const { count } = positions;
  /** Of an attribute, the part of each vertex: a function; null if the primitive has none. */
  const attribute = (name, least = 3) => {
    if (attributes[name] === undefined) return null;
    const { count: own, width, values } = document.array(attributes[name]);
    if (own !== count || width < least)
      throw document.error(`a primitive has ${grouped(own)} of ${name} for ${grouped(count)} positions`);
    return (vertex) => values.subarray(width * vertex, width * (vertex + 1));
  };
  const indices =
    primitive.indices === undefined
      ? { isWhole: true, width: 1, values: Float64Array.from({ length: count }, (_, i) => i) }
      : document.array(primitive.indices);
  if (indices.width !== 1 || !indices.isWhole) throw document.error("the indices of a primitive are not whole numbers");
  const last = indices.values.reduce((most, index) => Math.max(most, index), 0);
  if (last >= count)
    throw document.error(
      `a face names vertex ${last}, which does not exist: ` +
        `its primitive has ${grouped(count)} vertices, numbered from 0`,
    );
  const own = attribute("COLOR_0");
  for (let vertex = 0; own && vertex < count; ++vertex)
    if (!own(vertex).every(Number.isFinite))
      throw document.error("a primitive has a COLOR_0 that is not a finite number: export it again");
  const normalAt = attribute("NORMAL");
  const material = materials.numberOf(primitive.material);
  /** The positions of vertices in a texture. */
  const positionsIn = (use) => {
    const uvs = use && attribute(use.coordinates, 2);
    const found = uvs && Array.from({ length: count }, (_, vertex) => use.place(uvs(vertex)));
    if (found?.some((uv) => !uv.every((value) => Math.abs(value) <= MOST_UV)))
      throw document.error(
        `a primitive has texture coordinates beyond ${grouped(MOST_UV)}, or not finite: export it again`,
      );
    return found;
  };
  const { base, metal, emissive, relief, alpha } = materials.materials[material];
  const [uvs, metalUvs, emissiveUvs] = [base, metal, emissive].map(positionsIn);
  const reliefUvs = relief && attribute(relief.coordinates, 2);
  if (relief && !reliefUvs)
    corners.notes.add("faces with a normal map are smooth: they have no texture coordinates of the map");
  if (base && !uvs) corners.notes.add("faces without texture coordinates show no texture");

  const first = vertices.length / 3;
  for (let vertex = 0; vertex < count; ++vertex)
    vertices.push(...transform(matrix, positions.values.subarray(3 * vertex, 3 * vertex + 3), 1));
  const normalMatrix = cofactors(matrix);
  const isMirrored = determinant(matrix) < 0;
  const normalOf = (vertex) =>
    transform(normalMatrix, normalAt(vertex), 0).map((value) => (isMirrored ? -value : value));
  const side = isMirrored ? -1 : 1;
  // Tangents of a mesh that bends are those of its surface
  const tangentAt = reliefUvs && !isBent && attribute("TANGENT", 4);
  const tangentOf = (vertex) =>
    tangentAt ? [...transform(matrix, tangentAt(vertex), 0), side * Math.sign(tangentAt(vertex)[3])] : [0, 0, 0, 0];
  const reliefOf = (face) => ({
    map: relief.map,
    uvs: face.map((vertex) => relief.place(reliefUvs(vertex))),
    tangents: face.map(tangentOf),
  });
  // A face without positions has its plain colour, a textured one none of its vertices
  const missing = [base && !uvs, metal && !metalUvs, emissive && !emissiveUvs];
  const number = missing.some(Boolean) ? materials.without(material, ...missing) : material;
  const colourOf = (vertex) => [...own(vertex).subarray(0, 3)].map((value) => Math.max(0, Math.min(1, value)));
  const alphas =
    alpha &&
    own?.(0).length === 4 &&
    Array.from({ length: count }, (_, vertex) => Math.max(0, Math.min(1, own(vertex)[3])));
  for (const face of trianglesOf(indices.values, mode)) {
    if (isMirrored) face.reverse();
    const [inBase, inMetal, inEmissive] = [uvs, metalUvs, emissiveUvs].map(
      (all) => all && face.map((vertex) => all[vertex]),
    );
    corners.add(
      face.map((vertex) => first + vertex),
      normalAt && face.map(normalOf),
      own && !uvs && face.map(colourOf),
      number,
      inBase,
      inMetal,
      inEmissive,
      reliefUvs && reliefOf(face),
      alphas && face.map((vertex) => alphas[vertex]),
    );
  }
  return true;
}

// Matrices: 16 numbers, row by row

const transform = (m, [x, y, z], w) =>
  [0, 4, 8].map((row) => m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3] * w);

function cofactors(m) {
  const minor = (row, column) => {
    const at = (r, c) => m[4 * ((row + r) % 3) + ((column + c) % 3)];
    return at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1);
  };
  return [0, 1, 2].flatMap((row) => [minor(row, 0), minor(row, 1), minor(row, 2), 0]).concat([0, 0, 0, 1]);
}

const determinant = (m) => {
  const c = cofactors(m);
  return m[0] * c[0] + m[4] * c[4] + m[8] * c[8];
};
