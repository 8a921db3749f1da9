// SPDX-License-Identifier: Apache-2.0
// The page: controls, orbit, dropped files, the ray of a pixel.

import { CUBE, START, cameraOf, lightOf, poseOf, roomCamera } from "./camera.js";
import { hasRegister } from "./design.js";
import { draw, lineOf, raysOf } from "./path.js";
import { Renderer } from "./renderer.js";
import { readState, writeState } from "./state.js";

const LIGHT = [1.2, 1.6, 1.5];
const MOST_WORKERS = 8;
const COARSE = 4;
const GLASS = 1.5;

const element = (id) => document.getElementById(id);
/** Counters of the register map, in words. */
const NAMES = {
  raysPrimary: "primary rays", raysShadow: "shadow rays", raysReflection: "reflected rays", raysRefraction: "refracted rays",
  raysInBox: "rays in the box", nodeReads: "nodes read", boxTests: "boxes tested", triangleTests: "triangles tested",
  hits: "hits", deepestStack: "deepest stack",
};
/** The frame of the RTL. */
const RTL = { design: "tiny", width: 64, height: 48 };

const form = element("controls");
const stage = element("stage");
const picture = element("picture").getContext("2d");
const overlay = element("overlay").getContext("2d");

let data, renderer, manifest, packed, rays, chosen, traced;
let state = readState(location.hash);
let isChanged = false;
let isRunning = false;
/** What tests read: the last whole frame. */
const page = (window.colonnade = { frames: 0, picture: null });

async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

const bytesOf = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));

function colourOf(hex) {
  return [0, 2, 4].map((at) => {
    const value = parseInt(hex.slice(at, at + 2), 16) / 255;
    return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  });
}

/** The room of the state, if the hardware has its maps. */
const roomOf = () => (data.rooms[state.room]?.views[state.design] ? data.rooms[state.room] : null);

/** The registers that the mesh and the controls set. */
function registersOf(manifest, packed, room) {
  const { numbers, config } = manifest;
  const white = 2 ** numbers.colourBits - 1;
  const one = 2 ** numbers.lightFraction;
  const rgb = (name, colour) => Object.fromEntries([..."rgb"].map((channel, i) => [`${name}.${channel}`, Math.round(colour[i] * white)]));
  const registers = {
    ...(room ? {} : rgb("background", colourOf(state.background))),
    ...rgb("materials[0].albedo", colourOf(state.colour).map((value) => value / (materialOf(manifest) === "diffuse" ? (room?.headroom ?? 1) : 1))),
    "bounds.low.x": packed.lowX, "bounds.low.y": packed.lowY, "bounds.low.z": packed.lowZ,
    "bounds.high.x": packed.highX, "bounds.high.y": packed.highY, "bounds.high.z": packed.highZ,
    "scene.recordCount": packed.recordCount,
    "scene.triangleBase": packed.triangleBase,
    "scene.triangleRecords": packed.triangleRecords,
    "scene.attributeBase": packed.attributeBase,
    "shading.offset": packed.shadingOffset,
    "shading.shadows": state.shadows,
    "shading.bounces": Math.min(state.bounces, config.frame.maxBounces),
    "materials[0].hasCornerColours": Number(page.mesh.hasColours && state.material === "diffuse"),
    "materials[0].kind": ["diffuse", "mirror", "glass"].indexOf(materialOf(manifest)),
    "frame.watchdogCycles": 0,
  };
  if (materialOf(manifest) === "glass") {
    registers["materials[0].etaFront"] = Math.round(2 ** numbers.etaFraction / GLASS);
    registers["materials[0].etaBack"] = Math.round(2 ** numbers.etaFraction * GLASS);
    registers["materials[0].reflectance"] = Math.round(((GLASS - 1) / (GLASS + 1)) ** 2 * one);
  }
  return registers;
}

const materialOf = (manifest) => (manifest.config.frame.maxBounces > 0 ? state.material : "diffuse");

/** The object's pose in the room, turned by the orbit. */
const poseIn = (room, orbit) => (room ? poseOf(room, orbit.azimuth - START.azimuth, packed.lowY / (2 ** manifest.config.geometry.vertexBits - 1)) : CUBE);

