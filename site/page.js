// SPDX-License-Identifier: Apache-2.0
// The page: controls, orbit, dropped files, the ray of a pixel.

import { ROOM_START, START, cameraOf, isAtMaps, roomCamera } from "./camera.js";
import { droppedFiles, roomFiles } from "./files.js";
import { listen } from "./orbit.js";
import { element, listDesigns, showCosts, showRays } from "./panels.js";
import { radianceOf } from "./lightcube.js";
import { notesOf } from "./notes.js";
import { draw, raysOf } from "./path.js";
import { Picture } from "./picture.js";
import { Renderer, bytesOf, unpack } from "./renderer.js";
import { RtlPanel } from "./rtlpanel.js";
import { readState, writeState } from "./state.js";
import { materialOf, poseIn, viewOf } from "./view.js";
import { kindFor, placeOf, placedRoom, templateFor, visitorRoom } from "./visitor.js";

const MOST_WORKERS = 8;
/** A level surface so near to a double click counts, pixels of the maps. */
const STAND_WITHIN = 40;

const form = element("controls");
const stage = element("stage");
const overlay = element("overlay").getContext("2d");

let data, renderer, picture, manifest, packed, rays, chosen, traced;
let state = readState(location.hash);
/** Works that wait or run: the state may be ahead of design, room and mesh. */
let works = 0;
/** What tests read: the last whole frame, the light of its room, and its last pass. */
const page = (window.colonnade = { frames: 0, picture: null });

/** The room of the state, as the hardware has it; null if it has no maps. */
function roomOf() {
  const kind = kindFor(data.rooms[state.room], state.design);
  return kind ? { ...data.rooms[state.room], ...kind } : null;
}

const scene = () => ({ state, mesh: page.mesh, manifest, packed });

function fail(text) {
  element("error").textContent = text;
  element("error").hidden = text === "";
}

function showNotes() {
  element("notes").replaceChildren(...notesOf(scene(), roomOf()).map((note) => Object.assign(document.createElement("li"), { textContent: note })));
}

// Meshes and designs

async function openDesign() {
  manifest = data.manifests[state.design] ?? data.manifests[(state.design = "textured")];
  await completeRoom(data.rooms[state.room]);
  const room = roomOf();
  const files = room ? room.views[state.design] : { plain: data.views[state.design] };
  const views = Object.fromEntries(Object.entries(files).map(([name, text]) => [name, bytesOf(text)]));
  const maps = (room?.maps ?? []).map(({ words, ...map }) => ({ ...map, words: bytesOf(words) }));
  const light = room?.light ? (room.light.radiance ??= radianceOf(bytesOf(room.light.cube))) : null;
  Object.assign(page, { light: room?.light, middle: room?.object.position });
  await renderer.open({ module: page.module, manifest, views, maps, light, photo: room && (await photoOf(room)) });
}

/** The pixels of a room's photo. */
async function photoOf({ photo, picture: own, width, height }) {
  if (own) return own;
  const bitmap = await createImageBitmap(new Blob([bytesOf(photo)], { type: "image/jpeg" }));
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  return { data, width, height };
}

async function changeDesign() {
  await openDesign();
  forget();
  await pack();
}

async function pack() {
  const answer = await renderer.pack(materialOf(scene(), roomOf()) === "glass");
  packed = answer.packed;
  page.packTime = answer.milliseconds;
  page.packed = packed;
  showNotes();
}

/** Does one thing after the other, and then renders; after an error, what was. Nothing is rendered meanwhile. */
let queue = Promise.resolve();
function then(work) {
  ++works;
  queue = queue
    .then(async () => {
      await renderer.stop();
      await work();
    })
    .then(
      () => (--works, show()),
      (error) => (--works, fail(error.message), picture.update()),
    );
  return queue;
}

/** Reads and packs a file; if it cannot be, the mesh stays what it was. */
async function readFile(name, bytes, files) {
  const [mesh, file] = [page.mesh, page.file];
  try {
    page.mesh = await renderer.read(name, bytes, files);
    await pack();
  } catch (error) {
    page.mesh = mesh;
    if (file) {
      await renderer.read(file.name, file.bytes, file.files);
      await pack();
    }
    throw error;
  }
  page.file = { name, bytes, files };
  state.mesh = name;
  forget();
}

