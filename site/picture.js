// The picture: frames of the state, coarse, whole, and the sums of their passes.

import { element, showFigures } from "./panels.js";
import { passesOf, viewOf } from "./view.js";

const COARSE = 4;
/** Frames of an animation become coarser above so many milliseconds, and finer below. */
const [SLOW, FAST] = [150, 35];

/**
 * `now()` gives what is to be shown: the scene (view.js), its room or null, `samples` of passes (viewOf), `isPlaying`:
 * the mesh moves, and `isReady`: design, room and mesh are those of the state. `page` has what tests read. `drawn()` is
 * called after each frame, `fail(error)` for errors.
 */
export class Picture {
  renderer;
  page;
  now;
  drawn;
  fail;

  constructor({ renderer, page, now, drawn, fail }) {
    Object.assign(this, { renderer, page, now, drawn, fail });
    this.stage = element("stage");
    this.context = element("picture").getContext("2d");
    this.canvas = this.context.canvas;
    this.isChanged = this.isRunning = false;
    this.coarseness = COARSE; // of an animation's frames, of pixels
  }

  /** The picture's box on the stage, in its pixels: in a room it has the room's proportions. */
  box() {
    const [width, height] = [this.stage.clientWidth, this.stage.clientHeight];
    const { room } = this.now();
    const scale = room ? Math.min(width / room.width, height / room.height) : 1;
    const size = room ? [room.width * scale, room.height * scale] : [width, height];
    return { left: (width - size[0]) / 2, top: (height - size[1]) / 2, width: size[0], height: size[1] };
  }

  /** The size of a frame, pixels, at so many of the screen's, or of the room's maps, for each. */
  size(pixel) {
    const { room, scene } = this.now();
    if (room) return [room.width / pixel, room.height / pixel];
    const { maxWidth, maxHeight } = scene.manifest.config.frame;
    const { clientWidth, clientHeight } = this.stage;
    const scale = Math.min(1, maxWidth / clientWidth, maxHeight / clientHeight) / pixel;
    return [clientWidth, clientHeight].map((length) => Math.max(8, Math.floor(length * scale)));
  }

  /** Whether frames of the design and the room may have a size. */
  hasSize(width, height) {
    const { room, scene } = this.now();
    if (room) return [1, 2, 4].some((pixel) => room.width === pixel * width && room.height === pixel * height);
    const { maxWidth, maxHeight } = scene.manifest.config.frame;
    return width >= 8 && height >= 8 && width <= maxWidth && height <= maxHeight;
  }

  /**
   * Renders until the picture is that of the state: coarse at once, then whole, band by band, then the sums of passes;
   * of an animation frames that are coarse if whole ones are slow.
   */
  async update() {
    if (!this.now().isReady) return;
    this.isChanged = true;
    if (this.isRunning) return void (this.now().isPlaying || this.renderer.stop());
    this.isRunning = true;
    try {
      while (this.isChanged && this.now().isReady) {
        this.isChanged = false;
        const { room, scene, isPlaying } = this.now();
        const { pixel } = scene.state;
        if (isPlaying) await this.play(room ? COARSE : COARSE * pixel, pixel);
        else if ((await this.render(room ? COARSE : COARSE * pixel, true)) && (await this.render(pixel, false)))
          await this.rest();
      }
    } catch (error) {
      this.fail(error);
    } finally {
      this.isRunning = false;
    }
  }

  /** Renders a frame of an animation, and asks for another one. */
  async play(coarse, pixel) {
    const size = Math.max(pixel, Math.min(coarse, pixel * this.coarseness));
    const begin = performance.now();
    await this.render(size, true);
    this.page.playTime = performance.now() - begin;
    if (this.page.playTime > SLOW && size < coarse) this.coarseness *= 2;
    else if (this.page.playTime < FAST && size > pixel) this.coarseness /= 2;
    document.body.dataset.played = this.page.played = (this.page.played ?? 0) + 1;
    await new Promise(requestAnimationFrame); // none comes while the page is hidden
    this.isChanged = true;
  }

  /** Whether the frame that is next is still wanted. */
  goesOn() {
    return !this.isChanged && this.now().isReady;
  }

  view(width, height, sample) {
    const { scene, room, samples } = this.now();
    return viewOf(scene, room, width, height, scene.state, sample, samples);
  }

  /** Adds up the passes of the picture while nothing changes. */
  async rest() {
    const { scene, room } = this.now();
    const count = passesOf(scene, room);
    const [width, height] = this.size(scene.state.pixel);
    for (let index = 0; index < count; ++index) {
      const view = (this.page.pass = this.view(width, height, { index, count }));
      const frame = await this.renderer.frame(view, ({ first, last, pixels }) => {
        if (!this.isChanged) this.context.putImageData(new ImageData(pixels, width, last - first), 0, first);
      });
      if (frame === null || !this.goesOn()) return;
      this.page.samples = index + 1;
      element("samples").textContent = `pass ${index + 1} of ${count} is added`;
    }
  }

  /** Renders a frame, and shows it; false if no other one may follow. */
  async render(pixel, isCoarse) {
    const { page, renderer, context } = this;
    const box = this.box();
    for (const id of ["picture", "overlay"])
      for (const [name, value] of Object.entries(box)) element(id).style[name] = `${value}px`;
    const [width, height] = this.size(pixel);
    const view = this.view(width, height);
    const target = new OffscreenCanvas(width, height).getContext("2d");
    const whole = {
      width,
      height,
      view,
      colours: new Uint16Array(3 * width * height),
      ratios: new Uint16Array(3 * width * height),
      triangles: new Int32Array(width * height),
    };
    if (!isCoarse) this.resize(width, height);
    const frame = await renderer.frame(view, ({ first, last, pixels, colours, ratios, triangles }) => {
      const rows = new ImageData(pixels, width, last - first);
      if (isCoarse) target.putImageData(rows, 0, first);
      else if (!this.isChanged) context.putImageData(rows, 0, first);
      whole.colours.set(colours, 3 * width * first);
      whole.ratios.set(ratios, 3 * width * first);
      whole.triangles.set(triangles, width * first);
    });
    if (frame === null) return false;
    showFigures(
      { width, height, workers: renderer.workers.length, packed: this.now().scene.packed, packTime: page.packTime },
      frame,
    );
    element("samples").textContent = "one sample a pixel";
    if (isCoarse) {
      this.resize(width, height);
      context.drawImage(target.canvas, 0, 0);
      page.first ??= performance.now();
    } else {
      page.picture = whole;
      this.now().scene.packed.flatPairs = frame.flatPairs;
      page.samples = 0;
      document.body.dataset.frames = page.frames += 1;
    }
    this.drawn();
    return this.goesOn();
  }

  /** Gives the canvas another size; it keeps what it shows. */
  resize(width, height) {
    const { canvas, context } = this;
    if (canvas.width === width && canvas.height === height) return;
    const before = new OffscreenCanvas(canvas.width, canvas.height);
    before.getContext("2d").drawImage(canvas, 0, 0);
    Object.assign(canvas, { width, height });
    context.imageSmoothingEnabled = true;
    context.drawImage(before, 0, 0, width, height);
  }
}