/** A frame of the state, or of another orbit. In a room the camera is that of the maps, and an orbit turns the object. */
function viewOf(width, height, orbit = state) {
  const room = roomOf();
  if (!room) return plainView(width, height, manifest, packed, orbit);
  const file = String(room.height / height);
  return { file, camera: roomCamera(room, width, height), object: poseIn(room, orbit), lights: [], registers: registersOf(manifest, packed, room), inPhoto: Boolean(state.photo) };
}

function plainView(width, height, manifest, packed, orbit) {
  const light = { position: lightOf(cameraOf(START, width, height), LIGHT), colour: [0.9, 0.9, 0.9].map((value) => value * state.light) };
  return { file: "plain", camera: cameraOf(orbit, width, height), lights: [light], registers: registersOf(manifest, packed, null) };
}

/** The picture's box on the stage, in its pixels: in a room it has the room's proportions. */
function boxOf() {
  const [width, height] = [stage.clientWidth, stage.clientHeight];
  const room = roomOf();
  const scale = room ? Math.min(width / room.width, height / room.height) : 1;
  const size = room ? [room.width * scale, room.height * scale] : [width, height];
  return { left: (width - size[0]) / 2, top: (height - size[1]) / 2, width: size[0], height: size[1] };
}

/** The size of a frame, pixels, at so many of the screen's, or of the room's maps, for each. */
function sizeOf(pixel) {
  const room = roomOf();
  if (room) return [room.width / pixel, room.height / pixel];
  const { maxWidth, maxHeight } = manifest.config.frame;
  const scale = Math.min(1, maxWidth / stage.clientWidth, maxHeight / stage.clientHeight) / pixel;
  return [stage.clientWidth, stage.clientHeight].map((length) => Math.max(8, Math.floor(length * scale)));
}

/** Renders until the picture is that of the state: coarse at once, then whole, band by band. */
async function update() {
  if (!packed) return;
  isChanged = true;
  if (isRunning) return void renderer.stop();
  isRunning = true;
  try {
    while (isChanged) {
      isChanged = false;
      await render(roomOf() ? COARSE : COARSE * state.pixel, true);
      if (!isChanged) await render(state.pixel, false);
    }
    fail("");
  } catch (error) {
    fail(error.message);
  } finally {
    isRunning = false;
  }
}

async function render(pixel, isCoarse) {
  const box = boxOf();
  for (const canvas of [picture.canvas, overlay.canvas]) for (const [name, value] of Object.entries(box)) canvas.style[name] = `${value}px`;
  const [width, height] = sizeOf(pixel);
  const view = viewOf(width, height);
  const target = new OffscreenCanvas(width, height).getContext("2d");
  const whole = { width, height, view, colours: new Uint16Array(3 * width * height), ratios: new Uint16Array(3 * width * height), triangles: new Int32Array(width * height) };
  if (!isCoarse) Object.assign(picture.canvas, resized(picture.canvas, width, height));
  const frame = await renderer.frame(view, ({ first, last, pixels, colours, ratios, triangles }) => {
    const rows = new ImageData(pixels, width, last - first);
    if (isCoarse) target.putImageData(rows, 0, first);
    else if (!isChanged) picture.putImageData(rows, 0, first);
    whole.colours.set(colours, 3 * width * first);
    whole.ratios.set(ratios, 3 * width * first);
    whole.triangles.set(triangles, width * first);
  });
  if (frame === null) return;
  if (isCoarse) {
    Object.assign(picture.canvas, resized(picture.canvas, width, height));
    picture.drawImage(target.canvas, 0, 0);
    page.first ??= performance.now();
  } else {
    page.picture = whole;
    figures(width, height, frame);
    document.body.dataset.frames = page.frames += 1;
  }
  drawPath();
}

/** Keeps what a canvas shows when its size changes. */
function resized(canvas, width, height) {
  if (canvas.width === width && canvas.height === height) return {};
  const before = new OffscreenCanvas(canvas.width, canvas.height);
  before.getContext("2d").drawImage(canvas, 0, 0);
  canvas.width = width;
  canvas.height = height;
  picture.imageSmoothingEnabled = true;
  picture.drawImage(before, 0, 0, width, height);
  return {};
}

