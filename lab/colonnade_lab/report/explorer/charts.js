// The charts, and the panel of the selected point.

const views = {};

const embedOptions = {
  renderer: "svg",
  ast: true, // expressions are interpreted: the page's policy forbids code from texts
  actions: { export: true, source: false, compiled: false, editor: false },
  tooltip: { theme: matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light" },
};

async function draw(name, spec, options) {
  const container = byId(`chart-${name}`);
  if (!container) return null;
  views[name]?.finalize();
  const file = { downloadFileName: `${name}` };
  const drawn = await window.vegaEmbed(container, spec, { ...embedOptions, ...file, ...options });
  views[name] = drawn;
  return drawn.view;
}

/** Leaves each label of the scatter plot that has a place beside its point, by a transform that Vega-Lite lacks. */
function withLabelsApart(vega) {
  const [shapes, labels] = vega.marks;
  const places = ["top", "right", "bottom", "left", "top-right", "top-left", "bottom-right", "bottom-left"];
  labels.transform = [
    {
      type: "label",
      size: { signal: "[width, height]" },
      sort: { field: "datum.rank" },
      anchor: [...places, ...places],
      offset: [...places.map(() => 8), ...places.map(() => 14)], // also beside the large shape of the selected point
      avoidMarks: [shapes.name],
    },
  ];
  return vega;
}

/** The scatter plot of the chosen columns. Axes are no parameters of Vega-Lite, so it is drawn anew. */
async function drawScatter() {
  const spec = structuredClone(study.charts.scatter);
  const keys = { x: byId("scatter-x").value, y: byId("scatter-y").value };
  for (const parameter of spec.params) {
    if (parameter.name in keys) parameter.value = keys[parameter.name];
    if (parameter.name === "selected") parameter.value = selectedPoint;
  }
  for (const layer of spec.layer) {
    for (const [axis, key] of Object.entries(keys)) {
      const { padding } = layer.encoding[axis].scale;
      layer.encoding[axis].title = study.axes[key].title;
      layer.encoding[axis].scale = { ...study.axes[key].scale, padding };
    }
  }
  const isDrawn = (row) => row.numbers[keys.x] !== null && row.numbers[keys.y] !== null;
  const missing = spec.data.values.filter((row) => !isDrawn(row)).length;
  byId("scatter-note").textContent = missing ? `${missing} of ${points.size} points lack one of these figures.` : "";
  const view = await draw("scatter", spec, { patch: withLabelsApart });
  view.addEventListener("click", (_, item) => {
    if (item?.datum?.name) selectPoint(item.datum.name);
  });
}

function drawPanel(name) {
  const point = points.get(name);
  byId("panel-point").value = name;
  const title = element("h3", { id: "panel-name" }, name);
  const tags = [];
  if (point.onFront) tags.push(element("span", { class: "tag front" }, "on the front"), " ");
  if (name === study.baseline) tags.push(element("span", { class: "tag" }, "baseline"));
  const parts = [title, ...tags];
  const pictures = Object.entries(point.workloads).filter(([, figures]) => figures.picture);
  if (pictures.length) {
    const choice = element("select", { id: "panel-workload", "aria-label": "workload" });
    const shown = element("div");
    setOptions(
      choice,
      pictures.map(([workload]) => [workload, workload]),
      panelWorkload,
    );
    const show = () => {
      panelWorkload = choice.value;
      const figures = point.workloads[choice.value];
      const picture = study.pictures[figures.picture];
      const alt = `${choice.value} rendered by ${name}`;
      shown.replaceChildren(
        element("img", { src: picture.uri, width: picture.width, height: picture.height, alt }),
        definitions(figures.figures),
      );
    };
    choice.addEventListener("change", show);
    parts.push(element("h4", null, "Picture"), choice, shown);
    show();
  }
  if (point.failures.length) {
    parts.push(element("h4", { class: "bad" }, "Failures"));
    for (const failure of point.failures) parts.push(element("p", { class: "bad" }, failure));
  }
  parts.push(element("h4", null, "Configuration"), definitions(point.configuration, "long"));
  parts.push(element("h4", null, "Figures"), definitions(point.figures));
  byId("panel-body").replaceChildren(...parts);
}
let panelWorkload = study.workloads[0]?.name;

for (const name of Object.keys(study.charts)) {
  if (name !== "scatter") draw(name, study.charts[name]);
}
for (const select of document.querySelectorAll("select[data-chart]")) {
  select.addEventListener("change", () => {
    views[select.dataset.chart].view.signal(select.dataset.param, select.value).runAsync();
  });
}
byId("panel-point").addEventListener("change", (event) => selectPoint(event.target.value));
selectionListeners.push(drawPanel);
selectionListeners.push((name) => views.scatter?.view.signal("selected", name).runAsync());
if (study.charts.scatter) {
  for (const axis of ["x", "y"]) byId(`scatter-${axis}`).addEventListener("change", drawScatter);
}
if (points.size) selectPoint(study.points.find((point) => point.onFront)?.name ?? study.points[0].name);
if (study.charts.scatter) drawScatter();
