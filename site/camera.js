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
  return {
    position,
    right,
    down: negate(up),
    forward: negate(toward),
    focal: FOCAL * Math.min(height, width),
    width,
    height,
  };
}

/** A light's position: right, up and towards the camera from the cube's centre, in edges of the cube. */
export function lightOf({ right, down, forward }, /** @type {number[]} */ [x, y, z]) {
  return [0, 1, 2].map((axis) => 2 * (x * right[axis] - y * down[axis] - z * forward[axis]));
}

/** The pixel of a place in the world, and its depth. */
export function project(
  { position, right, down, forward, focal, focalY = focal, width, height, centre = [width / 2, height / 2] },
  place,
) {
  const offset = place.map((value, axis) => value - position[axis]);
  const along = (direction) => direction.reduce((sum, value, axis) => sum + value * offset[axis], 0);
  const depth = along(forward);
  return { x: centre[0] + (focal * along(right)) / depth, y: centre[1] + (focalY * along(down)) / depth, depth };
}

/**
 * Of a camera in a room, from that of the maps: degrees around the object, its distance's factor, a shift in metres.
 */
export const ROOM_START = { roomAzimuth: 0, roomElevation: 0, roomDistance: 1, roomX: 0, roomY: 0 };

/** Whether an orbit has the camera of a room's maps, which is that of its photo. */
export const isAtMaps = (orbit) => Object.entries(ROOM_START).every(([name, value]) => orbit[name] === value);

/** A camera in a room: that of the maps, moved around the object; `lens` has fx, cx, cy, fy in heights of the frame. */
export function roomCamera({ camera: { lens, position, right, down, forward }, object }, width, height, orbit) {
  const [focal, x, y, focalY] = lens.map((value) => value * height);
  const size = { focal, focalY, centre: [x, y], width, height };
  if (isAtMaps(orbit)) return { position, right, down, forward, ...size, isOfMaps: true };
  const up = [0, 1, 0];
  const moved = (vector) => rotated(rotated(vector, right, -orbit.roomElevation), up, orbit.roomAzimuth);
  const axes = Object.fromEntries(Object.entries({ right, down, forward }).map(([name, axis]) => [name, moved(axis)]));
  const away = moved(position.map((value, axis) => orbit.roomDistance * (value - object.position[axis])));
  const place = away.map(
    (value, axis) => object.position[axis] + value + orbit.roomX * axes.right[axis] - orbit.roomY * axes.down[axis],
  );
  return { position: place, ...axes, ...size };
}

/** A point of a lamp's disc, which faces the object; without a point of the unit disc it is the middle. */
export function onDisc({ position, radius }, middle, point = [0, 0]) {
  const unit = (vector) => vector.map((value) => value / Math.hypot(...vector));
  const cross = (a, b) =>
    [0, 1, 2].map((axis) => a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3]);
  const away = unit(position.map((value, axis) => value - middle[axis]));
  const side = Math.hypot(away[0], away[2]) > 1e-9 ? [0, 1, 0] : [0, 0, -1];
  const right = unit(cross(side, away));
  const up = cross(away, right);
  return position.map((value, axis) => value + radius * (point[0] * right[axis] + point[1] * up[axis]));
}

/** A vector after a rotation around a unit axis, degrees (Rodrigues). */
function rotated(vector, axis, degrees) {
  const [c, s] = [Math.cos, Math.sin].map((f) => f((degrees * Math.PI) / 180));
  const along = axis.reduce((sum, value, i) => sum + value * vector[i], 0);
  const across = [0, 1, 2].map(
    (i) => axis[(i + 1) % 3] * vector[(i + 2) % 3] - axis[(i + 2) % 3] * vector[(i + 1) % 3],
  );
  return vector.map((value, i) => c * value + s * across[i] + (1 - c) * along * axis[i]);
}

/**
 * The pose of an object that stands in a room: turned by degrees, its lowest point at `low`, from 0 to 1 of the cube.
 */
export function poseOf({ object: { position, scale } }, degrees, low) {
  const [c, s] = [Math.cos, Math.sin].map((f) => f((degrees * Math.PI) / 180));
  const rotation = [
    [c, 0, s],
    [0, 1, 0],
    [-s, 0, c],
  ];
  return { position: [position[0], position[1] - 2 * scale * low, position[2]], rotation, scale };
}

/** The world's position of one in the object's cube, from -1 to 1. */
export function toWorld({ position, rotation, scale }, local) {
  return position.map(
    (value, row) => value + scale * rotation[row].reduce((sum, factor, column) => sum + factor * local[column], 0),
  );
}

/** Without a room the cube is the world. */
export const CUBE = {
  position: [0, 0, 0],
  rotation: [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ],
  scale: 1,
};
