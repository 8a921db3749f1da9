// The RTL of a small design in the page: frames of it beside the model's, and the cycles of a pixel.

import { element, fillTable, showTimes } from "./panels.js";
import { isRecorded, nearestPixel, ofPixel } from "./recording.js";
import { bytesOf, unpack } from "./renderer.js";
import { viewOf } from "./view.js";

/** The frame of the RTL. */
const RTL = { design: "tiny", width: 64, height: 48 };

export class RtlPanel {
  page;
  fail;
  context;

  /** `page` takes what tests read, `fail` shows an error, `context` gives data, renderer, state and scene of now. */
  constructor(page, fail, context) {
    Object.assign(this, { page, fail, context });
  }

  /** Renders a followed pixel alone, and says where its cycles went. */
  async timePixel({ x, y, width, height, orbit }) {
    const button = element("time");
    button.disabled = true;
    try {
      const viewFor = (scene) => ofPixel(viewOf(scene, null, width, height, orbit), { x, y, width, height });
      const { frame, model } = await this.byRtl(viewFor, () => {});
      const { counters } = frame;
      this.page.pixelCounters = counters;
      const isEqual = (await hashOf(frame)) === (await hashOf(model));
      const { data, state } = this.context();
      const recording = data.cycles[state.design];
      const isKnown = recording && isRecorded(state, orbit);
      const frames = [{ of: RTL.design, counters }];
      if (isKnown)
        frames.push({ of: `${state.design}, recorded`, counters: nearestPixel(recording, { x, y, width, height }) });
      const other = isKnown
        ? `; the recording is of the RTL of ${state.design}, ` +
          `for the nearest of ${recording.pixels.length} pixels of this view`
        : "";
      showTimes(
        frames,
        `A frame of this pixel by the RTL of ${RTL.design}; ` +
          `its colour ${isEqual ? "is" : "is not"} the model's${other}`,
      );
    } catch (error) {
      this.fail(error.message);
    } finally {
      button.disabled = false;
    }
  }

  /** Renders by RTL and model: a view of the open mesh, packed for the RTL's design. */
  async byRtl(viewFor, onSlice) {
    const { page } = this;
    const { data, renderer, scene } = this.context();
    const manifest = data.manifests[RTL.design];
    const rtl = await unpack(JSON.parse(element("data").textContent).rtl);
    const opened = {
      module: page.module,
      manifest,
      views: { plain: bytesOf(data.views[RTL.design]) },
      maps: [],
      photo: null,
    };
    return renderer.aside(opened, page.file, (worker, { packed }) =>
      renderer.ask(worker, "rtl", { rtl, packed, view: viewFor({ ...scene, manifest, packed }) }, onSlice),
    );
  }

  /** Renders the state's view, and compares. */
  async render() {
    const status = element("rtl-status");
    const [own, models] = ["rtl-frame", "rtl-model"].map((id) => element(id).getContext("2d"));
    const { width, height } = RTL;
    element("rtl-start").disabled = true;
    element("rtl").classList.add("started");
    try {
      const begin = performance.now();
      const viewFor = (scene) => viewOf(scene, null, width, height, scene.state);
      const answer = await this.byRtl(viewFor, ({ cycles, pixels }) => {
        own.putImageData(new ImageData(pixels, width, height), 0, 0);
        status.textContent =
          `${cycles.toLocaleString("en")} cycles, ` +
          `${Math.round(cycles / (performance.now() - begin))} thousand a second`;
      });
      await this.show(answer, own, models);
    } catch (error) {
      status.textContent = error.message;
    } finally {
      element("rtl-start").disabled = false;
    }
  }

  async show({ frame, model, framePixels, modelPixels }, own, models) {
    const { width, height } = RTL;
    own.putImageData(new ImageData(framePixels, width, height), 0, 0);
    models.putImageData(new ImageData(modelPixels, width, height), 0, 0);
    const hashes = await Promise.all([frame, model].map(hashOf));
    const counters = Object.keys(model.counters).filter((name) => name in frame.counters);
    const different = counters.filter((name) => frame.counters[name] !== model.counters[name]);
    this.page.rtl = { hashes, different, counters: frame.counters };
    const isEqual = hashes[0] === hashes[1] && different.length === 0;
    element("rtl-status").textContent = isEqual
      ? `Equal: ${width * height} pixels with their triangles, ${counters.length} counters. ` +
        `SHA-256 of both: ${hashes[0].slice(0, 16)}…`
      : `Different: ${hashes.map((hash) => hash.slice(0, 16)).join(" and ")}; ` +
        `counters: ${different.join(", ") || "none"}`;
    fillTable(
      "rtl-counters",
      Object.entries(frame.counters).map(([name, value]) => [name, value, model.counters[name] ?? "–"]),
    );
  }
}

async function hashOf({ colours, triangles }) {
  const bytes = await new Blob([colours, triangles]).arrayBuffer();
  return [...new Uint8Array(await crypto.subtle.digest("SHA-256", bytes))]
    .map((byte) => byte.toString(16).padStart(2, "0"))
    .join("");
}
