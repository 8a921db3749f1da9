// Reads glTF as host/colonnade/mesh/files/gltf.py does, with its errors: the triangles of the default scene with normals and
// colours. Draco is not read.

import { Corners } from "./corners.js";
import { DRACO, READ_EXTENSIONS } from "./gltfchecks.js";
import { COMPRESSION, GltfDocument, grouped } from "./gltfdocument.js";

/** Largest magnitude of a transform's element, in the scene. */
const MOST_TRANSFORM = 1e100;
const [POINTS, TRIANGLES, FAN] = [0, 4, 6];

/** A mesh, as of readMesh; `files` has the other dropped files by name. */
export function readGltf(bytes, name, files) {
  const document = new GltfDocument(bytes, name, files);
  const { json } = document;
  for (const extension of json.extensionsRequired ?? []) {
    if (COMPRESSION.includes(extension)) throw document.compressed(extension);
    if (!READ_EXTENSIONS.includes(extension)) throw document.error(`it requires the glTF extension ${extension}, which is not supported: export it without`);
  }
  const corners = new Corners();
  const vertices = [];
  const left = { "point primitive": 0, "line primitive": 0 };
  for (const { node, matrix } of nodesOf(document))
    for (const primitive of document.entry("meshes", node.mesh).primitives ?? []) addPrimitive(document, primitive, matrix, { corners, vertices, left });
  for (const [noun, count] of Object.entries(left)) if (count > 0) corners.notes.add(`${grouped(count)} ${noun}${count > 1 ? "s are" : " is"} not shown: only faces are rendered`);
  if (json.animations || json.skins) corners.notes.add("animations and skins are left out");
  return corners.mesh(vertices);
}

/** The nodes with a mesh of the default scene, and their transforms to the scene. */
function* nodesOf(document) {
  const { scenes = [], nodes = [], scene = 0 } = document.json;
  const children = new Set(nodes.flatMap((node) => node.children ?? []));
  const roots = scenes.length > 0 ? (document.entry("scenes", scene).nodes ?? []) : [...nodes.keys()].filter((index) => !children.has(index));
  const pending = roots.map((index) => ({ index, parent: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] })).reverse();
  while (pending.length > 0) {
    const { index, parent } = pending.pop();
    const node = document.entry("nodes", index);
    const matrix = multiply(parent, matrixOf(document, node, index));
    if (!matrix.every((value) => Math.abs(value) < MOST_TRANSFORM)) throw document.error(`the transform of node ${index} is not finite, or too large: export it again`);
    for (const child of [...(node.children ?? [])].reverse()) pending.push({ index: child, parent: matrix });
    if (node.mesh !== undefined) yield { node, matrix };
  }
}

/** The triangles of a primitive's corners. */
function trianglesOf(indices, mode) {
  if (mode === TRIANGLES) return Array.from({ length: Math.floor(indices.length / 3) }, (_, i) => [...indices.subarray(3 * i, 3 * i + 3)]);
  const corner = (i) => (mode === FAN ? [i + 1, i + 2, 0] : [i, i + 1 + (i % 2), i + 2 - (i % 2)]);
  return Array.from({ length: Math.max(0, indices.length - 2) }, (_, i) => corner(i).map((at) => indices[at]));
}