function figures(width, height, { counters, milliseconds }) {
  const rate = counters.raysInBox / milliseconds;
  const rows = {
    frame: `${width} × ${height}`,
    "time in this tab": `${Math.round(milliseconds)} ms, ${renderer.workers.length} workers`,
    "in-box rays a second": Math.round(1000 * rate).toLocaleString("en"),
    "triangles, records": `${packed.triangles.toLocaleString("en")}, ${packed.recordCount.toLocaleString("en")}`,
    "depth of the tree": packed.treeDepth,
    "packed in": `${Math.round(page.packTime)} ms`,
    ...Object.fromEntries(Object.entries(counters).map(([name, value]) => [NAMES[name], value.toLocaleString("en")])),
  };
  const body = element("figures").tBodies[0];
  body.replaceChildren(...Object.entries(rows).map(([name, value]) => row([name, value])));
}

function row(cells) {
  const line = document.createElement("tr");
  for (const cell of cells) line.insertCell().textContent = cell;
  return line;
}

function fail(text) {
  element("error").textContent = text;
  element("error").hidden = text === "";
}

function showNotes() {
  const notes = [...page.mesh.notes];
  if (packed.dropped) notes.push(`${packed.dropped.toLocaleString("en")} faces without area, or there twice, are left out`);
  if (packed.flipped) notes.push(`normals of ${packed.flipped.toLocaleString("en")} faces pointed to their back and are negated`);
  if (page.mesh.hasColours && !hasRegister(manifest, "materials[0].hasCornerColours")) notes.push("this hardware has no corner colours: the mesh has one colour");
  if (state.room && !roomOf())
    notes.push(manifest.attributes ? "the page has rooms for presets only" : "this hardware has no maps of a room");
  if (materialOf(manifest) !== state.material) notes.push("this hardware has neither mirrors nor glass");
  element("notes").replaceChildren(
    ...notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })),
  );
}

// Meshes and designs

async function openDesign() {
  manifest = data.manifests[state.design] ?? data.manifests[(state.design = "textured")];
  const room = roomOf();
  const files = room ? room.views[state.design] : { plain: data.views[state.design] };
  const views = Object.fromEntries(Object.entries(files).map(([name, text]) => [name, bytesOf(text)]));
  const maps = (room?.maps ?? []).map(({ words, ...map }) => ({ ...map, words: bytesOf(words) }));
  await renderer.open({ module: page.module, manifest, views, maps, photo: room && (await photoOf(room)) });
}

/** The pixels of a room's photo. */
async function photoOf({ photo, width, height }) {
  const picture = await createImageBitmap(new Blob([bytesOf(photo)], { type: "image/jpeg" }));
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(picture, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  return { data, width, height };
}

async function changeDesign() {
  await openDesign();
  forget();
  await pack();
}

async function pack() {
  const answer = await renderer.pack(materialOf(manifest) === "glass");
  packed = answer.packed;
  page.packTime = answer.milliseconds;
  page.packed = packed;
  showNotes();
}

/** Does one thing after the other, and then renders. */
let queue = Promise.resolve();
function then(work) {
  queue = queue
    .then(async () => {
      await renderer.stop();
      await work();
      show();
    })
    .catch((error) => fail(error.message));
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

async function openFiles(list) {
  const files = new Map(await Promise.all([...list].map(async (file) => [file.name, new Uint8Array(await file.arrayBuffer())])));
  const name = [...files.keys()].find((each) => /\.(obj|ply|glb|gltf)$/i.test(each)) ?? [...files.keys()][0];
  if (name !== undefined) await then(() => readFile(name, files.get(name), files));
}

const openTeapot = () => readFile("teapot.ply", page.teapot, new Map());

// Controls, and the link

function fill() {
  for (const name of ["design", "room", "material", "light", "bounces", "pixel"]) form.elements[name].value = state[name];
  for (const name of ["colour", "background"]) form.elements[name].value = `#${state[name]}`;
  for (const name of ["shadows", "photo"]) form.elements[name].checked = Boolean(state[name]);
  form.elements.photo.disabled = roomOf() === null;
  showCosts();
  for (const name of ["background", "light"]) form.elements[name].disabled = roomOf() !== null;
  element("mesh").textContent = state.mesh;
}

function keepLink() {
  history.replaceState(null, "", `#${writeState(state)}`);
}

function show() {
  fill();
  keepLink();
  update();
}

form.addEventListener("input", ({ target }) => {
  if (target.name === "precision") {
    state.design = data.studies[0].points[target.value].design;
    return void then(changeDesign);
  }
  const value = target.type === "checkbox" ? Number(target.checked) : target.type === "color" ? target.value.slice(1) : target.value;
  state[target.name] = ["light", "bounces", "pixel"].includes(target.name) ? Number(value) : value;
  if (target.name === "design" || target.name === "room") then(changeDesign);
  else if (target.name === "material") then(pack);
  else show();
  if (traced && target.name !== "pixel") follow();
});
form.addEventListener("submit", (event) => event.preventDefault());
element("open").onclick = () => element("file").click();
element("file").onchange = ({ target }) => openFiles(target.files);
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
    if (state.follow) await follow();
  });
});
stage.addEventListener("dragover", (event) => (event.preventDefault(), stage.classList.add("dropping")));
stage.addEventListener("dragleave", () => stage.classList.remove("dropping"));
stage.addEventListener("drop", (event) => {
  event.preventDefault();
  stage.classList.remove("dropping");
  openFiles(event.dataTransfer.files);
});

