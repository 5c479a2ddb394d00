// Layers that one can switch, and those whose values are asked for when they are on.

const LAYERS = { // name: what it is, and whether it is on at first
  truth: ["true world", true],
  seen: ["seen so far", true],
  scan: ["scan", true],
  sectors: ["sectors of the scan", true],
  candidates: ["candidates", true],
  blockage: ["E1, E2, A, B", true],
  history: ["history", true],
  plan: ["planned path", true],
  people: ["tracked people", true],
  ghosts: ["paths left behind", true],
  memory: ["memory", false],
  times: ["expected times", false],
  arcs: ["arcs weighed", false],
};
const ASKED = ["memory", "times", "arcs"];
const ARC_S = 0.8; // least duration of an arc as drawn
const ARC_POINTS = 8;

class Layers {
  constructor(app, holder) {
    this.app = app;
    this.on = new Set(Object.keys(LAYERS).filter((name) => LAYERS[name][1]));
    for (const [name, [text]] of Object.entries(LAYERS)) holder.append(this.#box(name, text));
  }

  has(name) {
    return this.on.has(name);
  }

  /** Those of the layers that must be asked for. */
  get asked() {
    return ASKED.filter((name) => this.on.has(name));
  }

  #box(name, text) {
    const label = document.createElement("label");
    const input = Object.assign(document.createElement("input"), { type: "checkbox", checked: this.has(name), id: `layer-${name}` });
    label.append(input, ` ${text}`);
    input.addEventListener("change", () => {
      if (input.checked) this.on.add(name);
      else this.on.delete(name);
      this.app.redraw();
    });
    return label;
  }
}

/** What was asked for about decisions, by lane. */
class Details {
  constructor(app) {
    this.app = app;
    this.known = new Map();
  }

  hear(header, arrays) {
    this.known.set(header.lane, { ...header, arrays });
  }

  /** Ask for what is shown and not known. */
  async update() {
    const { app } = this;
    const layers = app.layers.asked;
    if (!layers.length || this.asking) return;
    const wanted = app.views.filter((view) => this.#lacks(view, layers));
    if (!wanted.length) return;
    this.asking = true;
    for (const view of wanted) {
      await app.connection.ask({ type: "detail", lane: view.number, step: view.step, layers });
    }
    this.asking = false;
    app.redraw();
  }

  #lacks(view, layers) {
    const known = this.known.get(view.number);
    return !known || known.revision !== this.app.situation.revision || known.step !== view.step
      || layers.some((layer) => !known.layers.includes(layer));
  }

  /** What is known of the step that a lane shows; of an older one if `near` steps away. */
  #of(view, near = 2) {
    const known = this.known.get(view.number);
    if (!known || known.revision !== this.app.situation.revision) return null;
    return Math.abs(known.step - view.step) <= near ? known : null;
  }

  below(view) {
    const known = this.#of(view);
    if (known?.grid && this.app.layers.has("times")) drawTimes(view.scene, view.trace.pose(known.step), known);
  }

  above(view) {
    const known = this.#of(view);
    if (!known) return;
    const pose = view.trace.pose(known.step);
    if (known.arrays.memory && this.app.layers.has("memory")) drawMemory(view.scene, pose, known.arrays.memory);
    if (known.arrays.arcs && this.app.layers.has("arcs")) drawArcs(view.scene, pose, known);
  }
}

/** A point of a frame at a pose. */
function placed({ x, y, yaw }, px, py) {
  return [x + Math.cos(yaw) * px - Math.sin(yaw) * py, y + Math.sin(yaw) * px + Math.cos(yaw) * py];
}

/** Expected times as colours, dark where the way takes long. */
function drawTimes(scene, pose, known) {
  const { grid: [gx, gy, cell, size], pose: [px, py, pyaw] } = known;
  known.picture ??= pictureOf(known.arrays.times, size);
  const turn = pose.yaw - pyaw;
  const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
  scene.inWorld((ctx) => {
    ctx.transform(cos, sin, -sin, cos, pose.x - cos * px + sin * py, pose.y - sin * px - cos * py);
    ctx.globalAlpha = 0.42;
    ctx.imageSmoothingEnabled = false;
    ctx.drawImage(known.picture, gx, gy, size * cell, size * cell);
  });
}

/** A pixel per cell; its column is the first index of the times, which is along x. */
function pictureOf(times, size) {
  const sorted = times.filter(Number.isFinite).sort();
  const [low, high] = [percentile(sorted, 0.02), percentile(sorted, 0.9)];
  const picture = new OffscreenCanvas(size, size);
  const ctx = picture.getContext("2d");
  for (let column = 0; column < size; column++) {
    for (let row = 0; row < size; row++) {
      const time = times[column * size + row];
      if (!(time <= high * 1.5)) continue; // nor what the search did not reach
      ctx.fillStyle = shade(-time, { low: -high, high: -low });
      ctx.fillRect(column, row, 1, 1);
    }
  }
  return picture;
}

function drawMemory(scene, pose, points) {
  const { ctx, camera, colours } = scene;
  ctx.fillStyle = colours.old;
  for (let i = 0; i < points.length; i += 2) {
    const [x, y] = camera.place(...placed(pose, points[i], points[i + 1]));
    ctx.fillRect(x - 2, y - 2, 4, 4);
  }
}

/** Arcs by their costs; refused ones are thin and dashed, the cheapest is thick. */
function drawArcs(scene, pose, { arrays: { arcs, costs }, horizon }) {
  const { ctx, colours } = scene;
  const finite = Array.from(costs).filter(Number.isFinite);
  const scale = { low: percentile(Float64Array.from(finite).sort(), 0.9), high: Math.min(...finite) };
  const best = costs.indexOf(scale.high);
  const duration = Math.max(horizon, ARC_S);
  const stroke = (i, colour, width, dash = []) => {
    arcPath(scene, pose, arcs[2 * i], arcs[2 * i + 1], duration);
    ctx.setLineDash(dash);
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.stroke();
    ctx.setLineDash([]);
  };
  for (let i = 0; i < costs.length; i++) if (!Number.isFinite(costs[i])) stroke(i, colours.edge, 0.75, [2, 3]);
  for (let i = 0; i < costs.length; i++) if (Number.isFinite(costs[i]) && i !== best) stroke(i, shade(costs[i], scale), 1.25);
  if (best >= 0) stroke(best, colours.paper, 5);
  if (best >= 0) stroke(best, colours.ink, 2.5);
}

/** Path of the arc that a robot drives with v and ω. */
function arcPath(scene, pose, v, omega, duration) {
  scene.ctx.beginPath();
  for (let k = 0; k <= ARC_POINTS; k++) {
    const half = (omega * duration * k) / ARC_POINTS / 2;
    const chord = (v * duration * k) / ARC_POINTS * (Math.abs(half) > 1e-6 ? Math.sin(half) / half : 1);
    scene.ctx.lineTo(...scene.camera.place(...placed(pose, chord * Math.cos(half), chord * Math.sin(half))));
  }
}