function addPrimitive(document, primitive, matrix, { corners, vertices, left }) {
  const { mode = TRIANGLES, attributes = {}, extensions = {} } = primitive;
  if (mode < TRIANGLES) return void ++left[mode === POINTS ? "point primitive" : "line primitive"];
  if (mode > FAN) throw document.error(`a primitive has the unknown mode ${mode}`);
  for (const name of COMPRESSION)
    if (name in extensions && document.entry("accessors", attributes.POSITION).bufferView === undefined) throw document.compressed(name);
  if (attributes.POSITION === undefined) throw document.error("a primitive has no positions");
  if (DRACO in extensions && document.entry("accessors", attributes.POSITION).bufferView === undefined)
    throw document.error(`its meshes are compressed (${DRACO}), which the tab does not read: the command line does`);
  const positions = document.array(attributes.POSITION);
  if (positions.width !== 3) throw document.error("the positions of a primitive are not of type VEC3: export it again");
  const { count } = positions;
  /** Of an attribute, the part of each vertex: a function; null if the primitive has none. */
  const attribute = (name) => {
    if (attributes[name] === undefined) return null;
    const { count: own, width, values } = document.array(attributes[name]);
    if (own !== count || width < 3) throw document.error(`a primitive has ${grouped(own)} of ${name} for ${grouped(count)} positions`);
    return (vertex) => values.subarray(width * vertex, width * (vertex + 1));
  };
  const indices = primitive.indices === undefined ? { isWhole: true, width: 1, values: Float64Array.from({ length: count }, (_, i) => i) } : document.array(primitive.indices);
  if (indices.width !== 1 || !indices.isWhole) throw document.error("the indices of a primitive are not whole numbers");
  const last = indices.values.reduce((most, index) => Math.max(most, index), 0);
  if (last >= count) throw document.error(`a face names vertex ${last}, which does not exist: its primitive has ${grouped(count)} vertices, numbered from 0`);
  const own = attribute("COLOR_0");
  for (let vertex = 0; own && vertex < count; ++vertex) if (!own(vertex).every(Number.isFinite)) throw document.error("a primitive has a COLOR_0 that is not a finite number: export it again");
  const normalAt = attribute("NORMAL");
  if (primitive.material !== undefined) document.entry("materials", primitive.material);
  const factor = noteMaterial(document.json.materials?.[primitive.material] ?? {}, corners.notes);

  const first = vertices.length / 3;
  for (let vertex = 0; vertex < count; ++vertex) vertices.push(...transform(matrix, positions.values.subarray(3 * vertex, 3 * vertex + 3), 1));
  const normalMatrix = cofactors(matrix);
  const isMirrored = determinant(matrix) < 0;
  const normalOf = (vertex) => transform(normalMatrix, normalAt(vertex), 0).map((value) => (isMirrored ? -value : value));
  const colourOf = (vertex) => [0, 1, 2].map((channel) => (own?.(vertex)[channel] ?? 1) * (factor?.[channel] ?? 1));
  for (const face of trianglesOf(indices.values, mode)) {
    if (isMirrored) face.reverse();
    corners.add(face.map((vertex) => first + vertex), normalAt && face.map(normalOf), (own || factor) && face.map(colourOf));
  }
}

/** The colour of a material, if it has one; notes what it has beside. */
function noteMaterial({ pbrMetallicRoughness: surface, emissiveFactor }, notes) {
  if (surface?.baseColorTexture) notes.add("textures are left out");
  if (surface && (surface.metallicFactor ?? 1) > 0) notes.add("metal and roughness of the file are left out: the page has a material for the whole mesh");
  if (emissiveFactor?.some((channel) => channel > 0)) notes.add("emission is left out");
  return surface?.baseColorFactor;
}

// Matrices: 16 numbers, column by column

/** A node's transform to its parent. */
function matrixOf(document, node, index) {
  const part = (name, otherwise) => {
    const values = node[name] === undefined ? otherwise : node[name];
    if (!Array.isArray(values) || values.length !== otherwise.length || !values.every((value) => typeof value === "number")) throw document.error(`the transform of node ${index} is not valid: export it again`);
    return values;
  };
  if (node.matrix !== undefined) return part("matrix", Array(16).fill(0));
  const rotation = part("rotation", [0, 0, 0, 1]);
  const length = Math.hypot(...rotation) || 1;
  const [x, y, z, w] = rotation.map((value) => value / length);
  const scale = part("scale", [1, 1, 1]);
  const columns = [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
  return [...columns.flatMap((column, axis) => [...column.map((value) => value * scale[axis]), 0]), ...part("translation", [0, 0, 0]), 1];
}

const multiply = (a, b) =>
  Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0));

const transform = (m, [x, y, z], w) => [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row] * w);

function cofactors(m) {
  const minor = (row, column) => {
    const at = (r, c) => m[4 * ((column + c) % 3) + ((row + r) % 3)];
    return at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1);
  };
  return [0, 1, 2].flatMap((column) => [minor(0, column), minor(1, column), minor(2, column), 0]).concat([0, 0, 0, 1]);
}

const determinant = (m) => {
  const c = cofactors(m);
  return m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
};
