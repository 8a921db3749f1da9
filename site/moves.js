// Moves of a state's camera, or of its object in a room; `room` is null without one.

import { within } from "./state.js";

/** By degrees; `isCamera`: in a room it is the camera that moves. */
export function orbitBy(state, room, isCamera, azimuth, elevation) {
  const turn = (degrees, least) => ((((degrees - least) % 360) + 360) % 360) + least;
  if (room && isCamera) {
    state.roomAzimuth = turn(state.roomAzimuth + azimuth, -180);
    state.roomElevation = within("roomElevation", state.roomElevation + elevation);
  } else {
    state.azimuth = turn(state.azimuth + azimuth, 0);
    state.elevation = within("elevation", state.elevation + elevation);
  }
}

export function zoomBy(state, room, factor) {
  const name = room ? "roomDistance" : "distance";
  state[name] = within(name, state[name] * factor);
}

/** By heights of the stage, right and up. */
export function panBy(state, room, x, y) {
  const [names, height] = room
    ? [["roomX", "roomY"], roomHeight(state, room)]
    : [["x", "y"], 2 * state.distance * Math.tan((20 * Math.PI) / 180)];
  [x, y].forEach((value, index) => (state[names[index]] = within(names[index], state[names[index]] + value * height)));
}

/** The height of the stage at the object, metres. */
const roomHeight = (state, { camera, object }) =>
  (state.roomDistance * Math.hypot(...camera.position.map((value, axis) => value - object.position[axis]))) /
  camera.lens[0];
