// Cycles of single pixels of the page's first view, recorded from the RTL of presets (tools/browser/record.py).

import { START } from "./camera.js";
import { DEFAULTS } from "./state.js";

/** A view's frame of one of its pixels alone. */
export const ofPixel = (view, { x, y, width, height }) => ({
  ...view,
  camera: { ...view.camera, width: 1, height: 1, centre: [width / 2 - x, height / 2 - y] },
});

/** Whether a state's view and shading are those of the recording. */
export const isRecorded = (state, orbit) =>
  ["mesh", "room", "material", "light", "shadows"].every((name) => state[name] === DEFAULTS[name]) &&
  Object.entries(START).every(([name, value]) => orbit[name] === value);

/** The counters, by name, of the recorded pixel that is nearest to one of another size of the frame. */
export function nearestPixel({ width, height, pixels, counters, values }, followed) {
  const tangents = ([x, y], size) =>
    [x + 0.5 - size.width / 2, y + 0.5 - size.height / 2].map((value) => value / Math.min(size.width, size.height));
  const own = tangents([followed.x, followed.y], followed);
  const distances = pixels.map((pixel) =>
    Math.hypot(...tangents(pixel, { width, height }).map((value, axis) => value - own[axis])),
  );
  const index = distances.indexOf(Math.min(...distances));
  return Object.fromEntries(counters.map((name, i) => [name, values[index][i]]));
}
