// The document of a glTF file: its JSON, its buffers, and the arrays of its accessors; it refuses what
// host/colonnade/mesh/files/gltf_document.py refuses, in its words.

import { checkDocument, parseDocument } from "./gltfchecks.js";

const COMPONENTS = new Map([
  [5120, { size: 1, read: "getInt8", most: 127 }],
  [5121, { size: 1, read: "getUint8", most: 255 }],
  [5122, { size: 2, read: "getInt16", most: 32767 }],
  [5123, { size: 2, read: "getUint16", most: 65535 }],
  [5125, { size: 4, read: "getUint32", most: 2 ** 32 - 1 }],
  [5126, { size: 4, read: "getFloat32", most: null }],
]);
const WIDTHS = new Map([
  ["SCALAR", 1],
  ["VEC2", 2],
  ["VEC3", 3],
  ["VEC4", 4],
  ["MAT4", 16],
]);

/** Extensions that compress the mesh, and are not supported. */
export const COMPRESSION = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
export const grouped = (number) => number.toLocaleString("en");

/** The document of a file, text or binary, its buffers, and the arrays of its accessors. */
export class GltfDocument {
  name;
  files;
  binary;
  buffers;

  constructor(bytes, name, files) {
    Object.assign(this, { name, files, binary: null, buffers: new Map() });
    const isBinary = this.text(bytes, 0) === "glTF";
    this.json = parseDocument(
      isBinary ? this.chunks(bytes) : bytes,
      `${name} cannot be read as a mesh: its glTF document`,
    );
    checkDocument(this.json, name);
  }

  error(reason) {
    return new Error(`mesh ${this.name}: ${reason}`);
  }

  /** The error of a file whose meshes an extension compresses. */
  compressed(extension) {
    return this.error(`its meshes are compressed (${extension}): export it without compression`);
  }

  /** Four characters. */
  text(bytes, at) {
    return String.fromCharCode(...bytes.subarray(at, at + 4));
  }

  /** The JSON of a binary file; `binary` has the chunk after it. */
  chunks(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    if (bytes.length >= 12 && view.getUint32(4, true) === 1)
      throw new Error(`${this.name} cannot be read as a mesh: it is glTF of version 1: export it as glTF 2.0`);
    const chunks = [];
    for (let at = 12; at + 8 <= bytes.length && chunks.length < 2; at = chunks.at(-1).end) {
      const [length, begin] = [view.getUint32(at, true), at + 8];
      if (begin + length > bytes.length)
        throw new Error(
          `mesh ${this.name} is truncated: a part of ${grouped(length)} bytes begins, ` +
            `${grouped(bytes.length - begin)} follow`,
        );
      chunks.push({
        kind: this.text(bytes, at + 4),
        end: begin + length,
        content: bytes.subarray(begin, begin + length),
      });
    }
    if (chunks[0]?.kind !== "JSON")
      throw new Error(`${this.name} cannot be read as a mesh: it is not a binary glTF file of version 2`);
    if (chunks[1]?.kind === "BIN\0") this.binary = chunks[1].content;
    return chunks[0].content;
  }

  /** An entry of one of the document's lists. */
  entry(kind, index) {
    const found = Number.isInteger(index) ? this.json[kind]?.[index] : undefined;
    if (found === undefined)
      throw this.error(`${kind}[${index ?? "None"}] is used, but does not exist: export it again`);
    return found;
  }

  /**
   * The elements of an accessor: their number, its components, whether they are integers, and their values one after
   * the other.
   */
  array(index) {
    const {
      bufferView,
      byteOffset = 0,
      componentType,
      count,
      type,
      normalized,
      sparse,
    } = this.entry("accessors", index);
    const [component, width] = [COMPONENTS.get(componentType), WIDTHS.get(type)];
    if (!component || !width) throw this.error(`accessor ${index} has an unknown type`);
    if (bufferView === undefined && !sparse)
      throw this.error(`accessor ${index} has no data, as of a compressed mesh: export it without compression`);
    const values =
      bufferView === undefined
        ? new Float64Array(count * width)
        : this.view(bufferView, byteOffset, component, count, width);
    if (sparse) {
      const rows = this.view(
        sparse.indices.bufferView,
        sparse.indices.byteOffset ?? 0,
        COMPONENTS.get(sparse.indices.componentType),
        sparse.count,
        1,
      );
      const last = rows.reduce((most, row) => Math.max(most, row), 0);
      if (rows.length > 0 && last >= count)
        throw this.error(`a sparse accessor changes element ${last} of ${grouped(count)}`);
      const changed = this.view(
        sparse.values.bufferView,
        sparse.values.byteOffset ?? 0,
        component,
        sparse.count,
        width,
      );
      rows.forEach((row, i) => values.set(changed.subarray(width * i, width * (i + 1)), width * row));
    }
    const isScaled = normalized && component.most;
    return {
      count,
      width,
      isWhole: component.most !== null && !isScaled,
      values: isScaled ? values.map((value) => Math.max(value / component.most, -1)) : values,
    };
  }

  /** The numbers of elements of a buffer view. */
  view(index, offset, { size, read }, count, width) {
    const { buffer, byteOffset = 0, byteLength = 0, byteStride } = this.entry("bufferViews", index);
    const bytes = this.buffer(buffer);
    const [start, element] = [byteOffset + offset, size * width];
    const stride = byteStride || element;
    if (stride < element || start + (count - 1) * stride + element > Math.min(bytes.length, byteOffset + byteLength))
      throw this.error(`bufferViews[${index}] is too short for ${grouped(count)} elements: the file may be truncated`);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    return Float64Array.from({ length: count * width }, (_, i) =>
      view[read](start + stride * Math.floor(i / width) + size * (i % width), true),
    );
  }

  buffer(index) {
    const { uri, extensions = {} } = this.entry("buffers", index);
    const compression = COMPRESSION.find((name) => uri === undefined && name in extensions);
    if (compression) throw this.compressed(compression);
    if (!this.buffers.has(index)) this.buffers.set(index, this.content(index, uri));
    return this.buffers.get(index);
  }

  content(index, uri) {
    if (uri === undefined && index === 0 && this.binary) return this.binary;
    if (uri === undefined) throw this.error(`buffer ${index} has no data`);
    const found = this.file(uri, `buffer ${index}`);
    if (!found) throw this.error(`its buffer ${uri} is missing: drop it together with the mesh`);
    return found;
  }

  /** The bytes of a URI: embedded, or of a dropped file, or undefined; `what` it is, for messages. */
  file(uri, what) {
    if (!uri.startsWith("data:")) return this.files.get(unquoted(uri).split("/").pop());
    const code = uri.slice(uri.indexOf(",") + 1);
    if (!uri.includes(",") || code.length % 4 !== 0 || !/^[A-Za-z0-9+/]*={0,2}$/.test(code))
      throw this.error(`the data of ${what} are not base64`);
    return Uint8Array.from(atob(code), (character) => character.charCodeAt(0));
  }
}

function unquoted(uri) {
  try {
    return decodeURIComponent(uri);
  } catch {
    return uri;
  }
}
