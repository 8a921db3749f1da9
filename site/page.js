// The page: controls, orbit, dropped files, the ray of a pixel.

import { ROOM_START, START, isAtMaps } from "./camera.js";
import { droppedFiles, roomFiles } from "./files.js";
import { orbitBy, panBy, zoomBy } from "./moves.js";
import { notesOf } from "./notes.js";
import { listen } from "./orbit.js";
import { element, listDesigns, showCosts } from "./panels.js";
import { Picture } from "./picture.js";
import { Player, listAnimations } from "./player.js";
import { Queue } from "./queue.js";
import { RayPanel } from "./raypanel.js";
import { Renderer, bytesOf, unpack } from "./renderer.js";
import { RtlPanel } from "./rtlpanel.js";
import { DEFAULTS, RANGES, followOf, followText, readState, writeState } from "./state.js";
import { surfaceOf } from "./view.js";
import { hasRoom, placeOf, placedRoom, templateFor, visitorRoom } from "./visitor.js";

const MOST_WORKERS = 8;
/** A level surface so near to a double click counts, pixels of the maps. */
const STAND_WITHIN = 40;

const form = element("controls");
const stage = element("stage");

let data, renderer, picture, state, manifest, packed;
/** What the link is of, and the page does not have. */
let linkNotes = [];
/**
 * The design and room that the workers have, and those with which they have the mesh, too; the replaced workers that
 * have all of it.
 */
let opened = null,
  shown = null,
  restored = 0;
const isWhole = () => shown === opened && restored === (renderer?.replaced ?? 0);
/** What tests read: the last whole frame, the light of its room, and its last pass. @type {any} */
const page = (globalThis.colonnade = { frames: 0, picture: null });

/** The room of the state, as the hardware has it; null if it has no maps. */
function roomOf() {
  const room = data.rooms[state.room];
  return hasRoom(room, state.design) ? room : null;
}

const player = new Player(() => picture?.update());
const scene = () => ({ state, mesh: page.mesh, manifest, packed, time: player.time });
const ray = new RayPanel(page, () => ({ renderer, picture, scene: scene(), room: roomOf() }));

function fail(text) {
  element("error").textContent = text;
  element("error").hidden = text === "";
}

function showNotes() {
  element("notes").replaceChildren(
    ...[...linkNotes, ...notesOf(scene(), roomOf())].map((note) =>
      Object.assign(document.createElement("li"), { textContent: note }),
    ),
  );
}

// Meshes and designs

async function openDesign() {
  opened = { design: state.design, room: state.room };
  manifest = data.manifests[state.design];
  const room = roomOf();
  const files = room ? room.views[state.design] : { plain: data.views[state.design] };
  const views = Object.fromEntries(Object.entries(files).map(([name, text]) => [name, bytesOf(text)]));
  const maps = (room?.maps ?? []).map(({ words, ...map }) => ({ ...map, words: bytesOf(words) }));
  const light = room ? (room.light.radiance ?? bytesOf(room.light.cube)) : null;
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
  ray.forget();
  await pack();
}

async function pack() {
  const answer = await renderer.pack(surfaceOf(scene(), roomOf()));
  packed = answer.packed;
  shown = opened;
  page.packTime = answer.milliseconds;
  page.packed = packed;
  showNotes();
}

/** Works change design, room or mesh; until they are done the state is ahead, and nothing is rendered. */
const queue = new Queue(element("busy"), {
  async before() {
    await renderer?.stop().catch(() => {}); // of one that is replaced
    await restore();
  },
  async failed(error) {
    fail(error.message);
    // Back to the hardware and the room of before, unless others are chosen already
    if (!isWhole() && shown && queue.waiting.length === 1) Object.assign(state, shown);
    await restore().catch((again) => fail(again.message));
  },
  done(isWell) {
    if (isWell) fail("");
    if (picture) show();
  },
});

/** Gives the workers design, room and mesh, where some do not have them. */
async function restore() {
  if (isWhole()) return;
  const { replaced } = renderer;
  await openDesign();
  if (page.file) {
    await renderer.read(page.file);
    await pack();
  }
  restored = replaced;
}

/** An error of a picture or a ray. */
function failWhenIdle(error) {
  if (isWhole()) return fail(error.message);
  queue.add("Starting a worker", () => {
    throw error;
  });
}

/**
 * Reads and packs a file, with one of its animations, the first unless given; if it cannot be, the mesh stays what it
 * was.
 */
async function readFile(name, bytes, files, animation = undefined) {
  const [{ mesh }, { material }] = [page, state];
  const file = { name, bytes, files, animation };
  try {
    page.mesh = await renderer.read(file);
    if (page.mesh.hasMaterials && page.file?.bytes !== bytes) state.material = "file";
    await pack();
  } catch (error) {
    page.mesh = mesh;
    state.material = material;
    throw error;
  } finally {
    listAnimations(page.mesh?.animations ?? [], page.mesh?.animation);
  }
  page.file = { ...file, animation: page.mesh.animation };
  state.mesh = name;
  player.open(packed.duration);
  linkNotes = [];
  ray.forget();
}

