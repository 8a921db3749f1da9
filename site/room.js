// A room of a visitor's photo and depth: pose, light and maps, as the host finds them
// (docs/background.md), but one white lamp and no shadows of the photo.

import { cropOf, fillHoles } from "./depth.js";
import { decode, encode } from "./photo.js";

/** Points that tell floor and light, of a map's pixels every so many across and down. */
const STEP = 11;
const [HYPOTHESES, UNCERTAIN, PARALLEL] = [600, 0.5, 0.985];
const [THICKNESS, LEAST_THICKNESS] = [0.01, 0.02];
const [BELOW, DEPTH_BELOW, LEAST_SHARE, LOWEST] = [0.03, 0.15, 0.02, 0.01];
/** Of the lamp: margins of the box around what the camera sees, and height above the lowest point, metres. */
const MARGIN = [1, 0.5, 1.5];
const LEAST_HEIGHT = 0.3;
const [GRID, REACHES, MOST_FALLOFF] = [[7, 5, 7], [0, 1, 2], 4];
const BRIGHTNESS = 0.5;
const DARK = 1e-4;

const range = (count) => Array.from({ length: count }, (_, index) => index);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const turned = (rotation, vector) => rotation.map((row) => dot(row, vector));

/** A value below which a share of numbers lies. */
function quantile(values, share) {
  const sorted = Float64Array.from(values).sort();
  return sorted[Math.min(sorted.length - 1, Math.round(share * (sorted.length - 1)))];
}

/**
 * What the device and the page need of a room. `photo` has the pixels of the maps' part, RGBA, `whole` the photo's
 * size; `lens` is that of the photo; `pose` from view space to the world, or null: it is that of the floor. The room's
 * lights have the scale of the photo, whose light is gathered.
 */
export function prepareRoom(/** @type {any} */ library, /** @type {any} */ { photo, whole, depth, lens, pose }) {
  const { width, height } = photo;
  if (Math.abs(depth.width * whole.height - depth.height * whole.width) > 0.03 * depth.width * whole.height)
    throw new Error(
      `the depth map is ${depth.width} × ${depth.height}, the photo ${whole.width} × ${whole.height}: ` +
        `both have to show the same part of the room`,
    );
  const crop = cropOf(whole, width, height);
  const own = {
    fx: lens.fx / crop.scale,
    fy: lens.fy / crop.scale,
    cx: (lens.cx - crop.left) / crop.scale,
    cy: (lens.cy - crop.top) / crop.scale,
  };
  const filled = library.fittedDepth(depth, whole, crop, width, height);
  const { holes, count } = fillHoles(library, filled, width);
  const { normals, noise } = library.normals(filled, holes, own, width, height);
  const notes = [`normals are those of the depth map, whose noise is ${(100 * noise).toFixed(2)} %`];
  if (count > 0) notes.push(`${count.toLocaleString("en")} pixels had no depth and are filled from their neighbours`);
  const surface = surfaceOf(filled, normals, raysOfLens(own, width, height), width, height);
  const found = pose ?? levelled(library, surface, notes);
  const world = surface.map(({ pixel, point, normal, distance }) => {
    const at = turned(found.rotation, point).map((value, axis) => value + found.position[axis]);
    return { pixel, point: at, normal: turned(found.rotation, normal), distance };
  });
  const colours = linearOf(photo.data);
  const light = fitLight(world, colours, found.position, notes);
  const rays = raysOfLens(own, width, height);
  const albedo = photoColours(colours, filled, normals, rays, found, light);
  const seen = seenOf(filled, normals, colours, rays, found, width, height);
  return {
    width,
    height,
    lens: own,
    pose: found,
    depth: filled,
    normals,
    albedo,
    fittedLight: light,
    noise,
    surface: world,
    seen,
    notes,
  };
}

/** View rays of the pixels, with z = 1: three of each. */
function raysOfLens({ fx, fy, cx, cy }, width, height) {
  const rays = new Float64Array(3 * width * height).fill(1);
  for (let i = 0; i < width * height; ++i) {
    rays[3 * i] = ((i % width) + 0.5 - cx) / fx;
    rays[3 * i + 1] = (Math.floor(i / width) + 0.5 - cy) / fy;
  }
  return rays;
}

/**
 * Points, normals and colours of every second pixel across and down, in the world, for the light of an object
 * (library.js).
 */
