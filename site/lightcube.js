// SPDX-License-Identifier: Apache-2.0
// The light cube of an object in a room (docs/gather.md, "Light cube"). Radiance by direction is a Float64Array of 6 faces
// of FINE × FINE texels, red, green and blue, in the axes of the world.

const [SIZE, FINE, SUBSAMPLES] = [16, 32, 4];
const [ONE, MANTISSA, LAST_EXPONENT] = [4096, 127, 9];
const WORD = 4;
/** Pixels of a texel that are farther than its nearest one by this factor are behind it. */
const BEHIND = 1.1;
/** Of the room's box: margins around what the camera sees, and the distance of a point to its walls, metres. */
const [MARGINS, INSIDE] = [[1, 0.5, 1.5], 0.1];
const LAST_PARALLAX = 3;

/** The direction through a place of a face of so many texels across, and its weight by solid angle. */
function directionOf(face, row, column, size) {
  const slopes = [row, column].map((index) => (index + 0.5) * (2 / size) - 1);
  const squares = 1 + slopes[0] ** 2 + slopes[1] ** 2;
  const length = Math.sqrt(squares);
  const axis = face >> 1;
  const direction = [0, 0, 0];
  direction[axis] = (1 - 2 * (face & 1)) / length;
  direction[(axis + 1) % 3] = slopes[0] / length;
  direction[(axis + 2) % 3] = slopes[1] / length;
  return { direction, weight: 1 / (squares * length) };
}

/** The texel that a direction of any length meets. */
function texelOf(direction, size) {
  const lengths = direction.map(Math.abs);
  const axis = lengths.indexOf(Math.max(...lengths));
  let index = 2 * axis + Number(direction[axis] < 0);
  for (const next of [1, 2]) {
    const slope = direction[(axis + next) % 3] / lengths[axis];
    index = index * size + Math.max(0, Math.min(size - 1, Math.floor((slope + 1) * (size / 2))));
  }
  return index;
}

const texels = Array.from({ length: 6 * FINE * FINE }, (_, index) => directionOf(Math.floor(index / FINE ** 2), Math.floor(index / FINE) % FINE, index % FINE, FINE));

/** The radiance that words of a cube hold. */
export function radianceOf(words) {
  const view = new DataView(words.buffer, words.byteOffset, words.byteLength);
  return Float64Array.from({ length: (3 * words.length) / WORD }, (_, i) => {
    const word = view.getUint32(WORD * Math.floor(i / 3), true);
    return (((word >> (14 - 7 * (i % 3))) & MANTISSA) << ((word >> 21) & 15)) / ONE;
  });
}

/** To the nearest integer, halves to even ones. */
function rounded(value) {
  const nearest = Math.round(value);
  return nearest - value === 0.5 && nearest % 2 !== 0 ? nearest - 1 : nearest;
}

/** The words of the device's cube for an object: world = rotation · its own axes. Each texel has the mean of its solid angle. */
export function cubeWords(radiance, rotation) {
  const words = new DataView(new ArrayBuffer(6 * SIZE * SIZE * WORD));
  for (let texel = 0; texel < 6 * SIZE * SIZE; ++texel) {
    const [face, row, column] = [Math.floor(texel / SIZE ** 2), Math.floor(texel / SIZE) % SIZE, texel % SIZE];
    const sums = [0, 0, 0];
    let total = 0;
    for (let sub = 0; sub < SUBSAMPLES ** 2; ++sub) {
      const { direction, weight } = directionOf(face, SUBSAMPLES * row + Math.floor(sub / SUBSAMPLES), SUBSAMPLES * column + (sub % SUBSAMPLES), SUBSAMPLES * SIZE);
      const met = texelOf(rotation.map((axis) => axis[0] * direction[0] + axis[1] * direction[1] + axis[2] * direction[2]), FINE);
      for (let channel = 0; channel < 3; ++channel) sums[channel] += weight * radiance[3 * met + channel];
      total += weight;
    }
    const fixed = sums.map((sum) => (ONE * sum) / total);
    let exponent = 0;
    while (exponent < LAST_EXPONENT && rounded(Math.max(...fixed) / 2 ** exponent) > MANTISSA) ++exponent;
    const word = fixed.reduce((word, value) => (word << 7) | Math.min(MANTISSA, rounded(value / 2 ** exponent)), exponent);
    words.setUint32(WORD * texel, word, true);
  }
  return new Uint8Array(words.buffer);
}

