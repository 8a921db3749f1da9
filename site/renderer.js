// Workers that share frames: each renders every n-th band of rows.

/** The bytes of a compressed text of the page. */
export async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Bytes, or those of base64. */
export const bytesOf = (text) =>
  typeof text === "string" ? Uint8Array.from(atob(text), (character) => character.charCodeAt(0)) : text;

/** A worker that has something to do and sends nothing for so long is ended, seconds. */
const MOST_SILENCE = 20;
/** What a worker does, for messages. */
const DOING = {
  open: "opening the hardware",
  read: "reading the file",
  pack: "packing the mesh",
  load: "taking the mesh",
  room: "making the maps of the room",
  light: "finding the light of the room",
  frame: "rendering",
  trace: "following the ray",
  rtl: "running the RTL",
};

export class Renderer {
  /** `replaced` counts workers that were ended: those in their place have neither design nor mesh. */
  constructor(source, count) {
    this.url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.waiting = new Map();
    this.next = this.replaced = 0;
    this.workers = Array.from({ length: count }, () => this.start());
    setInterval(() => this.watch(), 1000);
  }

  start() {
    const worker = Object.assign(new Worker(this.url), { silence: 0 });
    worker.onmessage = ({ data }) => this.receive(worker, data);
    worker.onerror = ({ message }) => this.replace(worker, `a worker has stopped: ${message}`);
    return worker;
  }

  /** Counts the seconds in which a worker does not answer: a page that sleeps counts none. */
  watch() {
    for (const worker of new Set([...this.waiting.values()].map((each) => each.worker))) {
      const { call } = [...this.waiting.values()].find((each) => each.worker === worker);
      if (++worker.silence > MOST_SILENCE)
        this.replace(
          worker,
          `a worker has not answered for ${MOST_SILENCE} s while ${DOING[call] ?? "answering"}: ` +
            `it is replaced, and the page goes on with what it had`,
        );
    }
  }

  /** Ends a worker, and what it was asked with an error. */
  replace(worker, reason) {
    worker.terminate();
    const index = this.workers.indexOf(worker);
    if (index >= 0) {
      this.workers[index] = this.start();
      ++this.replaced;
    }
    for (const [id, { worker: asked, reject }] of this.waiting)
      if (asked === worker) {
        this.waiting.delete(id);
        reject(new Error(reason));
      }
  }

  receive(worker, { id, band, answer, error, isBroken }) {
    const asked = this.waiting.get(id);
    if (!asked) return;
    worker.silence = 0;
    if (band) return asked.onBand(band);
    if (isBroken)
      return this.replace(
        worker,
        `the model has stopped while ${DOING[asked.call]} (${error}): the page goes on with what it had`,
      );
    this.waiting.delete(id);
    if (error === undefined) asked.resolve(answer);
    else asked.reject(new Error(error));
  }

  ask(worker, call, parameters, onBand) {
    return new Promise((resolve, reject) => {
      const id = this.next++;
      worker.postMessage({ id, call, ...parameters });
      if (![...this.waiting.values()].some((each) => each.worker === worker)) worker.silence = 0;
      this.waiting.set(id, { worker, call, resolve, reject, onBand });
    });
  }

  askAll(call, parameters) {
    return Promise.all(this.workers.map((worker) => this.ask(worker, call, parameters)));
  }

  open(design) {
    return this.askAll("open", design);
  }

  /** `file`: name, bytes, other dropped files by name, and the number of its animation (worker.js). */
  read(file) {
    return this.ask(this.workers[0], "read", file);
  }

  /** Packs in the first worker, and loads the others. */
  async pack(surface) {
    const [first, ...others] = this.workers;
    const { packed, records, clip, textures, milliseconds } = await this.ask(first, "pack", surface);
    await Promise.all(others.map((worker) => this.ask(worker, "load", { records, clip, textures })));
    return { packed, milliseconds };
  }

  /** Renders a frame; null if another one has begun. Counters are sums, the stack's the largest. */
  async frame(view, onBand) {
    const parts = this.workers.length;
    const answers = await Promise.all(
      this.workers.map((worker, part) => this.ask(worker, "frame", { view, part, parts }, onBand)),
    );
    if (answers.some(({ isStopped }) => isStopped)) return null;
    const counters = {};
    for (const { counters: own } of answers)
      for (const [name, value] of Object.entries(own))
        counters[name] = name === "deepestStack" ? Math.max(counters[name] ?? 0, value) : (counters[name] ?? 0) + value;
    return {
      counters,
      flatPairs: answers[0].flatPairs,
      milliseconds: Math.max(...answers.map(({ milliseconds }) => milliseconds)),
    };
  }

  stop() {
    return this.askAll("stop", {});
  }

  /** Opens a design in a worker of its own, packs a file there, and calls `use` with the worker. */
  async aside(design, file, use) {
    const worker = this.start();
    try {
      await this.ask(worker, "open", design);
      await this.ask(worker, "read", file);
      return await use(worker, await this.ask(worker, "pack", { material: "diffuse", gathers: false, headroom: 1 }));
    } finally {
      worker.terminate();
    }
  }

  /** Encodes a room of a photo and its depth (worker.js). */
  room(request) {
    return this.ask(this.workers[0], "room", request);
  }

  /** The light of a visitor's photo around a point (worker.js). */
  light(request) {
    return this.ask(this.workers[0], "light", request);
  }

  trace(view, x, y) {
    return this.ask(this.workers[0], "trace", { view, x, y });
  }

  writes(view) {
    return this.ask(this.workers[0], "writes", { view });
  }
}