function seenOf(depth, normals, colours, rays, pose, width, height) {
  const [points, turnedNormals, seenColours] = range(3).map(() => new Float64Array(3 * (width >> 1) * (height >> 1)));
  let at = 0;
  for (let y = 0; y + 1 < height; y += 2)
    for (let x = 0; x + 1 < width; x += 2, at += 3) {
      const pixel = 3 * (y * width + x);
      points.set(
        turned(
          pose.rotation,
          range(3).map((axis) => rays[pixel + axis] * depth[pixel / 3]),
        ).map((value, axis) => value + pose.position[axis]),
        at,
      );
      turnedNormals.set(turned(pose.rotation, normals.subarray(pixel, pixel + 3)), at);
      seenColours.set(colours.subarray(pixel, pixel + 3), at);
    }
  return { points, normals: turnedNormals, colours: seenColours };
}

/** Points and normals of a grid of pixels, view space. */
function surfaceOf(depth, normals, rays, width, height) {
  const points = [];
  for (let y = STEP >> 1; y < height; y += STEP)
    for (let x = STEP >> 1; x < width; x += STEP) {
      const pixel = y * width + x;
      const point = range(3).map((axis) => rays[3 * pixel + axis] * depth[pixel]);
      points.push({
        pixel,
        point,
        normal: range(3).map((axis) => normals[3 * pixel + axis]),
        distance: Math.hypot(...point),
      });
    }
  return points;
}

/** The pose of a level world with the floor at 0: the floor is the largest low plane that points up in the picture. */
function levelled(library, surface, notes) {
  const towards = [0, -1, 0];
  const level = surface.filter(({ normal }) => dot(normal, towards) > UNCERTAIN);
  let best = { count: 0 };
  for (let index = 0; index < level.length; index += Math.max(1, Math.floor(level.length / HYPOTHESES))) {
    const { point, normal } = level[index];
    const height = dot(normal, point);
    let [count, below] = [0, 0];
    for (const other of surface) {
      const over = dot(normal, other.point) - height;
      if (over < -DEPTH_BELOW) ++below;
      if (
        Math.abs(over) < Math.max(THICKNESS * other.distance, LEAST_THICKNESS) &&
        dot(normal, other.normal) > PARALLEL
      )
        ++count;
    }
    if (below <= BELOW * surface.length && count >= LEAST_SHARE * surface.length && count > best.count)
      best = { count, height, normal };
  }
  let [up, height] = [best.normal ?? towards, best.height];
  for (let round = 0; best.normal && round < 3; ++round) {
    const on = surface.filter(
      (each) =>
        Math.abs(dot(up, each.point) - height) < Math.max(THICKNESS * each.distance, LEAST_THICKNESS) &&
        dot(up, each.normal) > PARALLEL,
    );
    if (on.length < 3) break;
    // m · p = 1, below the eye: height < 0
    const plane = library.plane(Float64Array.from(on.flatMap(({ point }) => point)));
    const length = Math.hypot(...plane);
    [up, height] = [Array.from(plane, (value) => -value / length), -1 / length];
  }
  if (!best.normal)
    height = quantile(
      surface.map(({ point }) => dot(up, point)),
      LOWEST,
    );
  notes.push(
    best.normal
      ? `the vertical is that of the floor, ${Math.round((100 * best.count) / surface.length)} % of the picture`
      : "no floor was found: the photo is taken as level, its lowest point as the floor",
  );
  return { rotation: toUp(up), position: [0, -height, 0] };
}

/** The rotation from view space to a world whose y is `up`, and whose z comes towards the camera. */
function toUp(up) {
  const [x, y, z] = [up[0], -up[1], -up[2]];
  const f = 1 / (1 + y);
  const least = [
    [1 - x * x * f, -x, -x * z * f],
    [x, y, z],
    [-x * z * f, -z, 1 - z * z * f],
  ];
  return least.map(([a, b, c]) => [a, -b, -c]);
}

const linearOf = (data) =>
  Float64Array.from({ length: (3 * data.length) / 4 }, (_, i) => decode(data[4 * Math.floor(i / 3) + (i % 3)]));

/** Light of intensity 1 on an unshadowed surface. */
function exposure(point, normal, position, reach) {
  const toLight = position.map((value, axis) => value - point[axis]);
  const squared = Math.max(1e-12, dot(toLight, toLight));
  const cosine = Math.max(0, dot(normal, toLight)) / Math.sqrt(squared);
  return reach === 0 ? cosine : cosine * Math.min(MOST_FALLOFF, reach ** 2 / squared);
}