// Studies

function listDesigns() {
  const group = (label, names) => {
    const options = Object.assign(document.createElement("optgroup"), { label });
    options.append(...names.map((name) => new Option(name)));
    form.elements.design.append(options);
  };
  group("Presets", data.presets);
  for (const { title, points } of data.studies) group(title, points.map(({ design }) => design).filter((name) => !data.presets.includes(name)));
  form.elements.precision.max = data.studies[0].points.length - 1;
}

/** Error, energy, area and rate of the hardware, from the studies that have it. */
function showCosts() {
  const index = data.studies[0].points.findIndex(({ design }) => design === state.design);
  if (index >= 0) form.elements.precision.value = index;
  element("precision").textContent = index >= 0 ? state.design : "";
  const lines = [];
  for (const { title, command, columns, points } of data.studies) {
    const point = points.find(({ design }) => design === state.design);
    if (!point) continue;
    const known = columns.filter(({ key }) => point.figures[key] !== null);
    lines.push(...known.map(({ key, label, unit, format }) => row([label, `${point.figures[key].toFixed(Number(/[.](\d)/.exec(format)[1]))} ${unit}`])));
    element("study").textContent = `${title}: ${command}`;
  }
  element("costs").hidden = lines.length === 0;
  element("costs").tBodies[0].replaceChildren(...lines);
}

// Orbit

const pointers = new Map();
let moved = 0;
stage.addEventListener("pointerdown", (event) => {
  stage.setPointerCapture(event.pointerId);
  element("hint").hidden = true;
  pointers.set(event.pointerId, event);
  moved = pointers.size > 1 ? Infinity : 0;
});
stage.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const other = [...pointers.values()].find(({ pointerId }) => pointerId !== event.pointerId);
  const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
  moved += Math.hypot(x, y);
  if (moved < 4) return;
  pointers.set(event.pointerId, event);
  const unit = (2 * state.distance * Math.tan((20 * Math.PI) / 180)) / stage.clientHeight;
  if (other) {
    const length = ({ clientX, clientY }) => Math.hypot(clientX - other.clientX, clientY - other.clientY);
    zoom(length(before) / Math.max(1, length(event)));
    pan((-x * unit) / 2, (y * unit) / 2);
  } else if (event.shiftKey || event.buttons === 2) pan(-x * unit, y * unit);
  else orbit(-0.4 * x, 0.4 * y);
  show();
});
stage.addEventListener("pointerup", (event) => {
  pointers.delete(event.pointerId);
  if (moved >= 4) return;
  const box = picture.canvas.getBoundingClientRect();
  const [width, height] = sizeOf(state.pixel);
  const x = Math.floor(((event.clientX - box.left) / box.width) * width);
  const y = Math.floor(((event.clientY - box.top) / box.height) * height);
  if (x < 0 || y < 0 || x >= width || y >= height) return;
  const { azimuth, elevation, distance, x: panX, y: panY } = state;
  state.follow = [x, y, width, height, azimuth, elevation, distance, panX, panY].map((value) => Math.round(value * 1000) / 1000).join();
  keepLink();
  follow();
});
stage.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
stage.addEventListener("contextmenu", (event) => event.preventDefault());
stage.addEventListener("wheel", (event) => (event.preventDefault(), zoom(Math.exp(event.deltaY / 600)), show()), { passive: false });
stage.addEventListener("keydown", ({ key }) => {
  const steps = { ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] };
  if (steps[key]) orbit(...steps[key]);
  else if (key === "+" || key === "-") zoom(key === "+" ? 0.9 : 1 / 0.9);
  else return;
  show();
});

