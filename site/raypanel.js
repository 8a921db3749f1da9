// The rays of a followed pixel: their table, their steps, and their lines over the picture.

import { cameraOf, roomCamera } from "./camera.js";
import { element, showRays } from "./panels.js";
import { draw, raysOf } from "./path.js";
import { followOf } from "./state.js";
import { poseIn, viewOf } from "./view.js";

export class RayPanel {
  page;
  context;
  rays;
  chosen;

  /** `page` takes what tests read, `context` gives renderer, picture, scene and room of now. */
  constructor(page, context) {
    Object.assign(this, { page, context, rays: null, chosen: null });
    this.overlay = element("overlay").getContext("2d");
  }

  /** Follows the rays of the state's pixel; forgets it where frames cannot have its size. */
  async follow() {
    const { renderer, picture, scene, room } = this.context();
    const { state, manifest, packed } = scene;
    if (!packed || !state.follow) return;
    const { x, y, width, height, orbit } = followOf(state.follow);
    if (!picture.hasSize(width, height)) return this.forget();
    const { steps } = await renderer.trace(viewOf(scene, room, width, height, orbit), x, y);
    const { line } = manifest.memories.columnBvh;
    this.rays = this.page.rays = raysOf(steps, line?.records);
    this.chosen = null;
    element("path").hidden = false;
    element("times").hidden = true;
    element("time").hidden = room !== null;
    element("pixel").textContent = `${x}, ${y}`;
    for (const head of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(".lines")))
      head.hidden = !line;
    this.list();
  }

  list() {
    showRays(this.rays, this.chosen, (index) => {
      this.chosen = this.chosen === index ? null : index;
      this.list();
    });
    this.draw();
  }

  draw() {
    const { picture, scene, room } = this.context();
    const { canvas } = this.overlay;
    const box = picture.box();
    canvas.width = Math.round(box.width * devicePixelRatio);
    canvas.height = Math.round(box.height * devicePixelRatio);
    if (!this.rays) return;
    const camera = room
      ? roomCamera(room, box.width, box.height, scene.state)
      : cameraOf(scene.state, box.width, box.height);
    draw(
      this.overlay,
      camera,
      poseIn(scene, room, scene.state),
      this.rays,
      2 ** scene.manifest.config.geometry.vertexBits - 1,
      this.chosen,
    );
  }

  forget() {
    this.rays = null;
    this.context().scene.state.follow = "";
    element("path").hidden = true;
    this.draw();
  }
}
