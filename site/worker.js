// A worker with a model of its own. The first one packs meshes, and gives their records to the others.

import { prepared } from "./coverage.js";
import { readDepth } from "./depth.js";
import { codesOf, encodeStill } from "./encoder.js";
import { Library, plainSurface } from "./library.js";
import { readMesh } from "./meshes.js";
import { resizedPhoto } from "./photo.js";
import { prepareRoom, roomBox } from "./room.js";
import { renderRtl } from "./rtl.js";
import { Sums, codeOf } from "./sums.js";
import { surfacesOf } from "./surfaces.js";

/** A band has this many rows, or fewer: a worker listens again after so many pixels. */
const [BAND, BAND_PIXELS] = [4, 2560];

/**
 * Answers messages {id, call, …} with {id, …}; of a frame, with its bands, until another frame begins. After isBroken
 * it is of no use.
 */
export function serve(scope) {
  let library;
  let white;
  let raw; // the packed mesh
  let read; // the one that is to be packed
  let files;
  let opened;
  let photos;
  let radiance;
  let lit;
  let current;
  let posed; // the time of the clip that the records show
  let flatPairs = 0;
  let sums;
  let frame = 0;
  // Lets other messages in; timers would wait 4 ms
  const waiting = [];
  const channel = new MessageChannel();
  channel.port1.onmessage = () => waiting.shift()();
  const pause = () => new Promise((resolve) => (waiting.push(resolve), channel.port2.postMessage(null)));

  const calls = {
    /**
     * `views`: view files by name; `maps`, `photo` and `light`: those of a room, the photo as RGBA, the light as
     * radiance or words.
     */
    async open({ module, manifest, views, maps, photo, light }) {
      library ??= await Library.from(module);
      library.open(manifest);
      library.loadMemories(maps);
      files = views;
      opened = null;
      photos = photo
        ? Object.fromEntries(Object.keys(views).map((factor) => [factor, resizedPhoto(photo, Number(factor))]))
        : {};
      white = 2 ** manifest.numbers.colourBits - 1;
      radiance = light instanceof Uint8Array ? library.radianceOf(light) : light;
      lit = null;
      return {};
    },
    /** `animation`: the number of that which moves the mesh, or null; unless given the first. */
    async read({ name, bytes, files, animation }) {
      read = prepared(library, await readMesh(library, name, bytes, files, animation));
      const { vertices, faces, colours, materials, animations, animation: own, notes } = read;
      return {
        name,
        vertices: vertices.length / 3,
        faces: faces.length / 3,
        hasColours: colours !== null,
        hasMaterials: Boolean(materials),
        animations,
        animation: own,
        notes,
      };
    },
    /**
     * `material`: "file", of the mesh's own materials, or one for all of it; `gathers` and `headroom` are those of
     * frames.
     */
    pack({ material, gathers, headroom }) {
      const begin = performance.now();
      const mesh = read ?? raw;
      read = null;
      const { manifest } = library;
      const own = material === "file" ? surfacesOf(library, mesh, { manifest, gathers, headroom }) : null;
      const surfaces = own ?? {
        surfaces: [plainSurface(mesh, material === "glass", 1 / headroom)],
        surfaceOf: new Int32Array(mesh.faces.length / 3),
      };
      const packed = { ...library.pack(mesh, surfaces), entries: own?.entries ?? null, notes: own?.notes ?? [] };
      raw = mesh;
      posed = null;
      return {
        packed,
        records: library.records(packed),
        clip: library.clipFile(),
        textures: library.textureMemories(),
        milliseconds: performance.now() - begin,
      };
    },
    load({ records, clip, textures }) {
      library.load(records, clip);
      library.loadMemories(textures);
      posed = null;
      return {};
    },
    /** Encodes the room of a photo and its depth, for the maps of a design (room.js). */
    async room({ manifest, depth, step, ...photo }) {
      const begin = performance.now();
      const {
        depth: filled,
        normals,
        albedo,
        ...room
      } = prepareRoom(library, { ...photo, depth: await readDepth(depth.name, depth.bytes, step) });
      const prepared = performance.now();
      const encoded = encodeStill(library.wasm, manifest, codesOf({ ...room, albedo, normals, depth: filled }));
      const milliseconds = [prepared - begin, performance.now() - prepared];
      return { ...room, encoded, milliseconds };
    },
    /** The light of a visitor's photo that a point meets, and what the object's cube of this edge sees by it. */
    light({ seen, eye, point, edge }) {
      return { ...library.lightAt(seen, point), parallax: library.parallax(roomBox(seen.points, eye), point, edge) };
    },
    writes({ view }) {
      start(view);
      return { writes: library.frame(view.registers) };
    },
    /** A part of a frame, or of one of its passes: bands are the sums so far. */
    async frame({ view, part, parts }, post) {
      const own = ++frame;
      const begin = performance.now();
      const { camera, sample } = view;
      start(view);
      if (!sample?.index)
        sums = new Sums(camera.width * camera.height, white * view.exposure, view.inPhoto ? photos[view.file] : null);
      ++sums.samples;
      const band = Math.max(1, Math.min(BAND, Math.floor(BAND_PIXELS / camera.width)));
      for (let first = band * part; first < camera.height; first += band * parts) {
        await pause();
        if (own !== frame) return { isStopped: true };
        if (current !== view) start(view);
        const last = Math.min(first + band, camera.height);
        const rows = library.rows(first, last, camera.width);
        sums.add(rows, first * camera.width);
        const pixels = sums.shown(first * camera.width, last * camera.width);
        post({ first, last, pixels, ...(sample ? {} : rows) });
      }
      return { counters: library.counters(), flatPairs, milliseconds: performance.now() - begin };
    },
    stop() {
      ++frame;
      return {};
    },
    /** A frame by the RTL and by the model; `rtl` is the module of the open design. */
    async rtl({ rtl, packed, view }, post) {
      start(view);
      const { width, height } = view.camera;
      const model = { ...library.rows(0, height, width), counters: library.counters() };
      const job = { records: library.records(packed), writes: library.frame(view.registers), width, height };
      const frame = await renderRtl(rtl, library.manifest, job, async ({ cycles, colours }) => {
        post({ cycles, pixels: shown(colours) });
        await pause();
      });
      return { frame, model, framePixels: shown(frame.colours), modelPixels: shown(model.colours) };
    },
    trace({ view, x, y }) {
      start(view);
      return { steps: library.trace(x, y) };
    },
  };

  /** Linear colours as a browser draws them. */
  function shown(colours) {
    const pixels = new Uint8ClampedArray((4 * colours.length) / 3).fill(255);
    for (let i = 0; i < pixels.length / 4; ++i)
      for (let channel = 0; channel < 3; ++channel) pixels[4 * i + channel] = codeOf(colours[3 * i + channel] / white);
    return pixels;
  }

  /** A view: the name of its file, and what replaces the file's poses and registers. */
  function start(view) {
    const { file, camera, object, lights, registers, sample, time } = view;
    // A room's view that has moved its camera does not go back to that of the maps
    const isOther = opened?.file !== file || (camera.isOfMaps && !opened.isOfMaps);
    current = opened = null; // until all is well
    if (isOther) library.openView(files[file]);
    opened = { file, isOfMaps: Boolean(camera.isOfMaps) };
    if (!camera.isOfMaps) library.setCamera(camera);
    if (object) library.setObject(object);
    if (radiance && lit !== String(object.rotation)) {
      library.loadMemories([{ memory: "light.cube", words: library.cubeWords(radiance, object.rotation), bytes: 4 }]);
      lit = String(object.rotation);
    }
    lights.forEach((light, index) => library.setLight(index, light));
    if (posed !== time) flatPairs = library.pose(time);
    posed = time;
    library.setSample(sample ?? { index: 0, count: 1 });
    library.start(library.frame(registers));
    current = view;
  }

  scope.onmessage = async ({ data: { id, call, ...parameters } }) => {
    try {
      const answer = await calls[call](parameters, (band) => scope.postMessage({ id, band }));
      scope.postMessage({ id, answer });
    } catch (error) {
      scope.postMessage({
        id,
        error: String(error.message ?? error),
        isBroken: error instanceof WebAssembly.RuntimeError,
      });
    }
  };
}
