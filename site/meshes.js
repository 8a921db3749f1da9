// Readers of mesh files: those in C++ (polygons.js) and glTF (gltf.js). What a file holds and they leave out is a note.

import { readGltf } from "./gltf.js";
import { readPolygons, teapot } from "./polygons.js";
import { decodePictures, decodedPicture } from "./surfaces.js";

/**
 * A mesh: Float64Array vertices, Int32Array faces, normals and colours of the corners (Float64Array or null), notes; of
 * a glTF file the names of its animations, and the number and the clip of one of them, null for none; the first, unless
 * `animation` is given. `files` has those that were dropped with it, by name; without bytes it is the teapot;
 * `decodePicture` answers the pixels of a picture's bytes.
 */
export async function readMesh(
  library,
  name,
  bytes,
  files = new Map(),
  animation = undefined,
  decodePicture = decodedPicture,
) {
  const suffix = name.toLowerCase().split(".").pop();
  if (!["obj", "ply", "stl", "off", "glb", "gltf"].includes(suffix))
    throw new Error(`${name}: only OBJ, PLY, STL, OFF, glTF and GLB are read here; the command line reads more`);
  if (bytes === null) return { name, animations: [], animation: null, clip: null, ...teapot(library) };
  if (bytes.length === 0) throw new Error(`mesh file ${name} is empty`);
  let mesh;
  try {
    mesh = suffix.startsWith("gl")
      ? await decodePictures(readGltf(library, bytes, name, files, animation), decodePicture)
      : await readPolygons(library, suffix, bytes, name, files, decodePicture);
  } catch (error) {
    // What the language throws on wrong offsets, lengths and fields
    const isDamaged = [RangeError, TypeError, SyntaxError].some((kind) => error instanceof kind);
    throw isDamaged ? new Error(`${name} is damaged, or no ${suffix.toUpperCase()} file`) : error;
  }
  if (mesh.faces.length === 0)
    throw new Error(`mesh ${name} has no faces: ${mesh.notes.join("; ") || "it holds no polygons"}`);
  return { name, animations: [], animation: null, clip: null, ...mesh };
}
