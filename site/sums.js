// Sums over the passes of a frame, and what they show (docs/sampling.md, "Sums").

import { decode, encode } from "./photo.js";

const UNSHADOWED = 4096;
const STEPS = 65535;

const sRgb = Uint8ClampedArray.from({ length: STEPS + 1 }, (_, value) => encode(value / STEPS));
const photoLinear = Float64Array.from({ length: 256 }, (_, code) => decode(code));

/** The sRGB code of a linear colour. */
export const codeOf = (value) => sRgb[Math.min(STEPS, Math.round(STEPS * value))];

export class Sums {
  white;
  photo;
  samples;

  /**
   * Of a frame of so many pixels; `white` is the device's number for the colour 1.0. `photo`: sRGB, three bytes a
   * pixel, or null.
   */
  constructor(pixels, white, photo) {
    Object.assign(this, { white, photo, samples: 0 });
    this.objects = new Uint32Array(3 * pixels);
    this.others = new Uint32Array(3 * pixels);
  }

  /** Adds rows of the pass that `samples` counts, from the pixel `first` on. */
  add({ colours, ratios, triangles }, first) {
    triangles.forEach((triangle, i) => {
      const isObject = triangle >= 0;
      const [sums, values] = isObject ? [this.objects, colours] : [this.others, this.photo ? ratios : colours];
      for (let channel = 0; channel < 3; ++channel) sums[3 * (first + i) + channel] += values[3 * i + channel];
    });
  }

  /** Pixels from `first` to before `last` as a browser draws them, RGBA. */
  shown(first, last) {
    const pixels = new Uint8ClampedArray(4 * (last - first)).fill(255);
    const unshadowed = this.samples * UNSHADOWED;
    for (let i = first; i < last; ++i)
      for (let channel = 0; channel < 3; ++channel) {
        const at = 3 * i + channel;
        const [object, other] = [this.objects[at], this.others[at]];
        let code;
        if (!this.photo) code = codeOf((object + other) / this.white / this.samples);
        else if (object === 0 && other === unshadowed) code = this.photo[at];
        else code = codeOf((object / this.white + (photoLinear[this.photo[at]] * other) / UNSHADOWED) / this.samples);
        pixels[4 * (i - first) + channel] = code;
      }
    return pixels;
  }
}
