// sRGB, and a room's photo in the size of a frame.

export const decode = (code) => (code <= 0.04045 * 255 ? code / 255 / 12.92 : ((code / 255 + 0.055) / 1.055) ** 2.4);
export const encode = (value) =>
  Math.round(255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));

/** The sRGB bytes of a photo, red, green and blue of each pixel, in the size of a frame: means of its pixels. */
export function resizedPhoto({ data, width, height }, factor) {
  const size = [width / factor, height / factor];
  const result = new Uint8Array(3 * size[0] * size[1]);
  for (let y = 0; y < size[1]; ++y)
    for (let x = 0; x < size[0]; ++x)
      for (let channel = 0; channel < 3; ++channel) {
        let sum = 0;
        for (let v = 0; v < factor; ++v)
          for (let u = 0; u < factor; ++u) sum += data[4 * ((factor * y + v) * width + factor * x + u) + channel];
        result[3 * (size[0] * y + x) + channel] = Math.floor(sum / factor ** 2 + 0.5);
      }
  return result;
}
