// The rays of a pixel, step by step: as a table, and drawn over the picture.

import { project, toWorld } from "./camera.js";

const [RAY, NODE, CHILD, RECORD, TRIANGLE, HIT] = [0, 1, 2, 3, 4, 5];
const KINDS = ["primary", "shadow", "reflection", "refraction", "gathered"];

/** The rays of a log: their steps, and counts of them. `line`: records of a line of DRAM. */
export function raysOf(steps, line) {
  const rays = [];
  for (const step of steps) {
    if (step.kind === RAY)
      rays.push({
        kind: KINDS[step.value],
        origin: step.values.slice(0, 3),
        direction: step.values.slice(3, 6),
        steps: [],
        hit: null,
      });
    else if (step.kind === HIT) rays.at(-1).hit = step.value;
    else rays.at(-1).steps.push(step);
  }
  for (const ray of rays) {
    const of = (kind) => ray.steps.filter((step) => step.kind === kind);
    const reads = [...of(NODE), ...of(RECORD)].map((step) => step.value);
    ray.nodes = of(NODE).length;
    ray.boxes = of(CHILD).length;
    ray.entered = of(CHILD).filter((step) => step.isHit).length;
    ray.records = reads.length;
    ray.lines = line ? new Set(reads.map((address) => Math.floor(address / line))).size : null;
    ray.triangles = of(TRIANGLE).length;
    const found = of(TRIANGLE).filter((step) => step.isHit);
    ray.blocker = found.at(-1) ?? null;
    ray.end = ray.blocker ? endOf(ray) : null;
  }
  return rays;
}

/** Where a ray meets the triangle that it hit. */
function endOf({ origin, direction, blocker }) {
  const [a, b, c] = [0, 3, 6].map((at) => blocker.values.slice(at, at + 3));
  const minus = (p, q) => p.map((value, axis) => value - q[axis]);
  const dot = (p, q) => p.reduce((sum, value, axis) => sum + value * q[axis], 0);
  const [u, v] = [minus(b, a), minus(c, a)];
  const normal = [0, 1, 2].map((axis) => u[(axis + 1) % 3] * v[(axis + 2) % 3] - u[(axis + 2) % 3] * v[(axis + 1) % 3]);
  const t = dot(minus(a, origin), normal) / dot(direction, normal);
  return origin.map((value, axis) => value + t * direction[axis]);
}

/** One line for a step. */
export function lineOf(step) {
  if (step.kind === NODE) return `node ${step.value}`;
  if (step.kind === CHILD)
    return `${step.isHit ? "enters" : "misses"} the box of ${step.isLeaf ? "triangles" : "node"} ${step.value}`;
  if (step.kind === RECORD) return `triangles at ${step.value}`;
  return `triangle ${step.value}: ${step.isHit ? "hit, the closest so far" : "no closer hit"}`;
}

/** Draws rays: boxes entered, triangles tested and hit, and the ways. `units`: vertex units of the cube's edge. */
export function draw(context, camera, pose, rays, units, chosen = null) {
  const scale = context.canvas.width / camera.width;
  const onto = (place) => {
    const { x, y, depth } = project(
      camera,
      toWorld(
        pose,
        place.map((value) => (2 * value) / units - 1),
      ),
    );
    return depth > 0.05 * pose.scale ? [x * scale, y * scale] : null;
  };
  const stroke = (corners, colour, width, isClosed = false) => {
    const points = corners.map(onto);
    if (points.some((point) => point === null)) return;
    context.beginPath();
    points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    if (isClosed) context.closePath();
    context.strokeStyle = colour;
    context.lineWidth = width * scale;
    context.stroke();
  };
  const box = ({ values }, colour, width) => {
    const corner = (bits) => [0, 1, 2].map((axis) => values[axis + 3 * ((bits >> axis) & 1)]);
    for (let from = 0; from < 8; ++from)
      for (const bit of [1, 2, 4]) if (!(from & bit)) stroke([corner(from), corner(from | bit)], colour, width);
  };
  const triangle = ({ values }, colour, width) =>
    stroke(
      [0, 3, 6].map((at) => values.slice(at, at + 3)),
      colour,
      width,
      true,
    );

  context.clearRect(0, 0, context.canvas.width, context.canvas.height);
  context.lineJoin = "round";
  rays.forEach((ray, index) => {
    if (chosen !== null && chosen !== index) return;
    const isFirst = index === 0 || chosen !== null;
    for (const step of ray.steps)
      if (isFirst && step.kind === CHILD && step.isHit)
        box(step, step.isLeaf ? "#5fd08acc" : "#59a8ff99", step.isLeaf ? 1.25 : 1);
    for (const step of ray.steps) if (isFirst && step.kind === TRIANGLE) triangle(step, "#ffd166", 1);
  });
  rays.forEach((ray, index) => {
    if (chosen !== null && chosen !== index) return;
    if (ray.blocker) triangle(ray.blocker, "#ff4d4d", 2);
    const length = Math.hypot(...ray.direction);
    const end = ray.end ?? ray.origin.map((value, axis) => value + (2 * units * ray.direction[axis]) / length);
    stroke([ray.origin, end], { primary: "#ffffff", shadow: "#ffffff88" }[ray.kind] ?? "#ff8cff", 1.5);
  });
}
