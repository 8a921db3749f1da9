// The document of a glTF file by the reader in C++ (host/cpp/mesh/files), which the command line shares.

import { ended, fileOf } from "./polygons.js";

export const DRACO = "KHR_draco_mesh_compression";
/** Extensions that compress the mesh, and are not supported. */
export const COMPRESSION = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const [FOUND, REFUSED, NEEDS_BUFFER] = [0, 1, 2];
export const grouped = (number) => number.toLocaleString("en");

/** The document of a file, text or binary, and the arrays of its accessors; one at a time. */
export class GltfDocument {
  library;
  name;
  files;
  json;

  /** `files` has the other dropped files by name. */
  constructor(library, bytes, name, files) {
    Object.assign(this, { library, name, files });
    const [json] = library.withArrays([ended(name), bytes, new Uint32Array(2)], (own, content, out) => {
      library.check(library.wasm.colonnade_gltf_begin(own, content, bytes.length, out));
      return [this.bytesAt(out)];
    });
    this.json = JSON.parse(new TextDecoder().decode(json));
  }

  error(reason) {
    return new Error(`mesh ${this.name}: ${reason}`);
  }

  /** The error of a file whose meshes an extension compresses. */
  compressed(extension) {
    return this.error(`its meshes are compressed (${extension}): export it without compression`);
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
    this.entry("accessors", index);
    return this.library.withArrays([new Uint32Array(4)], (out) => {
      this.ask(() => this.library.wasm.colonnade_gltf_array(index, out));
      const [count, width, isWhole, values] = new Uint32Array(this.library.wasm.memory.buffer, out, 4);
      const own = new Float64Array(this.library.wasm.memory.buffer, values, count * width).slice();
      return { count, width, isWhole: isWhole !== 0, values: own };
    });
  }

  /** The bytes of an image; null if its file is missing. */
  image(index) {
    this.entry("images", index);
    return this.library.withArrays([new Uint32Array(2)], (out) =>
      this.ask(() => this.library.wasm.colonnade_gltf_image(index, out)) === FOUND ? this.bytesAt(out) : this.file()[1],
    );
  }

  /** All nodes: parents, order, matrices row by row to the parents, translations, rotations and scales. */
  nodes() {
    const { wasm } = this.library;
    return this.library.withArrays([new Uint32Array(7)], (out) => {
      this.library.check(wasm.colonnade_gltf_nodes(out));
      const [count, parents, order, ...parts] = new Uint32Array(wasm.memory.buffer, out, 7);
      const whole = (from) => Int32Array.from(new BigInt64Array(wasm.memory.buffer, from, count), Number);
      const real = (from, i) => new Float64Array(wasm.memory.buffer, from, [16, 3, 4, 3][i] * count).slice();
      return [whole(parents), whole(order), ...parts.map(real)];
    });
  }

  /**
   * The numbers of the nodes with a mesh of the default scene, and the matrices of their copies to it, row by row; a
   * node that is animated has one. `notes` take what is lost.
   */
  placements(isAnimated, notes) {
    const { wasm } = this.library;
    return this.library.withArrays([new Uint32Array(4)], (out) => {
      this.ask(() => wasm.colonnade_gltf_placements(Number(isAnimated), out));
      const [count, nodes, counts, matrices] = new Uint32Array(wasm.memory.buffer, out, 4);
      let at = matrices;
      const next = () => new Float64Array(wasm.memory.buffer, (at += 128) - 128, 16).slice();
      const sizes = new Int32Array(wasm.memory.buffer, counts, count);
      const found = Array.from(new Int32Array(wasm.memory.buffer, nodes, count), (index, i) => ({
        index,
        matrices: Array.from({ length: sizes[i] }, next),
      }));
      let line = 0;
      for (let note = wasm.colonnade_gltf_note(line); note !== 0; note = wasm.colonnade_gltf_note(++line))
        notes.add(this.library.text(note));
      return found;
    });
  }

  /** The state of a request when it has the buffers that it needs. */
  ask(request) {
    for (let state = request(); ; state = request()) {
      if (state === REFUSED) this.library.check(this.library.wasm.colonnade_gltf_text());
      if (state !== NEEDS_BUFFER) return state;
      const [, bytes] = this.file();
      this.library.withArrays([bytes], (given) =>
        this.library.check(this.library.wasm.colonnade_gltf_give(given, bytes?.length ?? 0)),
      );
    }
  }

  /** The dropped file that the reader names. */
  file() {
    return fileOf(this.files, this.library.text(this.library.wasm.colonnade_gltf_text()));
  }

  /** A copy of the bytes at an address. */
  bytesAt(out) {
    const [first, count] = new Uint32Array(this.library.wasm.memory.buffer, out, 2);
    return new Uint8Array(this.library.wasm.memory.buffer, first, count).slice();
  }
}
