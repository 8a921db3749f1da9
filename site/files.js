// The files of a visitor's room: photo, depth map and, in a room of `colonnade capture`, meta.json with camera and
// pose.

const PICTURE = /\.(jpe?g|png|webp)$/i;

/** Whether bytes are a grey PNG of 16 bits, as depth is. */
const isGrey16 = (bytes) => bytes.length > 25 && bytes[1] === 0x50 && bytes[24] === 16 && bytes[25] === 0;

/** The photo, the depth and the camera's file among files by name; null if they hold neither of the first two. */
export function roomFiles(files) {
  const names = [...files.keys()];
  const depth = names.find((name) => /\.npy$/i.test(name) || (/\.png$/i.test(name) && isGrey16(files.get(name))));
  const pictures = names.filter(
    (name) => PICTURE.test(name) && name !== depth && !/^(albedo|normal)\.png$/i.test(name),
  );
  if (depth === undefined && pictures.length === 0) return null;
  if (depth === undefined)
    throw new Error(
      `${pictures[0]} is a photo without depth: drop a depth map with it, a grey PNG of 16 bits or a .npy`,
    );
  if (pictures.length === 0) throw new Error(`${depth} is a depth map without its photo: drop both together`);
  const photo = pictures.find((name) => /^(photo|render)\./i.test(name)) ?? pictures[0];
  const ignored = [
    ...pictures.filter((name) => name !== photo),
    ...names.filter((name) => /^(albedo|normal)\.png$/i.test(name)),
  ];
  return { photo, depth, meta: files.has("meta.json") ? files.get("meta.json") : null, ignored };
}

/** Lens, pixels of the photo, pose and step of depth, metres, of a meta.json (docs/background.md). */
export function readMeta(bytes, { width, height }) {
  let meta;
  try {
    meta = JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    throw new Error("meta.json is no JSON");
  }
  const lens = Object.fromEntries(["fx", "fy", "cx", "cy"].map((name) => [name, meta[name]]));
  if (!Object.values(lens).every(Number.isFinite) || !(lens.fx >= 1 && lens.fy >= 1))
    throw new Error("meta.json lacks fx, fy, cx or cy, pixels");
  if ((meta.width ?? width) !== width || (meta.height ?? height) !== height)
    throw new Error(`the photo is ${width} × ${height} pixels, meta.json says ${meta.width} × ${meta.height}`);
  const rows = meta.cam_to_world;
  const isPose =
    Array.isArray(rows) &&
    [0, 1, 2].every((i) => Array.isArray(rows[i]) && rows[i].length === 4 && rows[i].every(Number.isFinite));
  if (rows !== undefined && !isPose) throw new Error("meta.json: cam_to_world is not 4 rows of 4 numbers");
  const step = meta.depth_step ?? 0.001;
  if (!(step >= 1e-6 && step <= 1000))
    throw new Error("meta.json: depth_step must be the metres per step of the depth map, 1e-6 to 1000");
  return {
    lens,
    step,
    pose: isPose
      ? {
          rotation: unitAxes(rows.slice(0, 3).map((row) => row.slice(0, 3))),
          position: [0, 1, 2].map((i) => rows[i][3]),
        }
      : null,
  };
}

/** A rotation from a matrix that is nearly one. */
function unitAxes(rotation) {
  for (let round = 0; round < 3; ++round) {
    const square = rotation.map((a) => rotation.map((b) => a.reduce((sum, value, i) => sum + value * b[i], 0)));
    rotation = rotation.map((row, i) =>
      row.map((value, j) => 1.5 * value - 0.5 * square[i].reduce((sum, factor, k) => sum + factor * rotation[k][j], 0)),
    );
  }
  if (!rotation.flat().every((value) => Math.abs(value) <= 1.001))
    throw new Error("meta.json: the axes of cam_to_world are not unit and at right angles");
  return rotation;
}

/** All files of a drop, also those of a dropped folder, by name. */
export async function droppedFiles({ items, files }) {
  const entries = [...items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry?.isDirectory);
  const found = [...files].filter(({ name }) => !entries.some((entry) => entry.name === name));
  for (const entry of entries) {
    const reader = entry.createReader();
    for (let part = /** @type {any[]} */ ([1]); part.length > 0; ) {
      part = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      for (const each of part)
        if (each.isFile) found.push(await new Promise((resolve, reject) => each.file(resolve, reject)));
    }
  }
  return found;
}
