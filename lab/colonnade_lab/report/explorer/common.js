// What all parts of the page share: the data of the study, elements, and which point is selected.

const study = JSON.parse(document.getElementById("study").textContent);
const points = new Map(study.points.map((point) => [point.name, point]));

const byId = (id) => document.getElementById(id);

/** A new element. Children are elements or texts; a text never becomes markup. */
function element(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** A list of labels and texts. */
function definitions(pairs, kind) {
  const list = element("dl", { class: kind || "" });
  for (const [label, text] of pairs) list.append(element("dt", null, label), element("dd", null, text));
  return list;
}

/** Replace the options of a drop-down by [value, text] pairs; keeps the choice if it is among them. */
function setOptions(select, pairs, wanted) {
  const kept = pairs.some(([value]) => value === select.value) ? select.value : wanted;
  select.replaceChildren(...pairs.map(([value, text]) => element("option", { value }, text)));
  if (kept !== undefined && kept !== null) select.value = kept;
}

// A printed page shows all tables and how the figures were made.
let closed = [];
window.addEventListener("beforeprint", () => {
  closed = Array.from(document.querySelectorAll("details:is(.numbers, .provenance):not([open])"));
  for (const details of closed) details.open = true;
});
window.addEventListener("afterprint", () => {
  for (const details of closed) details.open = false;
});

const selectionListeners = [];
let selectedPoint = null;

/** Select a point by its name, in the table, the scatter plot and the panel. */
function selectPoint(name) {
  if (!points.has(name)) return;
  selectedPoint = name;
  for (const listener of selectionListeners) listener(name);
}
