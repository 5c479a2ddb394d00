// One system on the page: its scene, its drive, and what is drawn over it.

const NOSE_M = 0.35; // from the robot's front to the handle that turns it
const GHOSTS = 30; // paths left behind, at most

class LaneView {
  constructor(number, holder, app) {
    this.number = number;
    this.app = app;
    this.frame = document.createElement("div");
    this.frame.className = "lane";
    this.caption = Object.assign(document.createElement("p"), { className: "caption" });
    this.canvas = Object.assign(document.createElement("canvas"), { className: "scene", tabIndex: 0 });
    this.canvas.setAttribute("role", "img");
    this.frame.append(this.canvas, this.caption);
    holder.append(this.frame);
    this.ghosts = [];
    this.pointed = this.picked = null;
    app.tools.listen(this);
    this.resized = new ResizeObserver(() => this.resize());
    this.resized.observe(this.canvas);
  }

  /** Begin another drive. @param {Object} head - see frames.py */
  begin(head, worlds, box) {
    this.leavePath();
    this.trace = new LiveTrace(head, worlds);
    this.pointed = this.picked = null;
    if (this.scene) this.scene.trace = this.trace;
    else this.scene = new Scene(this.canvas, this.trace, box, head.reach);
    this.scene.reach = Math.min(head.reach, 8);
  }

  /** Keep the path of the drive as a ghost. */
  leavePath() {
    const { trace } = this;
    if (!trace || trace.last < 2) return;
    this.ghosts.push({ pose: trace.arrays.pose.slice(), outcome: trace.head.outcome });
    if (this.ghosts.length > GHOSTS) this.ghosts.shift();
  }

  remove() {
    this.resized.disconnect();
    this.frame.remove();
  }

  resize() {
    if (!this.scene) return;
    this.scene.resize();
    this.app.redraw();
  }

  locate([px, py]) {
    return this.scene.camera.locate(px, py);
  }

  /** The step that is shown, which is the last one if the drive has ended before. */
  get step() {
    return Math.max(Math.min(this.app.step, this.trace.last), 0);
  }

  get deciding() {
    return this.trace.explained && this.step < this.trace.decisions;
  }

  get shownPose() {
    return this.trace.last < 0 ? null : this.trace.between(Math.min(this.app.position, this.trace.last));
  }

  get robotRadius() {
    const [long, wide, round] = this.trace.head.box;
    return Math.hypot(long, wide) + round;
  }

  /** Where the handle is that turns the robot. */
  nose({ x, y, yaw }) {
    const reach = this.trace.head.box[0] + this.trace.head.box[2] + NOSE_M;
    return [x + reach * Math.cos(yaw), y + reach * Math.sin(yaw)];
  }

  get shownLegs() {
    return this.trace.last < 0 ? null : this.trace.legs(Math.min(this.app.position, this.trace.last));
  }

  draw() {
    if (this.trace.last < 0) return;
    const { app, trace, scene, step } = this;
    const shown = { step, truth: app.layers.has("truth"), verdict: null, changed: false, picked: null, layers: app.layers,
      pose: this.shownPose, legs: this.shownLegs, below: () => this.#below(), above: () => this.#above() };
    const drawn = `${app.situation.revision} ${step}`;
    if (drawn !== this.drawn) this.pointed = this.picked = null; // other candidates are drawn at every step
    this.drawn = drawn;
    if (this.deciding) {
      const scores = this.scores;
      Object.assign(shown, this.#coloured(step, scores));
      shown.picked = this.pointed ?? this.picked;
      shown.verdict = trace.recorded(step);
    }
    this.scale = shown.scale;
    scene.draw(shown);
    this.caption.textContent = [trace.head.system, trace.head.robot, outcomeText(trace, step)].filter(Boolean).join(" · ");
  }

  get weights() {
    const { names, parameters } = this.trace.head;
    return names.map((name) => Number(parameters[name] === "inf" ? Infinity : parameters[name]));
  }

  get scores() {
    return scoresOf(this.trace, this.step, this.weights);
  }

  #coloured(step, scores) {
    const { features, head } = this.trace;
    const span = this.trace.span("candidates", step);
    const row = head.names.indexOf(this.app.colour);
    const values = row < 0 ? scores : features[row].subarray(...span);
    const free = features[head.names.indexOf("c_o")].subarray(...span);
    const counted = this.app.colour === "free" && free.some(Boolean) ? values.filter((_, i) => free[i]) : values;
    return { values, scale: scaleOf(counted, values) };
  }

  #below() {
    const { app, scene } = this;
    app.details.below(this);
    if (app.layers.has("ghosts")) this.#ghosts();
    const { ctx, camera, colours } = scene;
    for (const { kind, entry } of app.previews) {
      ctx.beginPath();
      outlineInto(ctx, kind, entry, (x, y) => camera.place(x, y), camera.scale);
      paint(ctx, null, colours.other, 2);
    }
    if (app.layers.has("truth")) this.#ways();
  }

  /** The ways of people, who are drawn where they are. */
  #ways() {
    const { ctx, camera, colours } = this.scene;
    for (const { kind, entry } of this.app.world.parts) {
      if (kind !== "movers" || entry.path.length < 2) continue;
      ctx.beginPath();
      for (const [x, y] of entry.path) ctx.lineTo(...camera.place(x, y));
      ctx.setLineDash([2, 5]);
      paint(ctx, null, colours.muted, 1.5);
      ctx.setLineDash([]);
    }
  }

  #ghosts() {
    const { ctx, camera, colours } = this.scene;
    ctx.lineJoin = "round";
    ctx.globalAlpha = 0.45;
    for (const { pose, outcome } of this.ghosts) {
      ctx.beginPath();
      for (let i = 0; i < pose.length; i += 3) ctx.lineTo(...camera.place(pose[i], pose[i + 1]));
      ctx.strokeStyle = outcome === "collision" ? colours.other : colours.muted;
      ctx.lineWidth = 1.5;
      ctx.stroke();
      if (outcome === "collision") cross(ctx, ...camera.place(pose.at(-3), pose.at(-2)), 5, colours.other, 2);
    }
    ctx.globalAlpha = 1;
  }

  #above() {
    const { app, scene } = this;
    const { ctx, camera, colours } = scene;
    app.details.above(this);
    if (app.selected === "robot") this.#dot(this.nose(this.shownPose), true);
    if (app.selected === "goal") {
      circlePath(ctx, ...camera.place(...app.world.goal), 12);
      paint(ctx, null, colours.accent, 2);
    }
    const part = app.selectedPart;
    if (!part) return;
    ctx.beginPath();
    outlineInto(ctx, part.kind, part.entry, (x, y) => camera.place(x, y), camera.scale);
    paint(ctx, null, colours.accent, 2);
    for (const { at, turns } of handlesOf(part.kind, part.entry)) this.#dot(at, turns);
  }

  #dot([x, y], round) {
    const { ctx, camera, colours } = this.scene;
    const [px, py] = camera.place(x, y);
    if (round) circlePath(ctx, px, py, 6);
    else {
      ctx.beginPath();
      ctx.rect(px - 5, py - 5, 10, 10);
    }
    paint(ctx, colours.paper, colours.accent, 2);
  }
}

/** How the drive stands, or how it ended. */
function outcomeText(trace, step) {
  if (trace.ended && step === trace.last) return `${trace.head.outcome} after ${seconds(trace.arrays.time[step])}`;
  return seconds(trace.arrays.time[step]);
}