// A visitor's room

/** Makes a room of a photo and its depth, and shows it; if it cannot be made, the room stays what it was. */
async function openRoom(found, files) {
  const settings = { degrees: form.elements.degrees.valueAsNumber, millimetres: form.elements.step.valueAsNumber };
  const { template, design } = templateFor(data.rooms, state.design);
  const hint = element("hint");
  Object.assign(hint, { hidden: false, textContent: `Making the maps of ${found.photo}…` });
  const room = await visitorRoom(renderer, data.manifests[design], template, found, files, settings).finally(() => (hint.hidden = true));
  if (!data.rooms[found.photo]) form.elements.room.add(new Option(found.photo));
  data.rooms[found.photo] = page.room = room;
  Object.assign(state, { design, room: found.photo, ...ROOM_START, azimuth: START.azimuth });
  await changeDesign();
}

/** Makes a visitor's room for the design, if it is another kind of one that has maps. */
async function completeRoom(room) {
  if (!room?.files || kindFor(room, state.design)) return;
  const { template, design } = templateFor(data.rooms, state.design);
  if (design !== state.design) return;
  const { found, files, settings } = room.files;
  Object.assign(room, await visitorRoom(renderer, manifest, template, found, files, settings, room.place));
}

/** Stands the object of a visitor's room on the surface at a pixel. */
stage.addEventListener("dblclick", (event) => {
  const room = roomOf();
  if (!room?.files || !isAtMaps(state)) return;
  const box = picture.canvas.getBoundingClientRect();
  const place = placeOf(room, ((event.clientX - box.left) / box.width) * room.width, ((event.clientY - box.top) / box.height) * room.height, STAND_WITHIN);
  then(async () => {
    const own = data.rooms[state.room];
    Object.assign(own, placedRoom(own, templateFor(data.rooms, state.design).template, place));
    await changeDesign();
  });
});

async function openFiles(list) {
  const files = new Map(await Promise.all([...list].map(async (file) => [file.name, new Uint8Array(await file.arrayBuffer())])));
  const isMesh = [...files.keys()].some((name) => /\.(obj|ply|glb|gltf)$/i.test(name));
  if (!isMesh && [...files.keys()].some((name) => /\.(jpe?g|png|webp|npy)$/i.test(name))) return void (await then(() => openRoom(roomFiles(files), files)));
  const name = [...files.keys()].find((each) => /\.(obj|ply|glb|gltf)$/i.test(each)) ?? [...files.keys()][0];
  if (name !== undefined) await then(() => readFile(name, files.get(name), files));
}

const openTeapot = () => readFile("teapot.ply", page.teapot, new Map());

// Controls, and the link

function fill() {
  for (const name of ["design", "room", "material", "light", "bounces", "pixel"]) form.elements[name].value = state[name];
  for (const name of ["colour", "background"]) form.elements[name].value = `#${state[name]}`;
  for (const name of ["shadows", "photo", "gather"]) form.elements[name].checked = Boolean(state[name]);
  form.elements.photo.disabled = roomOf() === null || !isAtMaps(state);
  form.elements.drag.disabled = roomOf() === null;
  form.elements.gather.disabled = !roomOf()?.light;
  element("home").hidden = roomOf() === null || isAtMaps(state);
  for (const label of document.querySelectorAll(".lens")) label.hidden = !roomOf()?.files;
  showCosts(data, state.design);
  for (const name of ["background", "light"]) form.elements[name].disabled = roomOf() !== null;
  element("mesh").textContent = state.mesh;
}

function keepLink() {
  history.replaceState(null, "", `#${writeState(state)}`);
}

function show() {
  fail("");
  fill();
  keepLink();
  picture.update();
}

