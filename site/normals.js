// SPDX-License-Identifier: Apache-2.0
// Normals of a depth map: planes of inverse depth in windows, and large planes of the whole map. The steps are those of
// host/colonnade/environment/depth_normals.py.

import { spread } from "./depth.js";

const NOISE_RADIUS = 14;
const [LEAST_RADIUS, MOST_RADIUS] = [2, 11];
const FLAT_SHARE = 0.3;
const LEAST_NOISE = 1e-4;
const SLOPE_ERROR = 0.06;
const CORRELATION = 2.5;
const VOTERS = 4800;
const [MOST_PLANES, LEAST_VOTES] = [128, 20];
const [DEVIATIONS, LEAST_TOLERANCE] = [3, 0.002];
const AGREES = 0.85;

/** View rays of the pixels, with z = 1: three of each. */
export function raysOfLens({ fx, fy, cx, cy }, width, height) {
  const rays = new Float64Array(3 * width * height).fill(1);
  for (let i = 0; i < width * height; ++i) {
    rays[3 * i] = ((i % width) + 0.5 - cx) / fx;
    rays[3 * i + 1] = (Math.floor(i / width) + 0.5 - cy) / fy;
  }
  return rays;
}

/** Unit normals towards the camera, view space, three of each pixel; the noise of the depth, and the number of planes. */
export function normalsOf(depth, holes, lens, width, height) {
  const rays = raysOfLens(lens, width, height);
  const map = { depth, rays, width, height };
  const noise = Math.max(noiseOf(map, holes), LEAST_NOISE);
  const size = Math.sqrt((noise * lens.fx * Math.sqrt(12) * CORRELATION) / SLOPE_ERROR);
  const radius = Math.max(LEAST_RADIUS, Math.min(MOST_RADIUS, Math.round(size / 2)));
  const { local, seen } = planesOf(map, windowsOf(map, holes, radius), lens);
  const planes = largePlanes(map, local, seen, noise);
  const chosen = local.slice();
  const isKnown = seen.slice();
  const narrow = radius >> 1;
  const area = boxSums(new Float64Array(depth.length).fill(1), width, height, narrow);
  const best = new Float64Array(depth.length).fill(0.5);
  for (const plane of planes) {
    const on = Float64Array.from(depth, (value, i) => Number(agrees(plane, value, rays, local, i, noise)));
    boxSums(on, width, height, narrow).forEach((sum, i) => {
      if (sum / area[i] <= best[i]) return;
      best[i] = sum / area[i];
      chosen.set(plane, 3 * i);
      isKnown[i] = 1;
    });
  }
  if (isKnown.some(Boolean)) spread(isKnown.map((value) => 1 - value), width, (to, from) => chosen.copyWithin(3 * to, 3 * from, 3 * from + 3));
  const normals = new Float64Array(chosen.length);
  for (let at = 0; at < normals.length; at += 3) {
    const isAway = -dot3(chosen, at, rays, at) >= 0;
    const from = isAway ? rays : chosen;
    const length = Math.sqrt(dot3(from, at, from, at));
    for (let axis = 0; axis < 3; ++axis) normals[at + axis] = -from[at + axis] / length;
  }
  return { normals, noise, planes: planes.length };
}

const dot3 = (a, i, b, j) => a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2];

/** Sums over square windows that are cut at the border. */
export function boxSums(values, width, height, radius) {
  const along = (from, lines, size, lineStep, step) => {
    const result = new Float64Array(from.length);
    const sums = new Float64Array(size + 1);
    for (let line = 0; line < lines; ++line) {
      const start = line * lineStep;
      for (let i = 0; i < size; ++i) sums[i + 1] = sums[i] + from[start + i * step];
      for (let i = 0; i < size; ++i) result[start + i * step] = sums[Math.min(size, i + radius + 1)] - sums[Math.max(0, i - radius)];
    }
    return result;
  };
  return along(along(values, width, height, 1, width), height, width, width, 1);
}

function noiseOf(map, holes) {
  const windows = windowsOf(map, holes, NOISE_RADIUS);
  const residuals = [];
  eachCentre(map, windows.radius, (i) => {
    if (windows.holes[i] === 0) residuals.push(Math.sqrt(windows.residual[i]) / windows.value[i]);
  });
  return residuals.length === 0 ? 0 : Float64Array.from(residuals).sort()[Math.floor(FLAT_SHARE * (residuals.length - 1))];
}

function eachCentre({ width, height }, radius, use) {
  for (let y = radius; y < height - radius; ++y) for (let x = radius; x < width - radius; ++x) use(y * width + x);
}

/** Planes fitted to inverse depth in the window around each pixel: its value, slopes, mean squared residual, holes. */
function windowsOf(map, holes, wanted) {
  const { depth, width, height } = map;
  const radius = Math.min(wanted, (Math.min(width, height) - 1) >> 1);
  const count = (2 * radius + 1) ** 2;
  const spread = (count * radius * (radius + 1)) / 3;
  const inverse = depth.map((value) => 1 / value);
  const u = (i) => (i % width) - width / 2;
  const v = (i) => Math.floor(i / width) - height / 2;
  const sum = (values) => boxSums(values, width, height, radius);
  const [total, byU, byV, squares] = [inverse, inverse.map((w, i) => w * u(i)), inverse.map((w, i) => w * v(i)), inverse.map((w) => w * w)].map(sum);
  const holeSums = sum(Float64Array.from(holes));
  const [value, across, down, residual, share] = Array.from({ length: 5 }, () => new Float64Array(depth.length));
  eachCentre(map, radius, (i) => {
    value[i] = total[i] / count;
    across[i] = (byU[i] - u(i) * total[i]) / spread;
    down[i] = (byV[i] - v(i) * total[i]) / spread;
    residual[i] = Math.max(0, squares[i] / count - value[i] ** 2 - ((across[i] ** 2 + down[i] ** 2) * spread) / count);
    share[i] = holeSums[i] / count;
  });
  return { radius, value, across, down, residual, holes: share };
}