/**
 * The corners of the box around a room: what its camera sees, and around; its lowest level is that of the floor.
 * `points`: three numbers each.
 */
export function roomBox(points, eye) {
  const along = range(3).map((axis) => points.filter((_, index) => index % 3 === axis));
  const floor = quantile(along[1], 0.02);
  const low = along.map((values, axis) =>
    axis === 1 ? floor : Math.min(quantile(values, 0.02), eye[axis]) - MARGIN[axis],
  );
  return [low, along.map((values, axis) => Math.max(quantile(values, 0.98), eye[axis]) + MARGIN[axis])];
}

/** Ambient light and one lamp that explain the brightness of the photo best, if its mean albedo is 0.5. */
function fitLight(world, colours, eye, notes) {
  const samples = world
    .map(({ pixel, point, normal }) => ({
      point,
      normal,
      value: (colours[3 * pixel] + colours[3 * pixel + 1] + colours[3 * pixel + 2]) / 3,
    }))
    .filter(({ value }) => value > 0.001 && value < 0.9);
  if (samples.length < world.length / 20)
    throw new Error("the photo is nearly all black or saturated: its light cannot be found");
  const target = Float64Array.from(samples, ({ value }) => value / BRIGHTNESS);
  const weights = target.map((value) => 1 / (value + 0.05));
  const sum = (f) => target.reduce((total, _, i) => total + weights[i] ** 2 * f(i), 0);
  const [ones, targets] = [sum(() => 1), sum((i) => target[i])];
  const least = targets / ones / 2;
  const [low, high] = roomBox(
    world.flatMap(({ point }) => point),
    eye,
  );
  low[1] += LEAST_HEIGHT;
  let best = /** @type {any} */ ({ error: Infinity });
  for (const place of range(GRID[0] * GRID[1] * GRID[2])) {
    const index = [place % GRID[0], Math.floor(place / GRID[0]) % GRID[1], Math.floor(place / GRID[0] / GRID[1])];
    const position = index.map((value, axis) => low[axis] + (value / (GRID[axis] - 1)) * (high[axis] - low[axis]));
    for (const reach of REACHES) {
      const shine = samples.map(({ point, normal }) => exposure(point, normal, position, reach));
      const [lit, squares, both] = [sum((i) => shine[i]), sum((i) => shine[i] ** 2), sum((i) => shine[i] * target[i])];
      const determinant = ones * squares - lit * lit;
      let ambient = determinant > 0 ? (targets * squares - lit * both) / determinant : least;
      ambient = Math.max(least, ambient);
      const colour = squares > 0 ? (both - ambient * lit) / squares : 0;
      const error = sum((i) => (ambient + colour * shine[i] - target[i]) ** 2);
      if (colour > 0 && colour <= 15 && error < best.error)
        best = { error, ambient, lamp: { position, colour, reach } };
    }
  }
  if (!best.lamp)
    best = {
      ambient: least,
      lamp: { position: [eye[0], Math.max(eye[1], low[1]) + 1, eye[2]], colour: 2 * least, reach: 0 },
    };
  notes.push(
    "the light is simplified: ambient light and one white lamp, fitted to the photo's brightness " +
      "by least squares; the host fits colours and two lamps",
  );
  return { ambient: best.ambient, lamp: best.lamp };
}

/** The colours with which the room, relit, is its photo: sRGB codes of photo / light, at most 1. */
function photoColours(colours, depth, normals, rays, pose, { ambient, lamp }) {
  const result = new Float64Array(colours.length);
  for (let i = 0; i < depth.length; ++i) {
    const point = turned(
      pose.rotation,
      range(3).map((axis) => rays[3 * i + axis] * depth[i]),
    ).map((value, axis) => value + pose.position[axis]);
    const light = Math.max(
      DARK,
      ambient +
        lamp.colour *
          exposure(point, turned(pose.rotation, normals.subarray(3 * i, 3 * i + 3)), lamp.position, lamp.reach),
    );
    for (let channel = 0; channel < 3; ++channel) result[3 * i + channel] = colours[3 * i + channel] / light;
  }
  return Uint8Array.from(result, (value) => encode(Math.min(1, value)));
}
