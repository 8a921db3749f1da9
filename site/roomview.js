// View files of a visitor's room (docs/driver.md, "The view file"): those of a room of the page, with other words.

const [LIGHTS, GRID, OBJECT, CAMERA, FIRST_LIGHT] = [28, 30, 45, 60, 85];
const LIGHT_WORDS = 11;
const SLOPE_PIXELS = 1024;
/** In a room's words: the maps' grid, lens and pose, the room's box, its tiles. */
const [METRES, LENS, POSE, BOX, TILES] = [1, 7, 15, 30, 49];

/** Writes numbers of a view file. */
class Words {
  constructor(bytes) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  get(word) {
    return this.view.getUint32(4 * word, true);
  }

  set(word, values) {
    values.forEach((value, i) => this.view.setUint32(4 * (word + i), value >>> 0, true));
  }

  /** 2^-32 of a metre or pixel. */
  setWide(word, values) {
    values.forEach((value, i) => this.view.setBigInt64(4 * word + 8 * i, BigInt(Math.round(value * 2 ** 32)), true));
  }

  getFactor(word) {
    return Number(this.view.getBigUint64(4 * word, true)) * 2 ** this.view.getInt32(4 * word + 8, true);
  }

  /** A positive number: mantissa with the top bit set, exponent. */
  setFactor(word, value) {
    let exponent = Math.floor(Math.log2(value)) - 63;
    if (value / 2 ** exponent >= 2 ** 64) ++exponent;
    this.view.setBigUint64(4 * word, BigInt(value / 2 ** exponent), true);
    this.view.setInt32(4 * word + 8, exponent, true);
  }

  setRotation(word, rows) {
    this.set(
      word,
      rows.flat().map((value) => Math.round(value * 2 ** 30)),
    );
  }
}

/** The lens of a photo of so many degrees across, pixels. */
export function lensOf(degrees, { width, height }) {
  const focal = width / (2 * Math.tan((degrees * Math.PI) / 360));
  return { fx: focal, fy: focal, cx: width / 2, cy: height / 2 };
}

/**
 * The view file of a room of a visitor. `template`: that of a room of the page, of the same design and size of a frame,
 * whose object has `templateScale`; `room` as of prepareRoom, with `encoded` and `lamp`, its light in the device's
 * numbers; `object` has position and scale, metres.
 */
export function roomView(template, templateScale, room, object, factor) {
  const bytes = template.slice();
  const words = new Words(bytes);
  const { lens, pose, encoded, lamp } = room;
  const ratio = templateScale / object.scale;
  words.setFactor(GRID, words.getFactor(GRID) * ratio);
  words.setWide(OBJECT, object.position);
  words.setRotation(OBJECT + 6, [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ]);
  words.setWide(CAMERA, pose.position);
  words.setRotation(CAMERA + 6, pose.rotation);
  const own = [lens.fx, lens.fy, lens.cx, lens.cy];
  words.setWide(
    CAMERA + 15,
    own.map((value) => value / factor),
  );
  words.setWide(FIRST_LIGHT, lamp.position);
  words.set(
    FIRST_LIGHT + 6,
    lamp.colour.map((value) => Math.round(value * 2 ** 16)),
  );
  words.setWide(FIRST_LIGHT + 9, [lamp.reach]);
  const at = FIRST_LIGHT + LIGHT_WORDS * words.get(LIGHTS);
  const metres = words.getFactor(at + METRES) / ratio;
  words.set(at, [1]);
  words.setFactor(at + METRES, metres);
  words.setFactor(at + METRES + 3, metres / (SLOPE_PIXELS * encoded.depthUnit));
  words.setWide(at + LENS, own);
  words.setWide(at + POSE, pose.position);
  words.setRotation(at + POSE + 6, pose.rotation);
  const points = room.surface.map(({ point }) => point);
  const limits = [0, 1, 2].map((axis) => points.map((point) => point[axis]));
  words.setWide(
    at + BOX,
    limits.map((values) => Math.min(...values)),
  );
  words.setWide(
    at + BOX + 6,
    limits.map((values) => Math.max(...values)),
  );
  const { error, nearest, furthest } = encoded.tiles;
  error.forEach((value, tile) => {
    const depth = (metres, round) => Math.min(0xffff, round(Math.min(metres * 2 ** 10, 0xffff)));
    const limits = depth(nearest[tile], Math.floor) + 2 ** 16 * depth(furthest[tile], Math.ceil);
    words.set(at + TILES + 2 * tile, [
      limits,
      Math.min(2 ** 24 - 1, Math.ceil((Number.isFinite(value) ? value : 1e6) * 2 ** 16)),
    ]);
  });
  return bytes;
}

/** Registers that the view file has as constants, and that are the visitor's room's. */
export function roomRegisters({ encoded, ambient, light }, { numbers }) {
  const code = Math.min(2 ** numbers.lightBits - 1, Math.round(ambient * 2 ** numbers.lightFraction));
  const gathered = light
    ? { "gather.parallax": light.parallax, "environment.boundingPlanes": 0 }
    : { "environment.boundingPlanes": encoded.boundingPlanes };
  return { "ambient.r": code, "ambient.g": code, "ambient.b": code, "shading.lights": 1, ...gathered };
}