/** The plane of each pixel's flattest window, and whether it holds enough depth. */
function planesOf({ rays, width, height }, windows, { fx, fy }) {
  const { radius } = windows;
  const local = new Float64Array(rays.length);
  const seen = new Uint8Array(width * height);
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x) {
      let [least, centre] = [Infinity, 0];
      for (const dv of [0, -radius, radius])
        for (const du of [0, -radius, radius]) {
          const row = Math.max(radius, Math.min(height - 1 - radius, y + dv));
          const other = row * width + Math.max(radius, Math.min(width - 1 - radius, x + du));
          const cost = windows.residual[other] * (du === 0 && dv === 0 ? 1 : 1.5) + windows.holes[other];
          if (cost < least) [least, centre] = [cost, other];
        }
      const [a, b] = [windows.across[centre] * fx, windows.down[centre] * fy];
      local.set([a, b, windows.value[centre] - a * rays[3 * centre] - b * rays[3 * centre + 1]], 3 * (y * width + x));
      seen[y * width + x] = Number(windows.holes[centre] < 0.5);
    }
  return { local, seen };
}

/** Planes that many windows agree with, the largest first. */
function largePlanes({ depth, rays, width, height }, local, seen, noise) {
  const step = Math.max(1, Math.round(Math.sqrt(depth.length / VOTERS)));
  const grid = (start, stride) => {
    const pixels = [];
    for (let y = start; y < height; y += stride) for (let x = start; x < width; x += stride) if (seen[y * width + x]) pixels.push(y * width + x);
    return pixels;
  };
  const voters = grid(step >> 1, step);
  const trials = grid(step, 2 * step).map((i) => local.slice(3 * i, 3 * i + 3));
  const supportersOf = (plane) => voters.map((pixel) => Number(agrees(plane, depth[pixel], rays, local, pixel, noise)));
  const supporters = trials.map((plane) => Uint8Array.from(supportersOf(plane)));
  const votes = supporters.map((own) => own.reduce((sum, vote) => sum + vote, 0));
  const isFree = new Uint8Array(voters.length).fill(1);
  const planes = [];
  while (planes.length < MOST_PLANES && trials.length > 0) {
    const first = votes.indexOf(votes.reduce((most, count) => Math.max(most, count), 0));
    if (votes[first] < LEAST_VOTES) break;
    let [plane, found] = [trials[first], supporters[first].map((vote, i) => vote & isFree[i])];
    let count = votes[first];
    for (let round = 0; round < 3 && count >= LEAST_VOTES; ++round) {
      plane = fitted(voters.filter((_, i) => found[i]), depth, rays);
      found = supportersOf(plane).map((vote, i) => vote & isFree[i]);
      count = found.reduce((sum, vote) => sum + vote, 0);
    }
    for (let i = 0; i < voters.length; ++i) {
      if (!isFree[i] || !(found[i] || supporters[first][i])) continue;
      isFree[i] = 0;
      supporters.forEach((own, trial) => (votes[trial] -= own[i]));
    }
    if (count >= LEAST_VOTES) planes.push(plane);
  }
  return planes;
}

/** The plane m with m · p = 1 at points of pixels, by least squares. */
export function fitted(pixels, depth, rays) {
  const matrix = [0, 1, 2].map(() => new Float64Array(4));
  for (const pixel of pixels) {
    const point = [0, 1, 2].map((axis) => rays[3 * pixel + axis] * depth[pixel]);
    for (let i = 0; i < 3; ++i) {
      for (let j = 0; j < 3; ++j) matrix[i][j] += point[i] * point[j];
      matrix[i][3] += point[i];
    }
  }
  for (let i = 0; i < 3; ++i) matrix[i][i] += 1e-9 * pixels.length;
  return solved(matrix);
}

/** The solution of three equations, rows of four. */
function solved(rows) {
  for (let i = 0; i < 3; ++i) {
    const pivot = [i, i + 1, i + 2].filter((j) => j < 3).reduce((a, b) => (Math.abs(rows[b][i]) > Math.abs(rows[a][i]) ? b : a));
    [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
    for (let j = 0; j < 3; ++j) {
      if (j === i) continue;
      const factor = rows[j][i] / rows[i][i];
      for (let k = i; k < 4; ++k) rows[j][k] -= factor * rows[i][k];
    }
  }
  return Float64Array.from(rows, (row, i) => row[3] / row[i]);
}

/** Whether a pixel lies on a plane: by its depth, and by the normal of its window. */
function agrees(plane, depth, rays, local, pixel, noise) {
  const at = 3 * pixel;
  if (!(Math.abs(dot3(plane, 0, rays, at) * depth - 1) < Math.max(DEVIATIONS * noise, LEAST_TOLERANCE))) return false;
  return dot3(local, at, plane, 0) > AGREES * Math.sqrt(dot3(local, at, local, at) * dot3(plane, 0, plane, 0));
}