// A visitor's room

/** Makes a room of a photo and its depth, and shows it; if it cannot be made, the room stays what it was. */
async function openRoom(found, files) {
  const settings = { degrees: form.elements.degrees.valueAsNumber, millimetres: form.elements.step.valueAsNumber };
  const { template, design } = templateFor(data.rooms, state.design);
  const room = await visitorRoom(renderer, data.manifests[design], template, found, files, settings);
  if (!data.rooms[found.photo]) form.elements.room.add(new Option(found.photo));
  data.rooms[found.photo] = page.room = room;
  Object.assign(state, { design, room: found.photo, ...ROOM_START, azimuth: START.azimuth });
  await changeDesign();
}

/** Stands the object of a visitor's room on the surface at a pixel. */
stage.addEventListener("dblclick", (event) => {
  const room = roomOf();
  if (!room?.files || !isAtMaps(state)) return;
  const box = picture.canvas.getBoundingClientRect();
  const place = placeOf(
    room,
    ((event.clientX - box.left) / box.width) * room.width,
    ((event.clientY - box.top) / box.height) * room.height,
    STAND_WITHIN,
  );
  queue.add("Moving the object", async () => {
    const own = data.rooms[state.room];
    Object.assign(own, await placedRoom(renderer, own, templateFor(data.rooms, state.design).template, place));
    await changeDesign();
  });
});

/**
 * Opens files: a mesh with what it names, or a photo with its depth; a promise of them shows at once that it is
 * awaited.
 */
function openFiles(promise) {
  promise.catch(() => {}); // the work says it
  queue.add("Reading the files", async () => {
    const files = new Map(
      await Promise.all(
        [...(await promise)].map(
          async (file) => /** @type {const} */ ([file.name, new Uint8Array(await file.arrayBuffer())]),
        ),
      ),
    );
    const names = [...files.keys()];
    const mesh = names.find((name) => /\.(obj|ply|stl|off|glb|gltf)$/i.test(name));
    if (!mesh && names.some((name) => /\.(jpe?g|png|webp|npy)$/i.test(name))) return openRoom(roomFiles(files), files);
    const name = mesh ?? names[0];
    if (name !== undefined) await readFile(name, files.get(name), files);
  });
}

const openTeapot = () => readFile("teapot.ply", null, new Map());

// Controls, and the link

function fill() {
  for (const name of ["design", "room", "material", "light", "bounces", "pixel"])
    form.elements[name].value = state[name];
  for (const name of ["colour", "background"]) form.elements[name].value = `#${state[name]}`;
  for (const name of ["shadows", "photo", "gather"]) form.elements[name].checked = Boolean(state[name]);
  form.elements.photo.disabled = roomOf() === null || !isAtMaps(state);
  form.elements.drag.disabled = roomOf() === null;
  form.elements.gather.disabled = !roomOf()?.light;
  element("home").hidden = roomOf() === null || isAtMaps(state);
  for (const label of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(".lens")))
    label.hidden = !roomOf()?.files;
  showCosts(data, state.design);
  for (const name of ["background", "light"]) form.elements[name].disabled = roomOf() !== null;
  element("mesh").textContent = state.mesh;
  for (const option of form.elements.material.options)
    if (option.value === "file") option.disabled = !page.mesh?.hasMaterials;
  form.elements.colour.disabled = Boolean(packed?.entries);
}

function keepLink() {
  history.replaceState(null, "", `#${writeState(state)}`);
}

function show() {
  fill();
  keepLink();
  picture.update();
}

/** After a change that needs no work. */
function moved() {
  fail("");
  showNotes();
  show();
}

form.addEventListener("input", ({ target }) => {
  if (target.name === "drag" || target.id === "moment") return;
  if (target.name === "animation")
    return void queue.add("Reading the animation", () =>
      readFile(page.file.name, page.file.bytes, page.file.files, target.value === "" ? null : Number(target.value)),
    );
  if (target.name === "degrees" || target.name === "step")
    return void queue.add("Making the maps", () => openRoom(roomOf().files.found, roomOf().files.files));
  if (target.name in data.sliders) {
    state.design = data.sliders[target.name][target.value].design;
    showCosts(data, state.design);
    return void queue.add(`Opening ${state.design}`, changeDesign);
  }
  const value =
    target.type === "checkbox"
      ? Number(target.checked)
      : target.type === "color"
        ? target.value.slice(1)
        : target.value;
  state[target.name] = ["light", "bounces", "pixel"].includes(target.name) ? Number(value) : value;
  if (target.name === "design" || target.name === "room") queue.add(`Opening ${value || "no room"}`, changeDesign);
  else if (["material", "gather"].includes(target.name)) queue.add("Packing the mesh", pack);
  else moved();
  if (ray.rays && target.name !== "pixel") follow();
});
form.addEventListener("submit", (event) => event.preventDefault());
for (const id of ["open", "open-room"]) element(id).onclick = () => element("file").click();
element("file").onchange = ({ target }) => {
  openFiles(Promise.resolve([...target.files]));
  target.value = "";
};
element("home").onclick = () => queue.add("Going back to the photo", () => Object.assign(state, ROOM_START));
element("teapot").onclick = () => queue.add("Reading the teapot", openTeapot);
element("link").onclick = async ({ target }) => {
  await navigator.clipboard?.writeText(location.href).catch(() => {});
  target.textContent = "Copied";
  setTimeout(() => (target.textContent = "Copy"), 1500);
};
window.addEventListener("hashchange", () => {
  if (!state) return;
  const { material, mesh } = state;
  state = { ...linkedState(), mesh };
  queue.add("Opening the link", async () => {
    const isOther = opened.design !== state.design || opened.room !== state.room;
    if (isOther) await openDesign();
    if (isOther || material !== state.material) await pack();
    if (state.follow) await ray.follow();
    else ray.forget();
  });
});
window.addEventListener("dragover", (event) => (event.preventDefault(), stage.classList.add("dropping")));
window.addEventListener("dragleave", () => stage.classList.remove("dropping"));
window.addEventListener("drop", (event) => {
  event.preventDefault();
  stage.classList.remove("dropping");
  openFiles(droppedFiles(event.dataTransfer));
});

