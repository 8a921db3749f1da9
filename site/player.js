// The animation of the mesh: which one, its time, and whether it goes on.

import { element } from "./panels.js";

/** The steps of times of a clip in a second (driver/include/colonnade_mesh.h). */
const TICKS = 2 ** 16;

export class Player {
  changed;
  isPlaying;
  duration;
  seconds;
  started;

  /** `changed()` is called after another time is chosen, or the clip stops or goes on. */
  constructor(changed) {
    Object.assign(this, { changed, isPlaying: false, duration: 0, seconds: 0, started: 0 });
    element("play").onclick = () => this.toggle();
    element("moment").oninput = ({ target }) => this.seek((target.valueAsNumber / target.max) * this.seconds);
  }

  /** Takes the clip of a mesh, of so many 2^-16 s, 0 if nothing moves; it plays. */
  open(duration) {
    this.duration = duration;
    this.seconds = duration / TICKS;
    this.start(0, duration > 0);
  }

  /** The time of the clip, 2^-16 s. */
  get time() {
    if (!this.isPlaying) return this.started;
    return Math.floor((performance.now() - this.started) * (TICKS / 1000)) % this.duration;
  }

  /** From a time, 2^-16 s. While the clip plays `started` is when it was at 0, else its time. */
  start(time, plays) {
    this.isPlaying = plays;
    this.started = plays ? performance.now() - (1000 * time) / TICKS : time;
    this.show();
    this.changed();
  }

  toggle() {
    this.start(this.time, !this.isPlaying && this.duration > 0);
  }

  pause() {
    if (this.isPlaying) this.toggle();
  }

  seek(seconds) {
    this.start(Math.round(seconds * TICKS), false);
  }

  show() {
    for (const id of ["play", "moment"]) element(id).hidden = this.duration === 0;
    element("play").textContent = this.isPlaying ? "Pause" : "Play";
    element("moment").value = this.duration && Math.round((element("moment").max * this.time) / this.duration);
  }
}

/** Lists the animations of a mesh; the chosen one is a number, or null. */
export function listAnimations(names, chosen) {
  element("animations").hidden = names.length === 0;
  const select = element("controls").elements.animation;
  select.replaceChildren(...names.map((name, number) => new Option(name, String(number))), new Option("none", ""));
  select.value = String(chosen ?? "");
}
