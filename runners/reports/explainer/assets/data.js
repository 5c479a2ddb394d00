// Unpacks what Python packed (see runners/reports/explainer/packer.py).

const TYPES = { f8: Float64Array, f4: Float32Array, i4: Int32Array, i2: Int16Array, i1: Int8Array, u1: Uint8Array };

/** An episode: the header, arrays by name, and the first entry of each step in them. */
class Trace {
  /**
   * @param {Object} head - header, see encode.py
   * @param {Object<string, TypedArray>} arrays - by name
   */
  constructor(head, arrays) {
    this.head = head;
    this.arrays = arrays;
    this.explained = head.explained;
    this.decisions = head.steps;
    this.last = head.steps; // the end counts as a step without a decision
    this.features = (head.names || []).map((name) => arrays[`feature.${name}`]);
    this.starts = {};
    for (const name of Object.keys(arrays).filter((key) => key.endsWith(".count"))) {
      this.starts[name.slice(0, -6)] = startsOf(arrays[name]);
    }
  }

  /** First entry of a step in the array `name`, and one past its last. */
  span(name, step) {
    const starts = this.starts[name];
    return [starts[step], starts[step + 1]];
  }

  /** The true world at a step: discs, segments and polygons, the corners of all with the first of each. */
  world() {
    const { arrays, starts } = this;
    return { circles: arrays["world.circles"], segments: arrays["world.segments"], corners: arrays.polygons,
      starts: starts.polygons };
  }

  /** The goal at a step. */
  goal() {
    return this.head.goal;
  }

  /** Number of candidates at a step. */
  candidates(step) {
    const [from, to] = this.span("candidates", step);
    return to - from;
  }

  /** Pose of the robot at a step, or at the end. */
  pose(step) {
    const [x, y, yaw] = this.arrays.pose.subarray(3 * step, 3 * step + 3);
    return { x, y, yaw };
  }

  /** A row [x, y] of an array such as `subgoal`; null if it is NaN. */
  pair(name, step) {
    const [x, y] = this.arrays[name].subarray(2 * step, 2 * step + 2);
    return Number.isNaN(x) ? null : [x, y];
  }

  /** A candidate in the robot frame [m]. */
  candidate(step, index) {
    const at = this.starts.candidates[step] + index;
    return [this.arrays["candidates.x"][at] / 1000, this.arrays["candidates.y"][at] / 1000];
  }

  /** Whether there was an old subgoal to keep. */
  hasOld(step) {
    return !Number.isNaN(this.arrays.old_distance[step]);
  }

  /** The recorded decision: index of the best candidate, and the choice in a word. */
  recorded(step) {
    return { best: this.arrays.new[step], choice: this.head.choices[this.arrays.choice[step]] };
  }
}

/** @param {string} text - base64 @returns {Promise<Trace>} */
async function unpack(text) {
  const { head, arrays } = parse(await gunzip(bytesOf(text)));
  addScanPoints(head, arrays);
  if (head.explained) addFeatures(head, arrays, head.drawn ? addDrawn(head, arrays) : null);
  return new Trace(head, arrays);
}

/** Header and arrays of what Python packed. @param {ArrayBuffer} raw */
function parse(raw) {
  const headerLength = new DataView(raw).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(raw, 4, headerLength)));
  const planes = new Uint8Array(raw, 4 + headerLength);
  const arrays = {};
  for (const [name, [kind, at, count, differences]] of Object.entries(head.arrays)) {
    arrays[name] = numbers(planes, kind, at, count);
    if (differences) arrays[name] = runningSum(arrays[name]);
  }
  return { head, arrays };
}

/** Add the scan points in the robot frame [mm], from their beams and ranges. */
function addScanPoints(head, arrays) {
  const starts = startsOf(arrays["scan.count"]);
  const [x, y, yaw] = head.lidar;
  const [xs, ys] = [new Int32Array(starts[starts.length - 1]), new Int32Array(starts[starts.length - 1])];
  for (let step = 0; step < starts.length - 1; step++) {
    const [first, increment] = arrays.beams.subarray(2 * step, 2 * step + 2);
    for (let i = starts[step]; i < starts[step + 1]; i++) {
      const bearing = yaw + first + increment * arrays["scan.beam"][i];
      xs[i] = Math.round(1000 * x + arrays["scan.range"][i] * Math.cos(bearing));
      ys[i] = Math.round(1000 * y + arrays["scan.range"][i] * Math.sin(bearing));
    }
  }
  [arrays["scan.x"], arrays["scan.y"]] = [xs, ys];
}

function bytesOf(text) {
  const letters = atob(text.trim());
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

function gunzip(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** Numbers from their byte planes, least significant byte first. */
function numbers(planes, kind, at, count) {
  const size = TYPES[kind].BYTES_PER_ELEMENT;
  const bytes = new Uint8Array(count * size);
  for (let plane = 0; plane < size; plane++) {
    for (let i = 0, from = at + plane * count; i < count; i++) bytes[i * size + plane] = planes[from + i];
  }
  return new TYPES[kind](bytes.buffer);
}

function runningSum(differences) {
  const sums = new Int32Array(differences.length);
  let sum = 0;
  for (let i = 0; i < sums.length; i++) sums[i] = sum += differences[i];
  return sums;
}

function startsOf(counts) {
  const starts = new Int32Array(counts.length + 1);
  for (let i = 0; i < counts.length; i++) starts[i + 1] = starts[i] + counts[i];
  return starts;
}
