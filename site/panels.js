// Tables and lists of the page.

import { lineOf } from "./path.js";

/** An element of the page, of whatever kind it has there. @returns {any} */
export const element = (id) => document.getElementById(id);

/** Counters of the register map, in words. */
const NAMES = {
  raysPrimary: "primary rays",
  raysShadow: "shadow rays",
  raysReflection: "reflected rays",
  raysRefraction: "refracted rays",
  raysGather: "gathered rays",
  raysInBox: "rays in the box",
  nodeReads: "nodes read",
  boxTests: "boxes tested",
  triangleTests: "triangles tested",
  hits: "hits",
  deepestStack: "deepest stack",
};
/** Where the cycles of a pixel alone go: counters of `tiny` that count each context's cycles in a state. */
const STATES = {
  contextsRaySetup: "ray set-up",
  waitRecord: "waits for a record",
  waitUnit: "waits for a unit",
  contextsBox: "box tests",
  contextsTriangles: "triangle tests",
  contextsShading: "shading",
};

const grouped = (value) => (typeof value === "number" ? value.toLocaleString("en") : value);

function row(cells) {
  const line = document.createElement("tr");
  for (const cell of cells) line.insertCell().textContent = grouped(cell);
  return line;
}

/** Replaces the rows of a table. */
export function fillTable(id, rows) {
  element(id).tBodies[0].replaceChildren(...rows.map(row));
}

/** The figures of a frame: what the page knows of it, and its counters. */
export function showFigures({ width, height, workers, packed, packTime }, { counters, milliseconds }) {
  const rate = counters.raysInBox / milliseconds;
  const rows = {
    frame: `${width} × ${height}`,
    "time in this tab": `${Math.round(milliseconds)} ms, ${workers} workers`,
    "in-box rays a second": Math.round(1000 * rate).toLocaleString("en"),
    "triangles, records": `${packed.triangles.toLocaleString("en")}, ${packed.recordCount.toLocaleString("en")}`,
    "depth of the tree": packed.treeDepth,
    "packed in": `${Math.round(packTime)} ms`,
    ...Object.fromEntries(Object.entries(counters).map(([name, value]) => [NAMES[name], value.toLocaleString("en")])),
  };
  fillTable("figures", Object.entries(rows));
}

/** The designs to choose from: presets, and the points of studies. */
export function listDesigns({ presets, studies, sliders }) {
  const form = element("controls");
  const group = (label, names) => {
    const options = Object.assign(document.createElement("optgroup"), { label });
    options.append(...names.map((name) => new Option(name)));
    form.elements.design.append(options);
  };
  group("Presets", presets);
  const listed = new Set(presets);
  for (const { title, points } of studies) {
    const names = points.map(({ design }) => design).filter((name) => !listed.has(name));
    group(title, names);
    for (const name of names) listed.add(name);
  }
  for (const [name, points] of Object.entries(sliders)) form.elements[name].max = points.length - 1;
}

/** What the sliders change of a configuration, as their points have it. */
function sliderValues({ precision: { mac, sqrt, div }, geometry, array }) {
  return { precision: `${mac}b${sqrt}s${div}d`, vertexBits: geometry.vertexBits, contexts: array.contexts };
}

/**
 * The sliders, with their values of the hardware if it is one of their points, else of `edge`; folded when other
 * hardware is chosen.
 */
function showSliders({ sliders, manifests }, chosen) {
  const isPoint = Object.values(sliders).some((points) => points.some(({ design }) => design === chosen));
  const values = sliderValues(manifests[isPoint ? chosen : "edge"].config);
  for (const [name, points] of Object.entries(sliders)) {
    element("controls").elements[name].value = points.findIndex(({ value }) => value === values[name]);
    element(`${name}-value`).textContent = values[name];
  }
  const { classList, dataset } = element("studied");
  classList.toggle("isStudied", isPoint);
  if (dataset.design !== chosen) element("studied").open = isPoint;
  dataset.design = chosen;
}

/** The sliders, and error, energy, area and rate of the hardware, from the first study that has it. */
export function showCosts(data, chosen) {
  showSliders(data, chosen);
  const { studies } = data;
  const study = studies.find(({ points }) => points.some(({ design }) => design === chosen));
  element("costs").hidden = !study;
  if (!study) return;
  const { figures } = study.points.find(({ design }) => design === chosen);
  const known = study.columns.filter(({ key }) => figures[key] !== null);
  fillTable(
    "costs",
    known.map(({ key, label, unit, format }) => [
      label,
      `${figures[key].toFixed(Number(/[.](\d)/.exec(format)[1]))} ${unit}`,
    ]),
  );
  element("study").textContent = `${study.title}: ${study.command}`;
}

/** The cycles of frames of one pixel, by what they are of. */
export function showTimes(frames, caption) {
  const states = Object.entries(STATES).filter(([name]) => frames.every(({ counters }) => name in counters));
  const row = (name, label) => [label, ...frames.map(({ counters }) => counters[name])];
  fillTable("times", [
    ["", ...frames.map(({ of }) => of)],
    row("cycles", "cycles of the frame"),
    ...states.map(([name, label]) => row(name, label)),
  ]);
  element("times").caption.textContent = caption;
  element("times").hidden = false;
}

/** The rays of a pixel, and the steps of the chosen one. `choose` is called with the index of a clicked ray. */
export function showRays(rays, chosen, choose) {
  const cellsOf = ({ kind, nodes, boxes, entered, triangles, records, lines, hit, blocker }) => {
    const met = hit ?? (kind === "shadow" && blocker ? blocker.value : null);
    return [
      kind,
      nodes,
      boxes,
      entered,
      triangles,
      records,
      ...(lines === null ? [] : [lines]),
      met === null ? "–" : String(met),
    ];
  };
  fillTable("rays", rays.map(cellsOf));
  [...element("rays").tBodies[0].rows].forEach((line, index) => {
    line.classList.toggle("chosen", chosen === index);
    line.onclick = () => choose(index);
  });
  const steps = rays[chosen ?? 0]?.steps ?? [];
  element("steps").replaceChildren(
    ...steps.map((step) => {
      const item = document.createElement("li");
      item.textContent = lineOf(step);
      if (step.kind === 2 || step.kind === 4) item.className = "indent";
      if (step.kind === 4 && step.isHit) item.classList.add("hit");
      return item;
    }),
  );
}