/**
 * The light of a photo around a point, where its surface is seen from there, and its mean elsewhere. `surface` has points,
 * normals and linear colours of the photo's pixels, Float32Array, three each, in the world.
 */
export function seenLight({ points, normals, colours }, middle) {
  const nearest = new Float64Array(texels.length).fill(Infinity);
  const found = [];
  for (let at = 0; at < points.length; at += 3) {
    const way = middle.map((value, axis) => points[at + axis] - value);
    if (way[0] * normals[at] + way[1] * normals[at + 1] + way[2] * normals[at + 2] >= 0) continue;
    const [texel, distance] = [texelOf(way, FINE), Math.hypot(...way)];
    nearest[texel] = Math.min(nearest[texel], distance);
    found.push([at, texel, distance]);
  }
  const radiance = new Float64Array(3 * texels.length);
  const counts = new Uint32Array(texels.length);
  for (const [at, texel, distance] of found) {
    if (distance > BEHIND * nearest[texel]) continue;
    ++counts[texel];
    for (let channel = 0; channel < 3; ++channel) radiance[3 * texel + channel] += colours[at + channel];
  }
  const [sums, all] = [[0, 0, 0], texels.reduce((sum, { weight }) => sum + weight, 0)];
  let seen = 0;
  counts.forEach((count, texel) => {
    if (count === 0) return;
    seen += texels[texel].weight;
    for (let channel = 0; channel < 3; ++channel) sums[channel] += texels[texel].weight * (radiance[3 * texel + channel] /= count);
  });
  counts.forEach((count, texel) => {
    if (count === 0) for (let channel = 0; channel < 3; ++channel) radiance[3 * texel + channel] = seen > 0 ? sums[channel] / seen : 0;
  });
  return { radiance, share: seen / all };
}

/** The register `gather.parallax`: what a point sees is at the median distance of the box around a room; `edge` of the object's cube. */
export function parallaxOf({ points }, eye, middle, edge) {
  const axes = [0, 1, 2].map((axis) => points.filter((_, index) => index % 3 === axis).sort());
  const [low, high] = [0.02, 0.98].map((share) => axes.map((values) => values[Math.min(values.length - 1, Math.round(share * (values.length - 1)))]));
  const floor = low[1];
  for (let axis = 0; axis < 3; ++axis) {
    low[axis] = axis === 1 ? floor : Math.min(low[axis], eye[axis]) - MARGINS[axis];
    high[axis] = Math.max(high[axis], eye[axis]) + MARGINS[axis];
  }
  const inside = middle.map((value, axis) => Math.max(low[axis] + INSIDE, Math.min(high[axis] - INSIDE, value)));
  const distances = texels.map(({ direction, weight }) => {
    const steps = direction.map((value, axis) => (value > 0 ? high[axis] - inside[axis] : inside[axis] - low[axis]) / Math.abs(value));
    return [Math.min(...steps) * Math.max(...direction.map(Math.abs)), weight];
  });
  distances.sort(([a], [b]) => a - b);
  let left = distances.reduce((sum, [, weight]) => sum + weight, 0) / 2;
  const median = distances.find(([, weight]) => (left -= weight) <= 0)[0];
  for (let parallax = 1; parallax <= LAST_PARALLAX; ++parallax) if (median < edge * 2 ** (parallax - 1) * Math.SQRT2) return parallax;
  return 0;
}