form.addEventListener("input", ({ target }) => {
  if (target.name === "drag") return;
  if (target.name === "degrees" || target.name === "step") return void then(() => openRoom(roomOf().files.found, roomOf().files.files));
  if (target.name in data.sliders) {
    state.design = data.sliders[target.name][target.value].design;
    return void then(changeDesign);
  }
  const value = target.type === "checkbox" ? Number(target.checked) : target.type === "color" ? target.value.slice(1) : target.value;
  state[target.name] = ["light", "bounces", "pixel"].includes(target.name) ? Number(value) : value;
  if (target.name === "design" || target.name === "room") then(changeDesign);
  else if (["material", "gather"].includes(target.name)) then(pack);
  else show();
  if (traced && target.name !== "pixel") follow();
});
form.addEventListener("submit", (event) => event.preventDefault());
for (const id of ["open", "open-room"]) element(id).onclick = () => element("file").click();
element("file").onchange = ({ target }) => openFiles(target.files).then(() => (target.value = ""));
element("home").onclick = () => then(() => Object.assign(state, ROOM_START));
element("teapot").onclick = () => then(openTeapot);
element("link").onclick = async ({ target }) => {
  await navigator.clipboard?.writeText(location.href).catch(() => {});
  target.textContent = "Copied";
  setTimeout(() => (target.textContent = "Copy"), 1500);
};
window.addEventListener("hashchange", () => {
  const { design, material, room } = state;
  const mesh = state.mesh;
  state = { ...readState(location.hash), mesh };
  then(async () => {
    const isOther = design !== state.design || room !== state.room;
    if (isOther) await openDesign();
    if (isOther || material !== state.material) await pack();
    if (state.follow) await followRay();
  });
});
stage.addEventListener("dragover", (event) => (event.preventDefault(), stage.classList.add("dropping")));
stage.addEventListener("dragleave", () => stage.classList.remove("dropping"));
stage.addEventListener("drop", (event) => {
  event.preventDefault();
  stage.classList.remove("dropping");
  droppedFiles(event.dataTransfer).then(openFiles).catch((error) => fail(error.message));
});

// Orbit

listen(stage, {
  orbit(azimuth, elevation, event) {
    const room = roomOf();
    if (room && (form.elements.drag.value === "camera" || event?.altKey || event?.ctrlKey)) {
      state.roomAzimuth = ((((state.roomAzimuth + azimuth + 180) % 360) + 360) % 360) - 180;
      state.roomElevation = Math.max(-89, Math.min(89, state.roomElevation + elevation));
      return showNotes();
    }
    state.azimuth = (((state.azimuth + azimuth) % 360) + 360) % 360;
    state.elevation = Math.max(-89, Math.min(89, state.elevation + elevation));
  },
  zoom(factor) {
    if (roomOf()) {
      state.roomDistance = Math.max(0.2, Math.min(5, state.roomDistance * factor));
      return showNotes();
    }
    state.distance = Math.max(1.8, Math.min(40, state.distance * factor));
  },
  pan(x, y) {
    const room = roomOf();
    if (room) {
      const depth = state.roomDistance * Math.hypot(...room.camera.position.map((value, axis) => value - room.object.position[axis]));
      state.roomX += (x * depth) / room.camera.lens[0];
      state.roomY += (y * depth) / room.camera.lens[0];
      return showNotes();
    }
    const height = 2 * state.distance * Math.tan((20 * Math.PI) / 180);
    state.x += x * height;
    state.y += y * height;
  },
  click(event) {
    const box = picture.canvas.getBoundingClientRect();
    const [width, height] = picture.size(state.pixel);
    const x = Math.floor(((event.clientX - box.left) / box.width) * width);
    const y = Math.floor(((event.clientY - box.top) / box.height) * height);
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    const { azimuth, elevation, distance, x: panX, y: panY } = state;
    const moved = roomOf() && !isAtMaps(state) ? Object.keys(ROOM_START).map((name) => state[name]) : [];
    state.follow = [x, y, width, height, azimuth, elevation, distance, panX, panY, ...moved].map((value) => Math.round(value * 1000) / 1000).join();
    keepLink();
    follow();
  },
  done: show,
});
stage.addEventListener("pointerdown", () => (element("hint").hidden = true));