/** The state of the link; of hardware and rooms that the page does not have there are notes. */
function linkedState() {
  const linked = readState(location.hash);
  linkNotes = [];
  if (!(linked.design in data.manifests)) {
    linkNotes.push(`the link is of ${linked.design}, which the page does not have: this is ${DEFAULTS.design}`);
    linked.design = DEFAULTS.design;
  }
  if (linked.room !== "" && !(linked.room in data.rooms)) {
    linkNotes.push("the link is of a room that it does not hold: drop photo and depth again");
    linked.room = "";
  }
  return linked;
}

// Orbit

listen(stage, {
  orbit: (azimuth, elevation, event) =>
    orbitBy(
      state,
      roomOf(),
      form.elements.drag.value === "camera" || event?.altKey || event?.ctrlKey,
      azimuth,
      elevation,
    ),
  zoom: (factor) => zoomBy(state, roomOf(), factor),
  pan: (x, y) => panBy(state, roomOf(), x, y),
  click(event) {
    const box = picture.canvas.getBoundingClientRect();
    const [width, height] = picture.size(state.pixel);
    const x = Math.floor(((event.clientX - box.left) / box.width) * width);
    const y = Math.floor(((event.clientY - box.top) / box.height) * height);
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    player.pause();
    state.follow = followText({ x, y, width, height, orbit: state }, roomOf() && !isAtMaps(state));
    keepLink();
    follow();
  },
  done: moved,
});
stage.addEventListener("pointerdown", () => (element("hint").hidden = true));

/** Follows the ray of the state's pixel, after what is being done, unless more is to be done then. */
function follow() {
  queue.addIdle(() => ray.follow(), failWhenIdle);
}

element("forget").onclick = () => (ray.forget(), keepLink());

// The RTL

const panel = new RtlPanel(page, fail, () => ({ data, renderer, state, scene: scene() }));
element("time").onclick = () => panel.timePixel(followOf(state.follow));
element("rtl-start").onclick = () => panel.render();

// Start

/** After a frame. */
function drawn() {
  ray.draw();
  player.show();
  if (!player.isPlaying) showNotes();
}

async function start() {
  const texts = JSON.parse(element("data").textContent);
  const [code, json] = await Promise.all([texts.module, texts.data].map(unpack));
  data = JSON.parse(new TextDecoder().decode(json));
  // Links have names: those of objects are none
  for (const name of ["manifests", "rooms", "views", "sliders", "cycles"]) Object.setPrototypeOf(data[name], null);
  page.module = code;
  for (const name of Object.keys(data.rooms)) form.elements.room.add(new Option(name));
  for (const name of ["light", "bounces"]) [form.elements[name].min, form.elements[name].max] = RANGES[name];
  listDesigns(data);
  element("about").textContent =
    `Colonnade ${data.version}. The page asks no other host for anything; a dropped file stays in the tab.`;
  renderer = page.renderer = new Renderer(
    element("worker").textContent,
    Math.max(1, Math.min(MOST_WORKERS, navigator.hardwareConcurrency || 1)),
  );
  const now = () => ({
    scene: scene(),
    room: roomOf(),
    samples: data.samples,
    isPlaying: player.isPlaying,
    isReady: Boolean(packed) && !queue.isBusy && isWhole(),
  });
  picture = new Picture({ renderer, page, now, drawn, fail: failWhenIdle });
  state = linkedState();
  const { mesh, follow: followed } = state;
  if (mesh !== DEFAULTS.mesh)
    linkNotes.push(`the link is of ${mesh}, which a link does not hold: drop the file; this is the teapot`);
  const notes = linkNotes;
  await openDesign();
  await openTeapot();
  linkNotes = notes;
  showNotes();
  state.follow = followed;
  await ray.follow();
  document.body.inert = false;
  new ResizeObserver(() => picture.update()).observe(stage);
}

queue.add("Loading", start);
