// SPDX-License-Identifier: Apache-2.0
// The camera on its orbit. The world is the object's cube, from -1 to 1; y is up.

const FOCAL = 1 / (2 * Math.tan((20 * Math.PI) / 180)); // 40 degrees, of the picture's height

export const START = { azimuth: 24, elevation: 18, distance: 4.6, x: 0, y: 0 };

/** Position, axes and lens of an orbit: degrees, and distances in halves of the cube's edge. */
export function cameraOf({ azimuth, elevation, distance, x, y }, width, height) {
  const [a, e] = [azimuth, elevation].map((angle) => (angle * Math.PI) / 180);
  const toward = [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)];
  const right = [Math.cos(a), 0, -Math.sin(a)];
  const up = [-Math.sin(a) * Math.sin(e), Math.cos(e), -Math.cos(a) * Math.sin(e)];
  const position = toward.map((value, axis) => distance * value + x * right[axis] + y * up[axis]);
  const negate = (vector) => vector.map((value) => -value);
  return { position, right, down: negate(up), forward: negate(toward), focal: FOCAL * Math.min(height, width), width, height };
}

/** A light's position: right, up and towards the camera from the cube's centre, in edges of the cube. */
export function lightOf({ right, down, forward }, [x, y, z]) {
  return [0, 1, 2].map((axis) => 2 * (x * right[axis] - y * down[axis] - z * forward[axis]));
}

/** The pixel of a place in the world, and its depth. */
export function project({ position, right, down, forward, focal, width, height }, place) {
  const offset = place.map((value, axis) => value - position[axis]);
  const along = (direction) => direction.reduce((sum, value, axis) => sum + value * offset[axis], 0);
  const depth = along(forward);
  return { x: width / 2 + (focal * along(right)) / depth, y: height / 2 + (focal * along(down)) / depth, depth };
}

/** The camera of a room's maps: `lens` has its focal length in heights of the frame. */
export function roomCamera({ camera: { lens, ...axes } }, width, height) {
  return { ...axes, focal: lens[0] * height, width, height, isOfMaps: true };
}

/** The pose of an object that stands in a room: turned by degrees, its lowest point at `low`, from 0 to 1 of the cube. */
export function poseOf({ object: { position, scale } }, degrees, low) {
  const [c, s] = [Math.cos, Math.sin].map((f) => f((degrees * Math.PI) / 180));
  const rotation = [[c, 0, s], [0, 1, 0], [-s, 0, c]];
  return { position: [position[0], position[1] - 2 * scale * low, position[2]], rotation, scale };
}

/** The world's position of one in the object's cube, from -1 to 1. */
export function toWorld({ position, rotation, scale }, local) {
  return position.map((value, row) => value + scale * rotation[row].reduce((sum, factor, column) => sum + factor * local[column], 0));
}

/** Without a room the cube is the world. */
export const CUBE = { position: [0, 0, 0], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], scale: 1 };
