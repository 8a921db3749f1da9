// Works one after the other, with a sign of what is being done.

export class Queue {
  sign;
  before;
  done;
  failed;
  waiting;
  last;

  /**
   * `sign`: an element. `before()` comes before each work, `failed(error)` after one that did not go well, and then
   * `done(isWell)`; none of them throws.
   */
  constructor(sign, { before, done, failed }) {
    Object.assign(this, { sign, before, done, failed, waiting: [], last: Promise.resolve() });
  }

  /** Whether works wait or run. */
  get isBusy() {
    return this.waiting.length > 0;
  }

  /** Does a work after those that wait; `what` it is shows at once, or when its turn comes. */
  add(what, work) {
    this.waiting.push(what);
    this.show();
    this.last = this.last.catch(() => {}).then(() => this.run(work));
  }

  /**
   * Does something after the works that wait, unless others have come by then; `failed(error)` is called after an
   * error.
   */
  addIdle(work, failed) {
    this.last = this.last.then(() => (this.isBusy ? null : work())).catch(failed);
  }

  async run(work) {
    let isWell = true;
    try {
      await this.before();
      await work();
    } catch (error) {
      isWell = false;
      await this.failed(error);
    }
    this.waiting.shift();
    this.show();
    this.done(isWell);
  }

  show() {
    this.sign.hidden = !this.isBusy;
    if (this.isBusy) this.sign.textContent = `${this.waiting[0]}…`;
  }
}
