// SPDX-License-Identifier: Apache-2.0
// Workers that share frames: each renders every n-th band of rows.

/** The bytes of a compressed text of the page. */
export async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Bytes, or those of base64. */
export const bytesOf = (text) => (typeof text === "string" ? Uint8Array.from(atob(text), (character) => character.charCodeAt(0)) : text);

export class Renderer {
  constructor(source, count) {
    this.url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.waiting = new Map();
    this.next = 0;
    this.workers = Array.from({ length: count }, () => {
      const worker = new Worker(this.url);
      worker.onmessage = ({ data }) => this.receive(data);
      return worker;
    });
  }

  receive({ id, band, answer, error }) {
    const { resolve, reject, onBand } = this.waiting.get(id);
    if (band) return onBand(band);
    this.waiting.delete(id);
    if (error === undefined) resolve(answer);
    else reject(new Error(error));
  }

  ask(worker, call, parameters, onBand) {
    return new Promise((resolve, reject) => {
      const id = this.next++;
      this.waiting.set(id, { resolve, reject, onBand });
      worker.postMessage({ id, call, ...parameters });
    });
  }

  askAll(call, parameters) {
    return Promise.all(this.workers.map((worker) => this.ask(worker, call, parameters)));
  }

  open(design) {
    return this.askAll("open", design);
  }

  read(name, bytes, files) {
    return this.ask(this.workers[0], "read", { name, bytes, files });
  }

  /** Packs in the first worker, and loads the others. */
  async pack(isGlass) {
    const [first, ...others] = this.workers;
    const { packed, records, milliseconds } = await this.ask(first, "pack", { isGlass });
    await Promise.all(others.map((worker) => this.ask(worker, "load", { records })));
    return { packed, milliseconds };
  }

  /** Renders a frame; null if another one has begun. Counters are sums, the stack's the largest. */
  async frame(view, onBand) {
    const parts = this.workers.length;
    const answers = await Promise.all(this.workers.map((worker, part) => this.ask(worker, "frame", { view, part, parts }, onBand)));
    if (answers.some(({ isStopped }) => isStopped)) return null;
    const counters = {};
    for (const { counters: own } of answers)
      for (const [name, value] of Object.entries(own)) counters[name] = name === "deepestStack" ? Math.max(counters[name] ?? 0, value) : (counters[name] ?? 0) + value;
    return { counters, milliseconds: Math.max(...answers.map(({ milliseconds }) => milliseconds)) };
  }

  stop() {
    return this.askAll("stop", {});
  }

  /** Opens a design in a worker of its own, packs a file there, and calls `use` with the worker. */
  async aside(design, file, use) {
    const worker = new Worker(this.url);
    worker.onmessage = ({ data }) => this.receive(data);
    try {
      await this.ask(worker, "open", design);
      await this.ask(worker, "read", file);
      return await use(worker, await this.ask(worker, "pack", { isGlass: false }));
    } finally {
      worker.terminate();
    }
  }

  /** Encodes a room of a photo and its depth (worker.js). */
  room(request) {
    return this.ask(this.workers[0], "room", request);
  }

  trace(view, x, y) {
    return this.ask(this.workers[0], "trace", { view, x, y });
  }

  writes(view) {
    return this.ask(this.workers[0], "writes", { view });
  }
}
