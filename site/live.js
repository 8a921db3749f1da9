// The page of `colonnade view`: asks the server for frames of its camera, and shows what it says about the scene.

import { listen } from "./orbit.js";

/** @returns {any} */
const element = (id) => document.getElementById(id);
const stage = element("stage");
const canvas = element("picture");
const picture = canvas.getContext("2d");

let state = null;
/** The camera that was moved, or null: that of the file. */
let camera = null;
/** The moment of the motion that is shown, 0 to 1, or null: its start; and when the motion began, while it plays. */
let at = null;
let began = null;
let isWanted = false;
let isBusy = false;
/** The wait for a camera that rests, milliseconds, and its timer. */
const REST = 250;
let rest = 0;
/** Fewer samples are not shown: their mean is beside the pixels' middle. */
const SHOWN_SAMPLES = 4;
const times = [];
/** What tests read: frames so far, and the version of the last. @type {any} */
const page = (globalThis.colonnade = { frames: 0, version: 0 });

// Vectors

const add = (a, b, scale = 1) => a.map((value, axis) => value + scale * b[axis]);
const dot = (a, b) => a.reduce((sum, value, axis) => sum + value * b[axis], 0);
const cross = (a, b) =>
  [0, 1, 2].map((axis) => a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3]);
const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));

/** The camera's place from its target: distance, unit vectors up and away over the ground, and elevation. */
function orbitOf({ position, target }) {
  const up = unit(state.camera.up);
  const away = add(position, target, -1);
  const distance = Math.hypot(...away);
  const flat = add(away, up, -dot(away, up));
  const ground =
    Math.hypot(...flat) > 1e-6 * distance ? unit(flat) : unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
  return { up, ground, distance, elevation: Math.asin(Math.max(-1, Math.min(1, dot(away, up) / distance))) };
}

function moved(change) {
  if (!state) return;
  const from = camera ?? { position: state.camera.position, target: state.camera.target };
  camera = change(from, orbitOf(from));
}

const actions = {
  orbit(azimuth, elevation) {
    moved(({ target }, { up, ground, distance, elevation: before }) => {
      const [turn, most] = [(azimuth * Math.PI) / 180, (89 * Math.PI) / 180];
      const after = Math.max(-most, Math.min(most, before + (elevation * Math.PI) / 180));
      const way = add(
        ground.map((value) => Math.cos(turn) * value),
        cross(up, ground),
        Math.sin(turn),
      );
      const away = add(
        way.map((value) => Math.cos(after) * value),
        up,
        Math.sin(after),
      );
      return { target, position: add(target, away, distance) };
    });
  },
  zoom(factor) {
    moved(({ position, target }) => ({ target, position: add(target, add(position, target, -1), factor) }));
  },
  pan(x, y) {
    moved(({ position, target }, { up, distance }) => {
      const back = unit(add(position, target, -1));
      const right = unit(cross(up, back));
      const height = state.camera.span * distance;
      const shift = add(
        right.map((value) => x * height * value),
        cross(back, right),
        y * height,
      );
      return { position: add(position, shift), target: add(target, shift) };
    });
  },
  click() {},
  done: draw,
};

// Frames

/** Asks for a picture of the camera; while one is on its way, for the next one after it. Then the camera rests. */
async function draw() {
  isWanted = true;
  clearTimeout(rest);
  if (isBusy) return;
  isBusy = true;
  try {
    while (isWanted || (began !== null && !document.hidden)) {
      isWanted = false;
      if (began !== null) at = ((performance.now() - began) / 1000 / state.seconds) % 1;
      await frame();
    }
  } catch (error) {
    pause();
    fail(`the server does not answer: ${error.message}`);
  } finally {
    isBusy = false;
  }
  rest = window.setTimeout(accumulate, REST);
}

/** Further passes of a camera that rests, one after the other; another page's camera ends them. */
async function accumulate(before = 0) {
  if (isBusy) return;
  const figures = await frame(true).catch(() => null);
  if (figures && !isBusy && figures.samples > before && figures.samples < figures.final)
    rest = setTimeout(accumulate, 0, figures.samples);
}

