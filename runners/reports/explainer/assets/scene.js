// The drive from above, on a canvas.

/**
 * What is shown at a step.
 * layers: names of those that are drawn, or nothing for all. pose: of the robot, if it is between two steps. legs: hip,
 * knee and foot of each in the robot frame, if it has any. below, above: draw more, under and over the robot's thoughts.
 * @typedef {{step: number, truth: boolean, verdict: ?Verdict, changed: boolean, values: ?ArrayLike<number>,
 *   scale: Object, picked: ?number, layers: ?Set<string>, pose: ?Object, legs: ?ArrayLike<number>, below: ?function(), above: ?function()}} Shown
 */

class Scene {
  /** @param {number[]} box - what to show [x0, y0, x1, y1] @param {number} reach - and with the heading up [m] */
  constructor(canvas, trace, box = extent(trace), reach = reachOf(trace)) {
    this.canvas = canvas;
    this.ctx = canvas.getContext("2d");
    this.trace = trace;
    this.camera = new Camera();
    this.box = box;
    this.reach = reach;
    this.spots = []; // positions of the candidates in the last drawing [px]
    this.recolour();
  }

  /** Read the theme's colours again. */
  recolour() {
    this.colours = themeColours();
  }

  /** Fit the canvas to its place on the page and to the screen's pixels. */
  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(clientWidth * this.ratio);
    this.canvas.height = Math.round(clientHeight * this.ratio);
    Object.assign(this.camera, { width: Math.max(clientWidth, 1), height: Math.max(clientHeight, 1) });
    if (!this.camera.touched) this.fit();
  }

  /** Show all of it. */
  fit() {
    this.camera.fit(this.box, this.reach);
  }

  /** @param {Shown} shown */
  draw(shown) {
    const { ctx, camera, trace } = this;
    this.at = trace.pose(shown.step);
    camera.aim(this.at);
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.fillStyle = this.colours.paper;
    ctx.fillRect(0, 0, camera.width, camera.height);
    this.#world(shown);
    shown.below?.(this);
    this.#path(shown.step);
    this.#aim(shown.step);
    this.spots = [];
    if (trace.explained && shown.step < trace.decisions) this.#decision(shown);
    else if (shows(shown, "scan")) this.#plainScan(shown.step);
    this.#robot(shown.pose ?? this.at);
    if (shown.legs) this.#legs(shown.pose ?? this.at, shown.legs);
    if (shown.step < trace.decisions) {
      if (trace.head.planned && shows(shown, "plan")) this.#plan(shown.step);
      if (trace.head.tracked && shows(shown, "people")) this.#people(shown.step);
      this.#subgoals(shown);
    }
    if (shown.verdict && shows(shown, "blockage")) this.#blockage(shown.step); // on top, for its names
    shown.above?.(this);
    this.#ruler();
  }

  /** Index of the candidate nearest to (x, y) on the canvas within `limit` pixels; null if there is none. */
  candidateAt(x, y, limit) {
    let [found, nearest] = [null, limit * limit];
    this.spots.forEach(([px, py], index) => {
      const away = (px - x) ** 2 + (py - y) ** 2;
      if (away <= nearest) [found, nearest] = [index, away];
    });
    return found;
  }

  /** A point of the robot frame on the canvas [px]. */
  local(x, y) {
    const [cos, sin] = [Math.cos(this.at.yaw), Math.sin(this.at.yaw)];
    return this.camera.place(this.at.x + cos * x - sin * y, this.at.y + sin * x + cos * y);
  }

  /** Draw in world metres. */
  inWorld(draw) {
    const { ctx, ratio, camera } = this;
    ctx.save();
    ctx.transform(...camera.m);
    draw(ctx);
    ctx.restore();
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  #world(shown) {
    this.inWorld((ctx) => {
      const pixel = 1 / this.camera.scale;
      if (shown.truth) drawTruth(ctx, this.trace, shown.step, this.colours.truth, 1.5 * pixel);
      if (shows(shown, "seen")) drawSeen(ctx, this.trace, shown.step, this.colours.seen, 0.5 * pixel);
    });
  }

  #path(step) {
    const { ctx, colours } = this;
    const { pose } = this.trace.arrays;
    ctx.beginPath();
    for (let i = 0; i <= step; i++) ctx.lineTo(...this.camera.place(pose[3 * i], pose[3 * i + 1]));
    ctx.lineJoin = "round";
    ctx.strokeStyle = colours.accent;
    ctx.lineWidth = 2;
    ctx.stroke();
  }

  /** The goal with its tolerance, and the target as the robot knows it. */
  #aim(step) {
    const { ctx, colours, camera, trace } = this;
    const [x, y] = camera.place(...trace.goal(step));
    circlePath(ctx, x, y, trace.head.goal_tolerance * camera.scale);
    ctx.setLineDash([2, 4]);
    paint(ctx, null, colours.goal, 1.5);
    ctx.setLineDash([]);
    circlePath(ctx, x, y, 4);
    paint(ctx, colours.goal, colours.paper, 1);
    const target = trace.pair("target", step);
    line(ctx, this.local(0, 0), this.local(...target), colours.goal, 1.25, [7, 5]);
  }

  /** The planned path of the guide; LME plans none. */
  #plan(step) {
    const { ctx, colours, trace } = this;
    const [from, to] = trace.span("plan", step);
    ctx.beginPath();
    for (let i = from; i < to; i++) {
      ctx.lineTo(...this.local(trace.arrays["plan.x"][i] / 1000, trace.arrays["plan.y"][i] / 1000));
    }
    ctx.setLineDash([4, 3]);
    ctx.strokeStyle = colours.other;
    ctx.lineWidth = 2;
    ctx.stroke();
    ctx.setLineDash([]);
  }

  /** Tracked people: a ring, and a line to where they will be in a second. */
  #people(step) {
    const { ctx, trace } = this;
    const { people } = trace.arrays;
    const [from, to] = trace.span("people", step);
    for (let i = from; i < to; i++) {
      const [x, y, vx, vy] = people.subarray(4 * i, 4 * i + 4);
      line(ctx, this.local(x, y), this.local(x + vx, y + vy), PERSON, 2);
      circlePath(ctx, ...this.local(x, y), 7);
      paint(ctx, null, PERSON, 2);
    }
  }

  #plainScan(step) {
    const [from, to] = this.trace.span("scan", step);
    this.#dots(from, from, to, this.colours.accent, 2);
  }

  /** Scan points `from` to `to` − 1 of the whole episode. */
  #dots(base, from, to, colour, size) {
    const { ctx } = this;
    const { arrays } = this.trace;
    ctx.fillStyle = colour;
    for (let i = from; i < to; i++) {
      const [x, y] = this.local(arrays["scan.x"][i] / 1000, arrays["scan.y"][i] / 1000);
      ctx.fillRect(x - size / 2, y - size / 2, size, size);
    }
  }

  #decision(shown) {
    if (shows(shown, "sectors")) this.#sectors(shown.step);
    else if (shows(shown, "scan")) this.#plainScan(shown.step);
    if (shows(shown, "candidates")) this.#candidates(shown);
    if (shows(shown, "history")) this.#history(shown.step);
  }

  #sectors(step) {
    const { arrays } = this.trace;
    const [from, to] = this.trace.span("scan", step);
    const [first, end] = this.trace.span("sectors", step);
    for (let k = first; k < end; k++) {
      const colour = sectorColour(k - first, end - first);
      const size = k - first === arrays.blocking[step] ? 5 : 3;
      const [begin, last] = [from + arrays.sectors[2 * k], from + arrays.sectors[2 * k + 1]];
      if (begin <= last) this.#dots(from, begin, last + 1, colour, size);
      else {
        this.#dots(from, begin, to, colour, size);
        this.#dots(from, from, last + 1, colour, size);
      }
    }
  }

  /** Discs coloured by the selected value; crosses for candidates that cannot be reached. */
  #candidates({ step, values, scale, picked }) {
    const { ctx, colours } = this;
    const [from] = this.trace.span("candidates", step);
    const free = this.trace.arrays["feature.c_o"];
    const radius = Math.min(Math.max(1.5 + 0.05 * this.camera.scale, 2.5), 4.5);
    for (let i = 0; i < values.length; i++) {
      const [x, y] = this.local(...this.trace.candidate(step, i));
      this.spots.push([x, y]);
      if (free[from + i]) {
        circlePath(ctx, x, y, radius);
        paint(ctx, shade(values[i], scale), colours.edge, 0.75);
      } else {
        cross(ctx, x, y, radius * 0.85, colours.edge, 2.6); // an outline, since the scale is nearly black at one end
        cross(ctx, x, y, radius * 0.85, shade(values[i], scale), 1.5);
      }
    }
    if (picked === null) return;
    circlePath(ctx, ...this.spots[picked], 9);
    paint(ctx, null, colours.paper, 5);
    paint(ctx, null, colours.ink, 2.5);
  }

  #history(step) {
    const { ctx, colours } = this;
    const [from, to] = this.trace.span("history", step);
    for (let i = from; i < to; i++) {
      const [x, y] = this.local(...this.trace.pair("history", i));
      ctx.fillStyle = colours.ink;
      ctx.fillRect(x - 2.5, y - 2.5, 5, 5);
    }
  }

  /** E1, E2, A and B of the blocking sector. */
  #blockage(step) {
    const { arrays } = this.trace;
    if (arrays.blocking[step] < 0) return;
    const at = this.trace.starts.sectors[step] + arrays.blocking[step];
    const scan = this.trace.starts.scan[step];
    const ends = [0, 1].map((i) => scan + arrays.sectors[2 * at + i])
      .map((i) => this.local(arrays["scan.x"][i] / 1000, arrays["scan.y"][i] / 1000));
    const nearer = arrays.a_is_e1[step] ? 0 : 1;
    const b = this.local(...this.trace.pair("b", step));
    line(this.ctx, ends[nearer], b, this.colours.ink, 1.5, [2, 2]);
    const marks = [...ends, b, this.local(0, 0), this.local(...this.trace.pair("subgoal", step))];
    ends.forEach((end, i) => this.#point(end, `E${i + 1}${i === nearer ? " = A" : ""}`, marks));
    this.#point(b, "B", marks);
  }

  /** A named point; its name is on the canvas and on the side farthest from the marks. */
  #point([x, y], name, marks) {
    const { ctx, colours, camera } = this;
    const half = 4 * name.length; // about half the width of the name [px]
    const sides = [[1, -1], [-1, -1], [1, 1], [-1, 1]].map(([dx, dy]) => [x + dx * (half + 8), y + dy * 9]);
    const room = ([cx, cy]) => Math.min(...marks.map(([mx, my]) => Math.hypot((mx - cx) / 2, my - cy)),
      cx - half, camera.width - cx - half, cy, camera.height - cy);
    const [cx, cy] = sides.reduce((best, side) => (room(side) > room(best) ? side : best));
    circlePath(ctx, x, y, 4);
    paint(ctx, colours.paper, colours.ink, 2);
    ctx.textAlign = "center";
    label(ctx, name, cx, cy, colours.ink, colours.paper);
    ctx.textAlign = "left";
    marks.push([cx - half, cy], [cx, cy], [cx + half, cy]); // the next name avoids this one
  }

  #robot(pose) {
    const { ctx, colours, camera } = this;
    const [halfLength, halfWidth, rounding] = this.trace.head.box;
    const [x, y] = camera.place(pose.x, pose.y);
    const [long, wide, round] = [halfLength + rounding, halfWidth + rounding, rounding]
      .map((size) => size * camera.scale);
    ctx.save();
    ctx.translate(x, y);
    ctx.rotate(camera.direction(pose.yaw));
    ctx.beginPath();
    ctx.roundRect(-long, -wide, 2 * long, 2 * wide, round);
    paint(ctx, colours.accent, colours.paper, 1.5);
    const tip = Math.max(long, 7);
    ctx.beginPath();
    for (const [along, across] of [[0.85, 0], [-0.45, 0.5], [-0.2, 0], [-0.45, -0.5]]) {
      ctx.lineTo(tip * along, tip * across);
    }
    ctx.closePath();
    paint(ctx, colours.paper, colours.accent, 1);
    ctx.restore();
  }

  /** Legs from above, with a dot at each foot. */
  #legs(pose, legs) {
    const { ctx, colours, camera } = this;
    const [cos, sin] = [Math.cos(pose.yaw), Math.sin(pose.yaw)];
    const at = (i) => camera.place(pose.x + cos * legs[i] - sin * legs[i + 1], pose.y + sin * legs[i] + cos * legs[i + 1]);
    for (let i = 0; i < legs.length; i += 6) {
      const [hip, knee, foot] = [at(i), at(i + 2), at(i + 4)];
      for (const [colour, width] of [[colours.paper, 5], [colours.ink, 2.5]]) {
        line(ctx, hip, knee, colour, width);
        line(ctx, knee, foot, colour, width);
      }
      circlePath(ctx, ...foot, 3.5);
      paint(ctx, colours.ink, colours.paper, 1);
    }
  }

  /** The chosen subgoal, the old one if it was given up, and the one that the sliders' parameters choose. */
  #subgoals({ step, verdict, changed }) {
    const { ctx, colours, trace } = this;
    const chosen = this.local(...trace.pair("subgoal", step));
    line(ctx, this.local(0, 0), chosen, colours.chosen, 1.5);
    const old = trace.explained ? trace.pair("old", step) : null;
    if (old && trace.recorded(step).choice !== "kept") {
      starPath(ctx, ...this.local(...old), 9);
      paint(ctx, colours.paper, colours.old, 2);
    }
    starPath(ctx, ...chosen, 11);
    paint(ctx, colours.chosen, colours.paper, 1.5);
    if (!changed) return;
    const other = verdict.choice === "kept" ? old : trace.candidate(step, verdict.best);
    diamondPath(ctx, ...this.local(...other), 11);
    paint(ctx, null, colours.paper, 5);
    paint(ctx, null, colours.other, 3);
  }

  /** The scale bar, and the directions of x and y. */
  #ruler() {
    const { ctx, colours, camera } = this;
    const metre = [10, 5, 2, 1, 0.5].find((length) => length * camera.scale <= 130) || 0.2;
    const [x, y] = [16, camera.height - 18];
    line(ctx, [x, y], [x + metre * camera.scale, y], colours.ink, 2);
    label(ctx, `${metre} m`, x, y - 12, colours.ink, colours.paper);
    const [ox, oy] = [camera.width - 46, camera.height - 46];
    for (const [name, yaw] of [["x", 0], ["y", Math.PI / 2]]) {
      const towards = camera.direction(yaw);
      const [dx, dy] = [Math.cos(towards), Math.sin(towards)];
      line(ctx, [ox, oy], [ox + 20 * dx, oy + 20 * dy], colours.muted, 1.5);
      ctx.textAlign = "center";
      label(ctx, name, ox + 29 * dx, oy + 29 * dy, colours.muted, colours.paper);
      ctx.textAlign = "left";
    }
  }
}

/** Whether a layer is drawn. @param {Shown} shown */
function shows(shown, layer) {
  return !shown.layers || shown.layers.has(layer);
}
