// SPDX-License-Identifier: Apache-2.0
// Readers of OBJ, PLY and glTF: positions, triangles, corner normals and corner colours. What a file holds and they leave
// out is a note.

/** A mesh: Float64Array vertices, Int32Array faces, normals and colours of the corners (Float64Array or null), notes. */
export function readMesh(name, bytes, files = new Map()) {
  const suffix = name.toLowerCase().split(".").pop();
  const readers = { obj: readObj, ply: readPly, glb: readGlb, gltf: readGltf };
  if (!readers[suffix]) throw new Error(`${name}: only OBJ, PLY, glTF and GLB are read here; the command line reads more`);
  let mesh;
  try {
    mesh = readers[suffix](bytes, files);
  } catch (error) {
    // What the language throws on wrong offsets, lengths and fields
    const isDamaged = [RangeError, TypeError, SyntaxError].some((kind) => error instanceof kind);
    throw isDamaged ? new Error(`${name} is damaged, or no ${suffix.toUpperCase()} file`) : error;
  }
  if (mesh.faces.length === 0) throw new Error(`${name} has no triangles`);
  return { name, ...mesh };
}

const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);

/** Collects polygons as fans of triangles. */
class Corners {
  constructor() {
    this.faces = [];
    this.normals = [];
    this.colours = [];
    this.hasNormals = false;
    this.hasColours = false;
    this.notes = new Set();
  }

  add(vertices, normals, colours) {
    for (let i = 1; i + 1 < vertices.length; ++i)
      for (const corner of [0, i, i + 1]) {
        this.faces.push(vertices[corner]);
        this.normals.push(...(normals?.[corner] ?? [0, 0, 0]));
        this.colours.push(...(colours?.[corner] ?? [1, 1, 1]));
      }
    this.hasNormals ||= Boolean(normals?.some(Boolean));
    this.hasColours ||= Boolean(colours?.some(Boolean));
  }

  mesh(vertices) {
    return {
      vertices: Float64Array.from(vertices),
      faces: Int32Array.from(this.faces),
      normals: this.hasNormals ? Float64Array.from(this.normals) : null,
      colours: this.hasColours ? Float64Array.from(this.colours) : null,
      notes: [...this.notes],
    };
  }
}

function readObj(bytes) {
  const vertices = [];
  const colours = [];
  const normals = [];
  const corners = new Corners();
  const indexOf = (text, count) => (text ? (Number(text) < 0 ? count + Number(text) : Number(text) - 1) : -1);
  for (const line of new TextDecoder().decode(bytes).replaceAll("\\\n", " ").split("\n")) {
    const [keyword, ...words] = line.split("#")[0].trim().split(/\s+/);
    if (keyword === "v") {
      vertices.push(...words.slice(0, 3).map(Number));
      colours.push(words.length >= 6 ? words.slice(3, 6).map((word) => linear(Number(word))) : null);
    } else if (keyword === "vn") normals.push(words.map(Number));
    else if (keyword === "f") {
      const parts = words.map((word) => word.split("/"));
      const indices = parts.map((part) => indexOf(part[0], vertices.length / 3));
      if (indices.some((index) => !(index >= 0 && index < vertices.length / 3))) throw new Error("a face names a vertex that does not exist");
      const own = parts.map((part) => normals[indexOf(part[2], normals.length)]);
      corners.add(indices, own, indices.map((index) => colours[index]));
    } else if (keyword === "mtllib" || keyword === "usemtl") corners.notes.add("materials and textures of the file are left out");
    else if (["l", "p", "curv", "surf"].includes(keyword)) corners.notes.add("lines, points and curves are left out");
  }
  return corners.mesh(vertices);
}

const PLY_TYPES = {
  char: [1, "getInt8"], int8: [1, "getInt8"], uchar: [1, "getUint8"], uint8: [1, "getUint8"],
  short: [2, "getInt16"], int16: [2, "getInt16"], ushort: [2, "getUint16"], uint16: [2, "getUint16"],
  int: [4, "getInt32"], int32: [4, "getInt32"], uint: [4, "getUint32"], uint32: [4, "getUint32"],
  float: [4, "getFloat32"], float32: [4, "getFloat32"], double: [8, "getFloat64"], float64: [8, "getFloat64"],
};

