// Two pictures of a workload: side by side, under a divider, or as a map of their difference.

/** The pictures of a workload: [value, text] pairs. A value is the picture's key, since names may be anything. */
function picturesOf(workload) {
  const reference = study.workloads.find((each) => each.name === workload)?.reference;
  const found = reference ? [["reference", "reference (Embree)"]] : [];
  for (const point of study.points) {
    if (!point.workloads[workload]?.picture) continue;
    const pair = [`point ${point.name}`, point.name === study.baseline ? `${point.name} (baseline)` : point.name];
    if (point.name === study.baseline) found.splice(reference ? 1 : 0, 0, pair);
    else found.push(pair);
  }
  return found;
}

/** The picture and the caption of a choice. */
function chosenPicture(side) {
  const workload = byId("picture-workload").value;
  const select = byId(`picture-${side}`);
  const label = select.selectedOptions[0].textContent;
  if (select.value === "reference") {
    const reference = study.workloads.find((each) => each.name === workload).reference;
    return { ...study.pictures[reference], label, figures: [] };
  }
  const measured = points.get(select.value.slice("point ".length)).workloads[workload];
  return { ...study.pictures[measured.picture], label, figures: measured.figures };
}

function caption(picture) {
  const figures = picture.figures
    .slice(0, 4)
    .map(([label, text]) => `${label} ${text}`)
    .join(", ");
  return [element("strong", null, picture.label), element("span", null, figures ? ` – ${figures}` : "")];
}

function showImage(id, picture) {
  const image = byId(id);
  image.src = picture.uri;
  image.width = picture.width;
  image.height = picture.height;
  image.alt = `${byId("picture-workload").value}: ${picture.label}`;
}

/** The pixels of a picture, RGBA bytes. */
async function pixelsOf(picture) {
  const image = new Image();
  image.src = picture.uri;
  await image.decode();
  const canvas = element("canvas", { width: picture.width, height: picture.height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, picture.width, picture.height).data;
}

let differenceRun = 0;

/** Draw |left − right| × gain of each channel, and say how many pixels differ. */
async function drawDifference(left, right) {
  const run = ++differenceRun;
  const note = byId("difference-note");
  const canvas = byId("difference");
  const gain = 2 ** Number(byId("gain").value);
  byId("gain-value").value = `${gain}×`;
  if (left.width !== right.width || left.height !== right.height) {
    canvas.width = canvas.height = 0;
    note.textContent = "The pictures have different sizes.";
    return;
  }
  const [a, b] = await Promise.all([pixelsOf(left), pixelsOf(right)]);
  if (run !== differenceRun) return;
  canvas.width = left.width;
  canvas.height = left.height;
  const context = canvas.getContext("2d");
  const map = context.createImageData(left.width, left.height);
  let differing = 0;
  let largest = 0;
  let squares = 0;
  for (let i = 0; i < a.length; i += 4) {
    let most = 0;
    for (let channel = i; channel < i + 3; channel++) {
      const difference = Math.abs(a[channel] - b[channel]);
      map.data[channel] = Math.min(255, difference * gain);
      most = Math.max(most, difference);
      squares += difference * difference;
    }
    map.data[i + 3] = 255;
    differing += most > 0;
    largest = Math.max(largest, most);
  }
  context.putImageData(map, 0, 0);
  const count = a.length / 4;
  const share = ((100 * differing) / count).toFixed(2);
  const rms = Math.sqrt(squares / (3 * count)).toFixed(2);
  const kind = left.lossy || right.lossy ? " Of lossy copies: small differences come from the compression." : "";
  note.textContent =
    `|${left.label} − ${right.label}| × ${gain}, in steps of 8-bit sRGB: ${differing.toLocaleString("en")} of ` +
    `${count.toLocaleString("en")} pixels differ (${share} %), at most by ${largest}, RMS ${rms}.${kind}`;
}

function moveDivider() {
  const share = Number(byId("divider").value);
  byId("slider-left").style.clipPath = `inset(0 ${100 - share}% 0 0)`;
  byId("slider-line").style.left = `${share}%`;
}

function showPictures() {
  const left = chosenPicture("left");
  const right = chosenPicture("right");
  const mode = document.querySelector("input[name=mode]:checked").value;
  for (const view of ["beside", "slider", "difference"]) byId(`view-${view}`).hidden = view !== mode;
  for (const [side, picture] of [
    ["left", left],
    ["right", right],
  ]) {
    showImage(`beside-${side}`, picture);
    showImage(`slider-${side}`, picture);
    byId(`caption-${side}`).replaceChildren(...caption(picture));
  }
  byId("slider-note").textContent = `Left of the divider: ${left.label}. Right: ${right.label}.`;
  moveDivider();
  if (mode === "difference") drawDifference(left, right);
}

function showWorkload() {
  const pairs = picturesOf(byId("picture-workload").value);
  setOptions(byId("picture-left"), pairs, pairs[0][0]);
  setOptions(byId("picture-right"), pairs, pairs[Math.min(pairs.length - 1, 2)][0]);
  showPictures();
}

if (byId("picture-workload")) {
  const workloads = study.workloads.map((each) => each.name).filter((name) => picturesOf(name).length);
  setOptions(
    byId("picture-workload"),
    workloads.map((name) => [name, name]),
  );
  byId("picture-workload").addEventListener("change", showWorkload);
  for (const id of ["picture-left", "picture-right", "picture-mode"]) byId(id).addEventListener("change", showPictures);
  byId("divider").addEventListener("input", moveDivider);
  byId("gain").addEventListener("input", showPictures);
  selectionListeners.push((name) => {
    const value = `point ${name}`;
    const right = byId("picture-right");
    if (Array.from(right.options).some((option) => option.value === value)) {
      right.value = value;
      showPictures();
    }
  });
  showWorkload();
}