/** Shows a picture, of the first sample or of those so far; returns its figures, or nothing if it came too late. */
async function frame(isStill = false) {
  const address = new URLSearchParams({
    ...(camera && { camera: [...camera.position, ...camera.target].join() }),
    ...(at !== null && { at }),
    ...(isStill && { still: "1" }),
  });
  const response = await fetch(`frame?${address}`);
  if (!response.ok) {
    pause();
    return fail(await response.text());
  }
  const figures = JSON.parse(response.headers.get("X-Frame"));
  const { width, height } = figures;
  const pixels = new Uint8ClampedArray(await response.arrayBuffer());
  if (isStill && isBusy) return;
  if (isStill && figures.samples < SHOWN_SAMPLES) return figures;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  picture.putImageData(new ImageData(pixels, width, height), 0, 0);
  page.version = figures.version;
  times.push(performance.now());
  while (times[0] < performance.now() - 1000) times.shift();
  if (state) fail(state.error);
  showFigures(figures);
  Object.assign(document.body.dataset, { frames: (page.frames += 1), samples: figures.samples });
  return figures;
}

function showFigures({ width, height, milliseconds, rays, samples, final }) {
  const position = (camera ?? state?.camera)?.position.map((value) => value.toFixed(3)).join(", ");
  const rows = [
    ["size", `${width} × ${height}`],
    ["triangles", state?.triangles.toLocaleString("en")],
    ["samples a pixel", `${samples} of ${final}`],
    ["rays of a sample", rays.toLocaleString("en")],
    ["time of a sample", `${milliseconds.toFixed(1)} ms`],
    ["frames in the last second", times.length],
    ["time of packing", state && `${state.milliseconds.toFixed(0)} ms`],
    ["camera", position],
    ...(at === null || !state?.seconds
      ? []
      : [["moment", `${(at * state.seconds).toFixed(2)} of ${state.seconds.toFixed(2)} s`]]),
  ];
  element("figures").tBodies[0].replaceChildren(
    ...rows.map((cells) => {
      const row = document.createElement("tr");
      row.append(...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text ?? "" })));
      return row;
    }),
  );
}

function fail(text) {
  element("error").textContent = text;
  element("error").hidden = text === "";
}

// The scene

const sameCamera = (a, b) => a && JSON.stringify([a.position, a.target]) === JSON.stringify([b.position, b.target]);

function receive(now) {
  // A camera of the file that has changed comes before one that was moved
  if (state && !sameCamera(state.camera, now.camera)) camera = null;
  const isFirst = state === null;
  state = now;
  if (!state.seconds) {
    pause();
    at = null;
  } else if (isFirst && state.plays) play();
  element("play").hidden = !state.seconds;
  element("scene").textContent = document.title = now.scene;
  element("notes").replaceChildren(
    ...now.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })),
  );
  fail(now.error);
  if (!now.error) draw();
}

async function save() {
  const { position, target } = camera ?? state.camera;
  const response = await fetch("camera", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ position, target }),
  });
  if (!response.ok) return fail(await response.text());
  element("status").textContent = `The camera is in ${state.scene}.`;
}

/** Plays the motion from the moment that is shown. */
function play() {
  began = performance.now() - 1000 * (at ?? 0) * state.seconds;
  element("play").textContent = "Pause";
  draw();
}

function pause() {
  began = null;
  element("play").textContent = "Play";
}

function toggle() {
  if (began !== null) pause();
  else if (state?.seconds) play();
}

function back() {
  camera = null;
  draw();
}

element("save").onclick = save;
element("back").onclick = back;
element("play").onclick = toggle;
window.addEventListener("keydown", ({ key, ctrlKey, metaKey }) => {
  if (ctrlKey || metaKey) return;
  if (key === "s") save();
  else if (key === "r") back();
  else if (key === "p") toggle();
});
listen(stage, actions);
document.addEventListener("visibilitychange", () => began !== null && draw());
stage.addEventListener("pointerdown", () => (element("hint").hidden = true));
page.actions = actions;
new EventSource("events").onmessage = ({ data }) => receive(JSON.parse(data));
