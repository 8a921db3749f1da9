// Readers of OBJ, PLY and glTF (gltf.js): positions, triangles, corner normals and corner colours. What a file holds and
// they leave out is a note.

import { Corners } from "./corners.js";
import { readGltf } from "./gltf.js";

/**
 * A mesh: Float64Array vertices, Int32Array faces, normals and colours of the corners (Float64Array or null), notes; of a glTF file the
 * names of its animations, and the number and the clip of one of them, null for none; the first, unless `animation` is given.
 */
export function readMesh(name, bytes, files = new Map(), animation = undefined) {
  const suffix = name.toLowerCase().split(".").pop();
  const reader = new Map(Object.entries({ obj: readObj, ply: readPly, glb: readGltf, gltf: readGltf })).get(suffix);
  if (!reader) throw new Error(`${name}: only OBJ, PLY, glTF and GLB are read here; the command line reads more`);
  if (bytes.length === 0) throw new Error(`mesh file ${name} is empty`);
  let mesh;
  try {
    mesh = reader(bytes, name, files, animation);
  } catch (error) {
    // What the language throws on wrong offsets, lengths and fields
    const isDamaged = [RangeError, TypeError, SyntaxError].some((kind) => error instanceof kind);
    throw isDamaged ? new Error(`${name} is damaged, or no ${suffix.toUpperCase()} file`) : error;
  }
  if (mesh.faces.length === 0) throw new Error(`mesh ${name} has no faces: ${mesh.notes.join("; ") || "it holds no polygons"}`);
  return { name, animations: [], animation: null, clip: null, ...mesh };
}

const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);

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