function orbit(azimuth, elevation) {
  state.azimuth = (((state.azimuth + azimuth) % 360) + 360) % 360;
  state.elevation = Math.max(-89, Math.min(89, state.elevation + elevation));
}

function zoom(factor) {
  state.distance = Math.max(1.8, Math.min(40, state.distance * factor));
}

function pan(x, y) {
  state.x += x;
  state.y += y;
}

// The ray of a pixel

async function follow() {
  if (!packed || !state.follow) return;
  const [x, y, width, height, azimuth, elevation, distance, panX, panY] = state.follow.split(",").map(Number);
  const view = viewOf(width, height, { azimuth, elevation, distance, x: panX, y: panY });
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
  const body = element("rays").tBodies[0];
  body.replaceChildren(
    ...rays.map((ray, index) => {
      const { kind, nodes, boxes, entered, triangles, records, lines, hit, blocker } = ray;
      const cells = [kind, nodes, boxes, entered, triangles, records, ...(lines === null ? [] : [lines])];
      const line = row([...cells, hit !== null ? hit : ray.kind === "shadow" && blocker ? `${blocker.value}` : "–"]);
      line.classList.toggle("chosen", chosen === index);
      line.onclick = () => {
        chosen = chosen === index ? null : index;
        listRays();
      };
      return line;
    }),
  );
  const ray = rays[chosen ?? 0];
  element("steps").replaceChildren(
    ...(ray?.steps ?? []).map((step) => {
      const item = document.createElement("li");
      item.textContent = lineOf(step);
      if (step.kind === 2 || step.kind === 4) item.className = "indent";
      if (step.kind === 4 && step.isHit) item.classList.add("hit");
      return item;
    }),
  );
  drawPath();
}

function drawPath() {
  const canvas = overlay.canvas;
  const box = boxOf();
  canvas.width = Math.round(box.width * devicePixelRatio);
  canvas.height = Math.round(box.height * devicePixelRatio);
  if (!rays) return;
  const room = roomOf();
  const camera = room ? roomCamera(room, box.width, box.height) : cameraOf(state, box.width, box.height);
  draw(overlay, camera, poseIn(room, state), rays, 2 ** manifest.config.geometry.vertexBits - 1, chosen);
}

function forget() {
  rays = traced = undefined;
  state.follow = "";
  element("path").hidden = true;
  drawPath();
}
element("forget").onclick = () => (forget(), keepLink());

// The RTL

/** Where the cycles of a pixel alone go: counters of `tiny` that count each context's cycles in a state. */
const STATES = {
  contextsRaySetup: "ray set-up", waitRecord: "waits for a record", waitUnit: "waits for a unit", contextsBox: "box tests",
  contextsTriangles: "triangle tests", contextsShading: "shading",
};

async function timePixel() {
  const button = element("time");
  button.disabled = true;
  try {
    const [x, y, width, height, azimuth, elevation, distance, panX, panY] = state.follow.split(",").map(Number);
    const viewFor = (manifest, packed) => {
      const view = plainView(width, height, manifest, packed, { azimuth, elevation, distance, x: panX, y: panY });
      return { ...view, camera: { ...view.camera, width: 1, height: 1, centre: [width / 2 - x, height / 2 - y] } };
    };
    const { frame, model } = await byRtl(viewFor, () => {});
    const { counters } = frame;
    page.pixelCounters = counters;
    const isEqual = (await hashOf(frame)) === (await hashOf(model));
    const rows = [
      ["cycles of the frame", counters.cycles],
      ...Object.entries(STATES).filter(([name]) => name in counters).map(([name, label]) => [label, counters[name]]),
    ];
    element("times").tBodies[0].replaceChildren(...rows.map(([label, value]) => row([label, value.toLocaleString("en")])));
    element("times").caption.textContent = `A frame of this pixel by the RTL of ${RTL.design}; its colour ${isEqual ? "is" : "is not"} the model's`;
    element("times").hidden = false;
  } catch (error) {
    fail(error.message);
  } finally {
    button.disabled = false;
  }
}
element("time").onclick = timePixel;