/** The numbers of a PLY file one after the other. */
function plySource(bytes, start, format) {
  if (format === "ascii") {
    const words = new TextDecoder().decode(bytes.subarray(start)).split(/\s+/).filter(Boolean);
    let next = 0;
    return () => Number(words[next++]);
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset + start);
  let at = 0;
  return (type) => {
    const [size, read] = PLY_TYPES[type];
    at += size;
    return view[read](at - size, format === "binary_little_endian");
  };
}

function readPly(bytes) {
  const head = new TextDecoder("latin1").decode(bytes.subarray(0, 65536));
  const end = /end_header\r?\n/.exec(head);
  if (!head.startsWith("ply") || !end) throw new Error("this is no PLY file");
  const elements = [];
  let format = "ascii";
  for (const line of head.slice(0, end.index).split(/\r?\n/)) {
    const [keyword, ...words] = line.trim().split(/\s+/);
    if (keyword === "format") format = words[0];
    else if (keyword === "element") elements.push({ name: words[0], count: Number(words[1]), properties: [] });
    else if (keyword === "property") {
      const isList = words[0] === "list";
      elements.at(-1).properties.push({ name: words.at(-1), type: isList ? words[2] : words[0], size: isList ? words[1] : null });
    }
  }
  if (elements.some(({ count }) => !(count >= 0 && count <= bytes.length))) throw new RangeError("more rows than bytes");
  const next = plySource(bytes, end.index + end[0].length, format);
  const rows = Object.fromEntries(elements.map((element) => [element.name, readElement(element, next)]));
  const { vertex = [], face = [] } = rows;
  const types = Object.fromEntries((elements.find((element) => element.name === "vertex")?.properties ?? []).map((one) => [one.name, one.type]));
  const corners = new Corners();
  if (elements.some(({ name, count }) => !["vertex", "face"].includes(name) && count > 0)) corners.notes.add("elements other than vertices and faces are left out");
  const most = { uchar: 255, uint8: 255, ushort: 65535, uint16: 65535 };
  const hasNormals = "nx" in types;
  const normals = vertex.map((row) => (hasNormals ? [row.nx, row.ny, row.nz] : null));
  const colours = vertex.map((row) => ("red" in types ? ["red", "green", "blue"].map((name) => linear(row[name] / (most[types[name]] ?? 1))) : null));
  for (const row of face) {
    const indices = row.vertex_indices ?? row.vertex_index ?? [];
    if (indices.some((index) => !(index >= 0 && index < vertex.length))) throw new Error("a face names a vertex that does not exist");
    corners.add(indices, indices.map((index) => normals[index]), indices.map((index) => colours[index]));
  }
  return corners.mesh(vertex.flatMap((row) => [row.x, row.y, row.z]));
}

function readElement({ count, properties }, next) {
  return Array.from({ length: count }, () => {
    const row = {};
    for (const { name, type, size } of properties)
      row[name] = size ? Array.from({ length: next(size) }, () => next(type)) : next(type);
    return row;
  });
}

function readGlb(bytes, files) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (view.getUint32(0, true) !== 0x46546c67) throw new Error("this is no GLB file");
  const length = view.getUint32(12, true);
  const binary = 20 + length + 8 <= bytes.length ? bytes.subarray(20 + length + 8) : null;
  return readDocument(JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length))), binary, files);
}

function readGltf(bytes, files) {
  return readDocument(JSON.parse(new TextDecoder().decode(bytes)), null, files);
}

const GLTF_TYPES = {
  5120: [1, "getInt8", 127], 5121: [1, "getUint8", 255], 5122: [2, "getInt16", 32767], 5123: [2, "getUint16", 65535],
  5125: [4, "getUint32", 1], 5126: [4, "getFloat32", 1],
};
const GLTF_SIZES = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

