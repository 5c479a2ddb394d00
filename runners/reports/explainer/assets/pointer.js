// Mouse and touch on the scene: point at candidates, drag, zoom.

const CLICK_PX = 5; // a press that moves less is a click
const NEAR_PX = { mouse: 12, pen: 14, touch: 26 };

/** Report pointer events on the scene to `app`. */
function listenToPointer(canvas, scene, app) {
  const held = new Map();
  let moved = 0;

  const place = (event) => [event.offsetX, event.offsetY];
  const find = (event) => scene.candidateAt(...place(event), NEAR_PX[event.pointerType] || NEAR_PX.mouse);

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button) return; // a menu opens, and the release event may not come
    held.set(event.pointerId, place(event));
    moved = held.size > 1 ? Infinity : 0;
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) {
      app.point(find(event));
      return;
    }
    const now = place(event);
    const other = [...held].find(([id]) => id !== event.pointerId);
    moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (other) pinch(scene.camera, before, now, other[1]);
    else if (moved > CLICK_PX) scene.camera.pan(now[0] - before[0], now[1] - before[1]);
    held.set(event.pointerId, now);
    app.redraw();
  });
  const release = (event) => {
    if (held.delete(event.pointerId) && event.type === "pointerup" && moved <= CLICK_PX) app.pick(find(event));
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("pointerleave", () => app.point(null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    scene.camera.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...place(event));
    app.redraw();
  }, { passive: false });
}

/** Zoom as one of two fingers moves and the other stays at `still`. */
function pinch(camera, before, now, still) {
  const [was, is] = [before, now].map(([x, y]) => Math.hypot(x - still[0], y - still[1]));
  if (was > 0) camera.zoom(is / was, (now[0] + still[0]) / 2, (now[1] + still[1]) / 2);
}