// The ray of a pixel

/** The followed pixel, the frame that it is of, and the frame's orbit. */
function followed() {
  const [x, y, width, height, azimuth, elevation, distance, panX, panY, ...moved] = state.follow.split(",").map(Number);
  const inRoom = Object.entries(ROOM_START).map(([name, value], index) => [name, moved[index] ?? value]);
  return { x, y, width, height, orbit: { azimuth, elevation, distance, x: panX, y: panY, ...Object.fromEntries(inRoom) } };
}

/** Follows the ray of the state's pixel, after what is being done, unless more is to be done then. */
function follow() {
  queue = queue.then(() => works === 0 && followRay()).catch((error) => fail(error.message));
}

async function followRay() {
  if (!packed || !state.follow) return;
  const { x, y, width, height, orbit } = followed();
  const view = viewOf(scene(), roomOf(), width, height, orbit);
  traced = { x, y, width, height };
  const { steps } = await renderer.trace(view, x, y);
  rays = raysOf(steps, manifest.memories.columnBvh.line?.records);
  page.rays = rays;
  chosen = null;
  element("path").hidden = false;
  element("times").hidden = true;
  element("time").hidden = roomOf() !== null;
  element("pixel").textContent = `${x}, ${y}`;
  for (const head of document.querySelectorAll(".lines")) head.hidden = !manifest.memories.columnBvh.line;
  listRays();
}

function listRays() {
  showRays(rays, chosen, (index) => {
    chosen = chosen === index ? null : index;
    listRays();
  });
  drawPath();
}

function drawPath() {
  const canvas = overlay.canvas;
  const box = picture.box();
  canvas.width = Math.round(box.width * devicePixelRatio);
  canvas.height = Math.round(box.height * devicePixelRatio);
  if (!rays) return;
  const room = roomOf();
  const camera = room ? roomCamera(room, box.width, box.height, state) : cameraOf(state, box.width, box.height);
  draw(overlay, camera, poseIn(scene(), room, state), rays, 2 ** manifest.config.geometry.vertexBits - 1, chosen);
}

function forget() {
  rays = traced = undefined;
  state.follow = "";
  element("path").hidden = true;
  drawPath();
}
element("forget").onclick = () => (forget(), keepLink());

// The RTL

const panel = new RtlPanel(page, fail, () => ({ data, renderer, state, scene: scene() }));
element("time").onclick = () => panel.timePixel(followed());
element("rtl-start").onclick = () => panel.render();

// Start

async function start() {
  const texts = JSON.parse(element("data").textContent);
  const [code, json, teapot] = await Promise.all([texts.module, texts.data, texts.teapot].map(unpack));
  data = JSON.parse(new TextDecoder().decode(json));
  page.module = code;
  page.teapot = teapot;
  for (const name of Object.keys(data.rooms)) form.elements.room.add(new Option(name));
  listDesigns(data);
  element("about").textContent = `Colonnade ${data.version}. The page asks no other host for anything; a dropped file stays in the tab.`;
  renderer = new Renderer(element("worker").textContent, Math.max(1, Math.min(MOST_WORKERS, navigator.hardwareConcurrency || 1)));
  page.renderer = renderer;
  const now = () => ({ scene: scene(), room: roomOf(), discs: data.discs, isReady: Boolean(packed) && works === 0 });
  picture = new Picture({ renderer, page, now, drawn: drawPath, fail });
  const wanted = state.mesh;
  const followed = state.follow;
  const isLost = state.room !== "" && !(state.room in data.rooms);
  if (isLost) state.room = "";
  await openDesign();
  await openTeapot();
  if (isLost) page.mesh.notes.push("the link is of a room that it does not hold: drop photo and depth again");
  if (wanted !== "teapot.ply") {
    page.mesh.notes.push(`the link is of ${wanted}, which a link does not hold: drop the file; this is the teapot`);
  }
  showNotes();
  state.follow = followed;
  if (followed) await followRay();
  show();
  new ResizeObserver(() => picture.update()).observe(stage);
}

start().catch((error) => fail(error.message));
