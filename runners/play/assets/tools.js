// What the pointer does on a scene: draw, drag, turn, erase, look around.

const NEAR_PX = { mouse: 9, pen: 12, touch: 22 };
const CLICK_PX = 4;
const DRAWS = { wall: "walls", disc: "circles", box: "boxes", person: "movers" };

/** One press of the pointer, until its release. */
class Tools {
  constructor(app) {
    this.app = app;
    this.gestures = 0;
  }

  /** Listen to the pointer on the scene of a lane. */
  listen(view) {
    const { canvas } = view;
    const place = (event) => [event.offsetX, event.offsetY];
    const held = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button > 1) return;
      held.set(event.pointerId, place(event));
      this.app.look(view.number);
      canvas.setPointerCapture(event.pointerId);
      if (held.size > 1) this.drag = null; // two fingers zoom
      else this.drag = this.#begin(view, place(event), event);
    });
    canvas.addEventListener("pointermove", (event) => {
      const [before, now] = [held.get(event.pointerId), place(event)];
      const other = [...held].find(([id]) => id !== event.pointerId);
      if (!before) this.app.point(view, now, NEAR_PX[event.pointerType] ?? NEAR_PX.mouse);
      else if (other) this.#pinch(view, before, now, other[1]);
      else this.drag?.move(view.locate(now), now, before);
      if (before) held.set(event.pointerId, now);
      this.app.redraw();
    });
    const release = (event) => {
      if (!held.delete(event.pointerId)) return;
      this.drag?.end?.(view.locate(place(event)), event.type === "pointerup");
      this.drag = null;
      this.app.redraw();
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => this.app.point(view, null, 0));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      view.scene.camera.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...place(event));
      this.app.redraw();
    }, { passive: false });
  }

  /** The name of a new gesture: changes of one gesture are taken back together. */
  gesture() {
    return `g${++this.gestures}-${Math.floor(performance.timeOrigin)}`;
  }

  #begin(view, pixel, event) {
    const { app } = this;
    if (event.button === 1) return this.#pan(view);
    const at = view.locate(pixel);
    const near = (NEAR_PX[event.pointerType] ?? NEAR_PX.mouse) / view.scene.camera.scale;
    if (app.tool === "erase") return this.#erasing(near, at);
    if (app.tool in DRAWS) return this.#drawing(DRAWS[app.tool], at);
    return this.#handle(near, at) ?? this.#robot(view, near, at) ?? this.#goal(near, at) ?? this.#part(near, at)
      ?? this.#pan(view);
  }

  #drawing(kind, from) {
    const { app } = this;
    const [name, gesture] = [app.newName(), this.gesture()];
    const draw = (to) => app.put(name, kind, drawn(kind, from, to), gesture);
    let moved = false;
    return {
      move: (to) => {
        moved ||= distance(from, to) >= EDGE_M;
        if (moved) draw(to);
      },
      end: (to, whole) => {
        if (whole) draw(to);
        app.select(name);
      },
    };
  }

  #erasing(near, from) {
    const { app } = this;
    const gesture = this.gesture();
    const wipe = (at) => {
      const part = app.partAt(at, near);
      if (part) app.erase(part.name, gesture);
    };
    wipe(from);
    return { move: wipe };
  }

  #handle(near, from) {
    const { app } = this;
    const part = app.selectedPart;
    const handles = part ? handlesOf(part.kind, part.entry) : [];
    const index = handles.findIndex(({ at }) => distance(at, from) <= near * 1.3);
    if (index < 0) return null;
    const gesture = this.gesture();
    return { move: (to) => app.put(part.name, part.kind, handles[index].to(to), gesture) };
  }

  #robot(view, near, from) {
    const { app } = this;
    const pose = view.shownPose;
    if (!pose) return null;
    const nose = view.nose(pose);
    const gesture = this.gesture();
    if (distance(nose, from) <= near) {
      return { move: ([x, y]) => app.placeRobot([pose.x, pose.y, Math.atan2(y - pose.y, x - pose.x)], gesture) };
    }
    if (distance([pose.x, pose.y], from) > Math.max(view.robotRadius, near)) return null;
    const [dx, dy] = [pose.x - from[0], pose.y - from[1]];
    app.select("robot");
    return { move: ([x, y], now, before) => now !== before && app.placeRobot([x + dx, y + dy, pose.yaw], gesture) };
  }

  #goal(near, from) {
    const { app } = this;
    const { goal, goal_tolerance: tolerance } = app.world;
    if (distance(goal, from) > Math.max(near, Math.min(tolerance, 0.5))) return null;
    const gesture = this.gesture();
    app.select("goal");
    return { move: (to) => app.placeGoal(to, gesture) };
  }

  #part(near, from) {
    const { app } = this;
    const part = app.partAt(from, near);
    if (!part) return null;
    app.select(part.name);
    const gesture = this.gesture();
    let moving = false;
    return {
      move: ([x, y]) => {
        const [dx, dy] = [x - from[0], y - from[1]];
        moving ||= Math.hypot(dx, dy) > near / 3;
        if (moving) app.put(part.name, part.kind, movedBy(part.entry, dx, dy), gesture);
      },
    };
  }

  #pan(view) {
    let moved = 0;
    return {
      move: (_, now, before) => {
        moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
        if (moved > CLICK_PX) view.scene.camera.pan(now[0] - before[0], now[1] - before[1]);
      },
      end: (_, whole) => {
        if (whole && moved <= CLICK_PX) this.app.click(view);
      },
    };
  }

  #pinch(view, before, now, still) {
    const [was, is] = [before, now].map(([x, y]) => Math.hypot(x - still[0], y - still[1]));
    if (was > 0) view.scene.camera.zoom(is / was, (now[0] + still[0]) / 2, (now[1] + still[1]) / 2);
  }
}
