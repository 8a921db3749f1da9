// A room of a visitor's files, in the page: the worker makes its maps, this module its view files.

import { readMeta } from "./files.js";
import { bytesOf } from "./renderer.js";
import { lensOf, roomView } from "./roomview.js";

/** Edge of the object's cube, as a share of its distance. */
const OBJECT_SHARE = 0.3;
/** Radius of the lamp, as a share of its distance from the object, where light is gathered. */
const LAMP_SHARE = 0.2;

/** Points of its outline in edges, right and up, which nothing should hide. */
const OUTLINE = [
  [0, 1],
  [-0.5, 0.5],
  [0.5, 0.5],
];

/** Whether a design has a room (tools/browser/rooms.py). */
export const hasRoom = (room, design) => Boolean(room && design in room.views);

/** The room of the page whose view files are templates, and a design that has maps: the wanted one, if it has. */
export function templateFor(rooms, wanted) {
  return { template: rooms.living, design: hasRoom(rooms.living, wanted) ? wanted : "small" };
}

/**
 * A room in the form of those of the page, for designs like one; `found` as of roomFiles, `settings` hold where there
 * is no meta.json; `place`: where the object stands, if it is known.
 */
export async function visitorRoom(renderer, manifest, template, found, files, { degrees, millimetres }, place) {
  const bitmap = await createImageBitmap(new Blob([files.get(found.photo)])).catch(() => {
    throw new Error(`${found.photo} is no picture that this browser reads`);
  });
  const whole = { width: bitmap.width, height: bitmap.height };
  const meta = found.meta && readMeta(found.meta, whole);
  if (!meta && !(millimetres > 0 && degrees >= 20 && degrees <= 140))
    throw new Error("the photo's width is 20 to 140 degrees, the step of the depth map more than 0 mm");
  const photo = pixelsOf(bitmap, template.width, template.height);
  const { lens, pose, step } = meta ?? { lens: lensOf(degrees, whole), pose: null, step: millimetres / 1000 };
  const depth = { name: found.depth, bytes: files.get(found.depth) };
  const room = await renderer.room({ manifest, photo, whole, lens, pose, depth, step });
  const { ignored } = found;
  if (!meta)
    room.notes.push(`the photo's width is taken as ${degrees}°, a step of a PNG of depth as ${millimetres} mm`);
  if (ignored.length > 0) room.notes.push(`${ignored.join(" and ")} ${ignored.length > 1 ? "are" : "is"} not read`);
  return {
    ...room,
    ...(await placedRoom(renderer, room, template, place ?? placeOf(room))),
    picture: photo,
    files: { found, files, settings: { degrees, millimetres } },
  };
}

/** What the page needs of a room whose object stands at its place: camera, object, light and view files. */
export async function placedRoom(renderer, room, template, place) {
  const { pose, lens, width, height, encoded } = room;
  const axis = (column) => pose.rotation.map((row) => row[column]);
  const scale = place.edge / 2;
  const object = { position: [place.point[0], place.point[1] + scale, place.point[2]], scale };
  const exposure = template.light.exposure;
  const { position, colour, reach } = room.fittedLight.lamp;
  const lamp = { position, colour: Array(3).fill(colour * exposure), reach };
  const viewsOf = (views) =>
    Object.fromEntries(
      Object.entries(views).map(([factor, text]) => [
        factor,
        roomView(bytesOf(text), template.object.scale, { ...room, lamp }, object, Number(factor)),
      ]),
    );
  const views = Object.fromEntries(Object.entries(template.views).map(([design, views]) => [design, viewsOf(views)]));
  const ambient = room.fittedLight.ambient * exposure;
  const light = { exposure, ...(await lightAt(renderer, room, object, lamp, exposure)) };
  return {
    place,
    object,
    camera: {
      position: pose.position,
      right: axis(0),
      down: axis(1),
      forward: axis(2),
      lens: [lens.fx, lens.cx, lens.cy, lens.fy].map((value) => value / height),
    },
    views,
    maps: encoded.maps,
    headroom: 1,
    encoded,
    ambient,
    light,
    width,
    height,
  };
}

/** The light that an object meets, in the device's numbers: that of the photo, and the lamp with an area. */
async function lightAt(renderer, { seen, pose }, { position, scale }, lamp, exposure) {
  const { radiance, ...found } = await renderer.light({ seen, eye: pose.position, point: position, edge: 2 * scale });
  const radius = LAMP_SHARE * Math.hypot(...lamp.position.map((value, axis) => value - position[axis]));
  return { ...found, radiance: radiance.map((value) => value * exposure), lamps: [{ ...lamp, radius }] };
}

/** The largest part around the middle of a picture with the proportions of the maps, in their size. */
function pixelsOf(bitmap, width, height) {
  const scale = Math.min(bitmap.width / width, bitmap.height / height);
  const part = /** @type {const} */ ([
    (bitmap.width - scale * width) / 2,
    (bitmap.height - scale * height) / 2,
    scale * width,
    scale * height,
  ]);
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.imageSmoothingQuality = "high";
  context.drawImage(bitmap, ...part, 0, 0, width, height);
  return { data: context.getImageData(0, 0, width, height).data, width, height };
}

/**
 * Where the object stands: on the level surface nearest to a pixel, at most `within` pixels away; its edge, metres.
 * Without a pixel: near the middle, where nothing hides it.
 */
export function placeOf(room, x, y, within = Infinity) {
  const { surface, pose, width, height } = room;
  const isFree = x === undefined;
  const middle = isFree ? [width / 2, 0.62 * height] : [x, y];
  const pixelsTo = ({ pixel }, /** @type {number[]} */ [u, v]) =>
    Math.hypot((pixel % width) - u, Math.floor(pixel / width) - v);
  const nearest = (points, to) =>
    points.reduce((best, each) => (pixelsTo(each, to) < pixelsTo(best, to) ? each : best));
  const edgeAt = (point) => OBJECT_SHARE * Math.hypot(...point.map((value, axis) => value - pose.position[axis]));
  const isHidden = ({ point, distance }) => {
    const edge = edgeAt(point);
    const shown = (/** @type {number[]} */ [across, up]) =>
      point.map((value, axis) => value + edge * (across * pose.rotation[axis][0] + (axis === 1 ? up : 0)));
    return OUTLINE.some((place) => nearest(surface, pixelOf(room, shown(place))).distance < distance - 0.6 * edge);
  };
  const level = surface.filter((each) => each.normal[1] > 0.9 && pixelsTo(each, middle) <= within);
  const seen = isFree ? level.filter((each) => !isHidden(each)) : level;
  const { point } = nearest(
    [seen, level, surface].find((points) => points.length > 0),
    middle,
  );
  return { point, edge: edgeAt(point) };
}

/** The pixel of the maps that shows a point. */
function pixelOf({ pose, lens }, point) {
  const offset = point.map((value, axis) => value - pose.position[axis]);
  const [x, y, z] = [0, 1, 2].map((axis) => pose.rotation.reduce((sum, row, i) => sum + row[axis] * offset[i], 0));
  return [lens.cx + (lens.fx * x) / z, lens.cy + (lens.fy * y) / z];
}
