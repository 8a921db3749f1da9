// Mouse, touch and keys on the picture: orbit, zoom, pan, and a click that is none of them.

/** `actions`: orbit(degrees, degrees, event), zoom(factor), pan(x, y) in heights of the stage, click(event), done(). */
export function listen(stage, actions) {
  const pointers = new Map();
  let moved = 0;
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
    moved = pointers.size > 1 ? Infinity : 0;
  });
  stage.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const other = [...pointers.values()].find(({ pointerId }) => pointerId !== event.pointerId);
    const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
    moved += Math.hypot(x, y);
    if (moved < 4) return;
    pointers.set(event.pointerId, event);
    const height = stage.clientHeight;
    if (other) {
      const length = ({ clientX, clientY }) => Math.hypot(clientX - other.clientX, clientY - other.clientY);
      actions.zoom(length(before) / Math.max(1, length(event)));
      actions.pan(-x / 2 / height, y / 2 / height);
    } else if (event.shiftKey || event.buttons === 2) actions.pan(-x / height, y / height);
    else actions.orbit(-0.4 * x, 0.4 * y, event);
    actions.done();
  });
  stage.addEventListener("pointerup", (event) => {
    pointers.delete(event.pointerId);
    if (moved < 4) actions.click(event);
  });
  stage.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  const wheel = (event) => {
    event.preventDefault();
    actions.zoom(Math.exp(event.deltaY / 600));
    actions.done();
  };
  stage.addEventListener("wheel", wheel, { passive: false });
  stage.addEventListener("keydown", (event) => {
    const { key } = event;
    const steps = { ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] };
    if (steps[key]) actions.orbit(...steps[key], event);
    else if (key === "+" || key === "-") actions.zoom(key === "+" ? 0.9 : 1 / 0.9);
    else return;
    event.preventDefault();
    actions.done();
  });
}
