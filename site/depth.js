// Depth of a visitor: PNG of 16 bits and NumPy files, which a browser does not read by itself; crop, size and holes as
// `colonnade capture` has them (docs/captures.md).

const SIGNATURE = [137, 80, 78, 71, 13, 10, 26, 10];
const MOST_EDGE = 8192;
const MOST_HOLES = 0.5;

/** Reads depth, metres: {width, height, values}; 0 is a hole. `step`: metres of a step of a PNG. */
export async function readDepth(name, bytes, step) {
  const isPng = SIGNATURE.every((byte, index) => bytes[index] === byte);
  const isNumpy = bytes[0] === 0x93 && String.fromCharCode(...bytes.subarray(1, 6)) === "NUMPY";
  if (!isPng && !isNumpy) throw new Error(`${name} is no depth map: it has to be a grey PNG of 16 bits, or a .npy`);
  let depth;
  try {
    depth = isPng ? await readPng(bytes, step) : readNumpy(bytes);
  } catch (error) {
    throw new Error(error instanceof Refusal ? `${name} ${error.message}` : `${name} is damaged, or no depth map`);
  }
  return depth;
}

/** What is wrong with a file, for the visitor. */
class Refusal extends Error {}

function checkSize(width, height) {
  if (!(width >= 16 && height >= 16 && width <= MOST_EDGE && height <= MOST_EDGE))
    throw new Refusal(`is ${width} × ${height}: a depth map has 16 to ${MOST_EDGE} pixels a side`);
}

async function readPng(bytes, step) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const parts = [];
  let head;
  for (let at = 8; at + 12 <= bytes.length; ) {
    const length = view.getUint32(at);
    const kind = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    if (kind === "IHDR")
      head = {
        width: view.getUint32(at + 8),
        height: view.getUint32(at + 12),
        bits: bytes[at + 16],
        colour: bytes[at + 17],
        interlace: bytes[at + 20],
      };
    if (kind === "IDAT") parts.push(bytes.subarray(at + 8, at + 8 + length));
    at += 12 + length;
  }
  const { width, height, bits, colour, interlace } = head;
  if (colour !== 0 || bits !== 16)
    throw new Refusal(`has ${colour === 0 ? "grey" : "colours"} of ${bits} bits: depth is grey of 16 bits`);
  if (interlace !== 0) throw new Refusal("is interlaced: save it without interlacing");
  checkSize(width, height);
  const stride = 2 * width;
  const lines = new Uint8Array(
    await new Response(new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer(),
  );
  if (lines.length < height * (stride + 1)) throw new Error("truncated");
  const values = new Float64Array(width * height);
  let above = new Uint8Array(stride);
  for (let y = 0; y < height; ++y) {
    const line = lines.subarray(y * (stride + 1) + 1, (y + 1) * (stride + 1));
    unfilter(lines[y * (stride + 1)], line, above);
    for (let x = 0; x < width; ++x) values[y * width + x] = step * (256 * line[2 * x] + line[2 * x + 1]);
    above = line;
  }
  return { width, height, values };
}

/** Undoes the filter of a line of samples of two bytes. */
function unfilter(filter, line, above) {
  for (let i = 0; i < line.length; ++i) {
    const [left, up, corner] = [i < 2 ? 0 : line[i - 2], above[i], i < 2 ? 0 : above[i - 2]];
    const distances = [up - corner, left - corner, left + up - 2 * corner].map(Math.abs);
    const least = Math.min(...distances);
    const paeth = distances[0] === least ? left : distances[1] === least ? up : corner;
    line[i] += [0, left, up, (left + up) >> 1, paeth][filter];
  }
}

function readNumpy(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const isLong = bytes[6] > 1;
  const start = isLong ? 12 : 10;
  const length = isLong ? view.getUint32(8, true) : view.getUint16(8, true);
  const head = new TextDecoder("latin1").decode(bytes.subarray(start, start + length));
  const kind = /'descr': *'([^']+)'/.exec(head)[1];
  const shape = /'shape': *\((\d+), *(\d+),?\)/.exec(head);
  const Values = { "<f2": null, "<f4": Float32Array, "<f8": Float64Array }[kind];
  if (!Values) throw new Refusal(`has samples ${kind}: a .npy of depth has metres as <f4 or <f8`);
  if (/'fortran_order': *True/.test(head) || !shape) throw new Refusal("is no array of rows and columns");
  const [height, width] = [Number(shape[1]), Number(shape[2])];
  checkSize(width, height);
  const content = bytes.slice(start + length, start + length + width * height * Values.BYTES_PER_ELEMENT);
  return { width, height, values: Float64Array.from(new Values(content.buffer, 0, width * height)) };
}

/** The part of a photo that the maps show, its pixels, and their size there: the largest one around the middle. */
export function cropOf(photo, width, height) {
  const scale = Math.min(photo.width / width, photo.height / height);
  return { left: (photo.width - scale * width) / 2, top: (photo.height - scale * height) / 2, scale };
}

/** Fills holes, in place, from the nearest pixel; returns which they were. */
export function fillHoles(library, depth, width) {
  const holes = Uint8Array.from(depth, (value) => Number(!(value > 0)));
  const count = holes.reduce((sum, hole) => sum + hole, 0);
  if (count > MOST_HOLES * depth.length)
    throw new Error(
      `${Math.round((100 * count) / depth.length)} % of the depth map have no depth: it needs half of the pixels`,
    );
  library.nearest(holes, width).forEach((from, to) => (depth[to] = depth[from]));
  return { holes, count };
}
