// Candidates and features that need not be in the file (see runners/reports/explainer/drawn.py).

const PCG_MULTIPLIER = [0xf645, 0x9fcc, 0xdf64, 0x4385, 0x5da4, 0x1fc6, 0xed05, 0x2360]; // digits of 16 bits, least first

/** Numbers in [0, 1) as NumPy's PCG64 gives them: a 128-bit congruential generator with the output XSL-RR. */
class Pcg64 {
  constructor(state, increment) {
    this.state = Uint16Array.from(state);
    this.next = new Uint16Array(8);
    this.increment = increment;
  }

  random() {
    // state · multiplier + increment, modulo 2^128
    const { state, next } = this;
    let carry = 0;
    for (let k = 0; k < 8; k++) {
      let digit = carry + this.increment[k];
      for (let i = 0; i <= k; i++) digit += state[i] * PCG_MULTIPLIER[k - i];
      next[k] = digit & 0xffff;
      carry = (digit - next[k]) / 0x10000;
    }
    [this.state, this.next] = [next, state];
    // Both halves combined by "exclusive or", turned right by the six highest bits.
    let low = ((next[0] ^ next[4]) | ((next[1] ^ next[5]) << 16)) >>> 0;
    let high = ((next[2] ^ next[6]) | ((next[3] ^ next[7]) << 16)) >>> 0;
    const turn = next[7] >>> 10;
    if (turn & 32) [low, high] = [high, low];
    const bits = turn & 31;
    if (bits) [low, high] = [(low >>> bits) | (high << (32 - bits)), (high >>> bits) | (low << (32 - bits))];
    return ((high >>> 0) * 0x200000 + (low >>> 11)) / 0x20000000000000;
  }
}

/** Add the positions of all candidates [mm]; the file has those that were not drawn. Returns those drawn [m]. */
function addDrawn(head, arrays) {
  const starts = startsOf(arrays["candidates.count"]);
  const steps = starts.length - 1;
  const others = [arrays["candidates.x"], arrays["candidates.y"]];
  const all = [new Int32Array(starts[steps]), new Int32Array(starts[steps])];
  const { number, reach, first, fov, by_area: byArea, state, inc } = head.drawn;
  const [xs, ys] = [new Float64Array(number * steps), new Float64Array(number * steps)];
  const generator = new Pcg64(state, inc);
  for (let step = 0, at = 0, other = 0; step < steps; step++) {
    let to = starts[step];
    for (let i = 0; i < number; i++, at++, to++) {
      const range = generator.random();
      const distance = reach * (byArea ? Math.sqrt(range) : range);
      const bearing = first + fov * generator.random();
      xs[at] = distance * Math.cos(bearing);
      ys[at] = distance * Math.sin(bearing);
      all[0][to] = Math.round(1000 * xs[at]);
      all[1][to] = Math.round(1000 * ys[at]);
    }
    for (; to < starts[step + 1]; to++, other++) [all[0][to], all[1][to]] = [others[0][other], others[1][other]];
  }
  [arrays["candidates.x"], arrays["candidates.y"]] = all;
  return { xs, ys };
}

/** A feature of the drawn candidates. kind: see drawn.py. points: of a distance, one per step. bits: where it counts */
function computedFeature(kind, { xs, ys }, number, vMax, points, bits) {
  return xs.map((x, i) => {
    if (!((bits[i >> 3] >> (i & 7)) & 1)) return 0;
    if (kind === "shown") return 1;
    if (kind === "turn") return -Math.abs(Math.atan2(ys[i], x));
    const at = 2 * Math.floor(i / number);
    const [dx, dy] = points ? [x - points[at], ys[i] - points[at + 1]] : [x, ys[i]];
    return -Math.sqrt(dx * dx + dy * dy) / (kind === "way" ? vMax : 1);
  });
}

/** Add the features of all candidates: computed ones of those `drawn` if some were, and those that the file has. */
function addFeatures(head, arrays, drawn) {
  const starts = startsOf(arrays["candidates.count"]);
  for (const name of head.names) {
    const quantum = head.quantum ?? 1;
    const written = Float64Array.from(arrays[`feature.${name}`], (value) => value * quantum);
    const kind = drawn && head.computed[name];
    arrays[`feature.${name}`] = kind ? joined(head, arrays, drawn, name, starts, written) : written;
    // Steps whose choice needs it have all digits (see features.py).
    let at = 0;
    for (const step of arrays["exact.steps"] ?? []) {
      const count = starts[step + 1] - starts[step];
      arrays[`feature.${name}`].set(arrays[`exact.${name}`].subarray(at, at += count), starts[step]);
    }
  }
}

/** A feature of the drawn candidates and of the others, step by step. */
function joined(head, arrays, drawn, name, starts, others) {
  const { number } = head.drawn;
  const kind = head.computed[name];
  const values = computedFeature(kind, drawn, number, head.v_max, arrays[`exact.${kind}`], arrays[`counts.${name}`]);
  const all = new Float64Array(starts[starts.length - 1]);
  for (let step = 0, other = 0; step < starts.length - 1; step++) {
    const count = starts[step + 1] - starts[step] - number;
    all.set(values.subarray(number * step, number * (step + 1)), starts[step]);
    all.set(others.subarray(other, other += count), starts[step] + number);
  }
  return all;
}