function readDocument(document, binary, files) {
  const required = (document.extensionsRequired ?? []).filter((name) => name.includes("compression") || name.includes("meshopt"));
  if (required.length) throw new Error(`the file needs ${required.join(", ")}; the command line reads Draco`);
  const buffers = (document.buffers ?? []).map(({ uri }) => {
    if (uri === undefined) return binary;
    if (uri.startsWith("data:")) return Uint8Array.from(atob(uri.split(",")[1]), (character) => character.charCodeAt(0));
    const found = files.get(decodeURIComponent(uri).split("/").pop());
    if (!found) throw new Error(`drop ${uri} together with the file`);
    return found;
  });
  const accessor = (index) => {
    const { bufferView, byteOffset = 0, componentType, count, type, normalized, sparse } = document.accessors[index];
    if (sparse || bufferView === undefined) throw new Error("sparse accessors are not read here");
    const place = document.bufferViews[bufferView];
    const [size, read, most] = GLTF_TYPES[componentType];
    const width = GLTF_SIZES[type];
    const buffer = buffers[place.buffer];
    const view = new DataView(buffer.buffer, buffer.byteOffset + (place.byteOffset ?? 0) + byteOffset);
    const stride = place.byteStride ?? size * width;
    return Array.from({ length: count }, (_, row) =>
      Array.from({ length: width }, (_, column) => view[read](stride * row + size * column, true) / (normalized ? most : 1)),
    );
  };
  const corners = new Corners();
  const vertices = [];
  const visit = (index, parent) => {
    const node = document.nodes[index];
    const matrix = multiply(parent, node.matrix ?? matrixOf(node));
    if (node.mesh !== undefined) for (const primitive of document.meshes[node.mesh].primitives) addPrimitive(primitive, matrix);
    for (const child of node.children ?? []) visit(child, matrix);
  };
  const addPrimitive = (primitive, matrix) => {
    if ((primitive.mode ?? 4) !== 4) return corners.notes.add("points, lines, strips and fans are left out");
    const first = vertices.length / 3;
    const positions = accessor(primitive.attributes.POSITION);
    for (const position of positions) vertices.push(...transform(matrix, position, 1));
    const normalMatrix = cofactors(matrix);
    const mirrored = determinant(matrix) < 0;
    const sign = mirrored ? -1 : 1;
    const normals = primitive.attributes.NORMAL === undefined ? null : accessor(primitive.attributes.NORMAL).map((normal) => transform(normalMatrix, normal, 0).map((value) => sign * value));
    const material = document.materials?.[primitive.material];
    const factor = material?.pbrMetallicRoughness?.baseColorFactor;
    const own = primitive.attributes.COLOR_0 === undefined ? null : accessor(primitive.attributes.COLOR_0);
    const colourOf = (vertex) => (own || factor ? [0, 1, 2].map((channel) => (own?.[vertex][channel] ?? 1) * (factor?.[channel] ?? 1)) : null);
    if (material?.pbrMetallicRoughness?.baseColorTexture) corners.notes.add("textures are left out");
    if (material?.pbrMetallicRoughness && (material.pbrMetallicRoughness.metallicFactor ?? 1) > 0) corners.notes.add("metal and roughness of the file are left out: the page has a material for the whole mesh");
    if (material?.emissiveFactor?.some((channel) => channel > 0)) corners.notes.add("emission is left out");
    const indices = primitive.indices === undefined ? positions.map((_, index) => index) : accessor(primitive.indices).flat();
    for (let i = 0; i + 2 < indices.length; i += 3) {
      const face = indices.slice(i, i + 3);
      if (mirrored) face.reverse();
      corners.add(face.map((vertex) => first + vertex), normals && face.map((vertex) => normals[vertex]), face.map(colourOf));
    }
  };
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  for (const root of document.scenes?.[document.scene ?? 0]?.nodes ?? []) visit(root, identity);
  if (document.animations || document.skins) corners.notes.add("animations and skins are left out");
  return corners.mesh(vertices);
}

// Matrices of glTF: 16 numbers, column by column

function matrixOf({ translation = [0, 0, 0], rotation: [x, y, z, w] = [0, 0, 0, 1], scale = [1, 1, 1] }) {
  const columns = [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
  return [...columns.flatMap((column, axis) => [...column.map((value) => value * scale[axis]), 0]), ...translation, 1];
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