/** Renders by RTL and model: a view of the open mesh for a manifest and its packed mesh. */
async function byRtl(viewFor, onSlice) {
  const manifest = data.manifests[RTL.design];
  const rtl = await unpack(JSON.parse(element("data").textContent).rtl);
  const opened = { module: page.module, manifest, views: { plain: bytesOf(data.views[RTL.design]) }, maps: [], photo: null };
  return renderer.aside(opened, page.file, (worker, { packed }) =>
    renderer.ask(worker, "rtl", { rtl, packed, view: viewFor(manifest, packed) }, onSlice),
  );
}

async function renderRtl() {
  const status = element("rtl-status");
  const [own, models] = ["rtl-frame", "rtl-model"].map((id) => element(id).getContext("2d"));
  const { width, height } = RTL;
  element("rtl-start").disabled = true;
  element("rtl").classList.add("started");
  try {
    const begin = performance.now();
    const viewFor = (manifest, packed) => plainView(width, height, manifest, packed, state);
    const answer = await byRtl(viewFor, ({ cycles, pixels }) => {
      own.putImageData(new ImageData(pixels, width, height), 0, 0);
      status.textContent = `${cycles.toLocaleString("en")} cycles, ${Math.round(cycles / (performance.now() - begin))} thousand a second`;
    });
    await showRtl(answer, own, models);
  } catch (error) {
    status.textContent = error.message;
  } finally {
    element("rtl-start").disabled = false;
  }
}

async function showRtl({ frame, model, framePixels, modelPixels }, own, models) {
  const { width, height } = RTL;
  own.putImageData(new ImageData(framePixels, width, height), 0, 0);
  models.putImageData(new ImageData(modelPixels, width, height), 0, 0);
  const hashes = await Promise.all([frame, model].map(hashOf));
  const counters = Object.keys(model.counters).filter((name) => name in frame.counters);
  const different = counters.filter((name) => frame.counters[name] !== model.counters[name]);
  page.rtl = { hashes, different, counters: frame.counters };
  const isEqual = hashes[0] === hashes[1] && different.length === 0;
  element("rtl-status").textContent = isEqual
    ? `Equal: ${width * height} pixels with their triangles, ${counters.length} counters. SHA-256 of both: ${hashes[0].slice(0, 16)}…`
    : `Different: ${hashes.map((hash) => hash.slice(0, 16)).join(" and ")}; counters: ${different.join(", ") || "none"}`;
  const rows = Object.entries(frame.counters).map(([name, value]) => [name, value.toLocaleString("en"), name in model.counters ? model.counters[name].toLocaleString("en") : "–"]);
  element("rtl-counters").tBodies[0].replaceChildren(...rows.map(row));
}

async function hashOf({ colours, triangles }) {
  const bytes = await new Blob([colours, triangles]).arrayBuffer();
  return [...new Uint8Array(await crypto.subtle.digest("SHA-256", bytes))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
element("rtl-start").onclick = renderRtl;

// Start

async function start() {
  const texts = JSON.parse(element("data").textContent);
  const [code, json, teapot] = await Promise.all([texts.module, texts.data, texts.teapot].map(unpack));
  data = JSON.parse(new TextDecoder().decode(json));
  page.module = code;
  page.teapot = teapot;
  for (const name of Object.keys(data.rooms)) form.elements.room.add(new Option(name));
  listDesigns();
  element("about").textContent = `Colonnade ${data.version}. The page asks no other host for anything; a dropped file stays in the tab.`;
  renderer = new Renderer(element("worker").textContent, Math.max(1, Math.min(MOST_WORKERS, navigator.hardwareConcurrency || 1)));
  page.renderer = renderer;
  page.viewOf = viewOf;
  const wanted = state.mesh;
  const followed = state.follow;
  await openDesign();
  await openTeapot();
  if (wanted !== "teapot.ply") {
    page.mesh.notes.push(`the link is of ${wanted}, which a link does not hold: drop the file; this is the teapot`);
    showNotes();
  }
  state.follow = followed;
  if (followed) await follow();
  show();
  new ResizeObserver(() => update()).observe(stage);
}

start().catch((error) => fail(error.message));
