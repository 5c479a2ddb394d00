// A drive that grows while it is watched, with the interface of `Trace`, so that `Scene` draws both.

const WIDTHS = { pose: 3, twist: 2, target: 2, command: 2, subgoal: 2, old: 2, b: 2, sectors: 2, history: 2, discs: 3,
  edges: 4, people: 4, legs: 6 };

/** A typed array that grows at its end and can be cut. */
class Growing {
  constructor(kind) {
    this.values = new kind(64);
    this.length = 0;
  }

  append(more) {
    if (this.length + more.length > this.values.length) {
      const larger = new this.values.constructor(2 * (this.length + more.length));
      larger.set(this.values.subarray(0, this.length));
      this.values = larger;
    }
    this.values.set(more, this.length);
    this.length += more.length;
  }

  /** All of it, without the room to grow. */
  get used() {
    return this.values.subarray(0, this.length);
  }
}

const WIDER = { Int8Array: Int32Array, Int16Array: Int32Array };

class LiveTrace extends Trace {
  /** @param {Object} head - see runners/play/page_messages.py @param {Worlds} worlds - by step */
  constructor(head, worlds) {
    super({ ...head, outcome: null, time: 0, sentences: [] }, {});
    this.worlds = worlds;
    this.growing = {};
    this.counts = {};
    this.decisionUs = [];
    this.last = -1;
    this.decisions = 0;
  }

  get frames() {
    return this.last + 1;
  }

  get ended() {
    return this.head.outcome !== null;
  }

  /** Add frames. @param {Object} header - of the message @param {Object<string, TypedArray>} arrays */
  append(header, arrays) {
    if (header.from !== this.frames) this.truncate(header.from);
    for (const [name, values] of Object.entries(arrays)) this.#append(name, values);
    this.head.sentences.push(...header.sentences);
    this.decisionUs.push(...header.decision_us);
    this.last = header.from + header.count - 1;
    this.decisions += header.decisions;
    this.head.outcome = header.outcome;
    this.#finish();
  }

  /** Forget the frames from a step on. */
  truncate(step) {
    for (const [owner, counts] of Object.entries(this.counts)) counts.length = Math.min(counts.length, step + 1);
    for (const [name, growing] of Object.entries(this.growing)) {
      const owner = this.#owner(name);
      const entries = owner ? this.counts[owner].values[this.counts[owner].length - 1] : step;
      growing.length = Math.min(growing.length, entries * this.#width(name));
    }
    this.head.sentences.length = Math.min(this.head.sentences.length, step);
    this.decisionUs.length = Math.min(this.decisionUs.length, step);
    this.last = Math.min(this.last, step - 1);
    this.decisions = Math.min(this.decisions, step);
    this.head.outcome = null;
    this.#finish();
  }

  world(step) {
    return this.worlds.at(step).arrays;
  }

  goal(step) {
    return this.worlds.at(step).goal;
  }

  /** The pose between two steps. */
  between(place) {
    const step = Math.min(Math.floor(place), this.last);
    const [one, two] = [this.pose(step), this.pose(Math.min(step + 1, this.last))];
    const part = Math.min(place - step, 1);
    const turn = Math.atan2(Math.sin(two.yaw - one.yaw), Math.cos(two.yaw - one.yaw));
    return { x: one.x + part * (two.x - one.x), y: one.y + part * (two.y - one.y), yaw: one.yaw + part * turn };
  }

  /** Hip, knee and foot of each leg in the robot frame, between two steps: x and y after one another; null without legs. */
  legs(place) {
    const { legs } = this.arrays;
    if (!legs) return null;
    const step = Math.min(Math.floor(place), this.last);
    const [one, two] = [step, Math.min(step + 1, this.last)].map((at) => {
      const [from, to] = this.span("legs", at);
      return legs.subarray(6 * from, 6 * to);
    });
    const part = Math.min(place - step, 1);
    return one.map((value, i) => value + part * (two[i] - value));
  }

  #append(name, values) {
    if (name.endsWith(".count")) {
      const owner = name.slice(0, -6);
      const counts = this.counts[owner] ??= startingAtZero();
      let sum = counts.values[counts.length - 1];
      counts.append(Int32Array.from(values, (count) => (sum += count)));
      return;
    }
    const kind = WIDER[values.constructor.name] ?? values.constructor;
    (this.growing[name] ??= new Growing(kind)).append(values);
  }

  /** Let readers see what there is. */
  #finish() {
    for (const [name, growing] of Object.entries(this.growing)) this.arrays[name] = growing.used;
    for (const [owner, counts] of Object.entries(this.counts)) this.starts[owner] = counts.used;
    this.features = (this.head.names || []).map((name) => this.arrays[`feature.${name}`]);
    this.head.time = this.last >= 0 ? this.arrays.time[this.last] : 0;
  }

  /** The array of counts that an array goes by; none for one with a row per step. */
  #owner(name) {
    const first = name.split(".")[0];
    const owner = first === "feature" ? "candidates" : first;
    return owner in this.counts ? owner : null;
  }

  #width(name) {
    return name === "old_features" ? this.head.names.length : WIDTHS[name] ?? 1;
  }
}

function startingAtZero() {
  const counts = new Growing(Int32Array);
  counts.append([0]);
  return counts;
}

/** The worlds of a session, each from a step on. */
class Worlds {
  constructor() {
    this.all = [];
  }

  /** @param {Object} header - of the message @param {Object<string, TypedArray>} arrays */
  add(header, arrays) {
    const starts = startsOf(arrays["polygons.count"]);
    const drawn = { circles: arrays["world.circles"], segments: arrays["world.segments"], corners: arrays.polygons, starts };
    this.all = this.all.filter(({ step }) => step < header.step);
    this.all.push({ ...header, arrays: drawn });
  }

  /** Forget those that begin at a step or later. */
  truncate(step) {
    this.all = this.all.filter((world) => world.step < step);
  }

  /** The world at a step. */
  at(step) {
    return this.all.findLast((world) => world.step <= step) ?? this.all[0];
  }
}
