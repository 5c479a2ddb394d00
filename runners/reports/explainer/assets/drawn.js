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

/** Add the positions of all candidates [m] and [mm], and the features that follow from them. */
function addDrawn(head, arrays) {
  const counts = arrays["candidates.count"];
  const starts = startsOf(counts);
  const xs = new Float64Array(starts[counts.length]);
  const ys = new Float64Array(xs.length);
  const { number, reach, first, fov, by_area: byArea, state, inc } = head.drawn;
  const generator = new Pcg64(state, inc);
  const target = arrays["exact.target"];
  for (let step = 0, at = 0; step < counts.length; step++) {
    for (let i = 0; i < number; i++, at++) {
      const range = generator.random();
      const distance = reach * (byArea ? Math.sqrt(range) : range);
      const bearing = first + fov * generator.random();
      xs[at] = distance * Math.cos(bearing);
      ys[at] = distance * Math.sin(bearing);
    }
    for (; at < starts[step + 1]; at++) [xs[at], ys[at]] = target.subarray(2 * step, 2 * step + 2);
  }
  arrays["candidates.x"] = Int32Array.from(xs, (x) => Math.round(1000 * x));
  arrays["candidates.y"] = Int32Array.from(ys, (y) => Math.round(1000 * y));
  for (const [name, kind] of Object.entries(head.computed)) {
    const feature = computedFeature(kind, xs, ys, starts, arrays[`exact.${kind}`]);
    const bits = arrays[`counts.${name}`];
    for (let i = 0; i < feature.length; i++) if (!((bits[i >> 3] >> (i & 7)) & 1)) feature[i] = 0;
    arrays[`feature.${name}`] = feature;
  }
}

/** A feature of every candidate, as if it counted everywhere. points: of a distance, one per step */
function computedFeature(kind, xs, ys, starts, points) {
  const feature = new Float64Array(xs.length).fill(1);
  if (kind === "turn") return feature.map((_, i) => -Math.abs(Math.atan2(ys[i], xs[i])));
  for (let step = 0; points && step < starts.length - 1; step++) {
    const [x, y] = points.subarray(2 * step, 2 * step + 2);
    for (let i = starts[step]; i < starts[step + 1]; i++) {
      const [dx, dy] = [xs[i] - x, ys[i] - y];
      feature[i] = -Math.sqrt(dx * dx + dy * dy);
    }
  }
  return feature;
}

/** Features of multiples of a quantum, but exact at the steps whose choice needs that (see rounded.py). */
function addRounded(head, arrays) {
  const starts = startsOf(arrays["candidates.count"]);
  for (const name of head.names) {
    const feature = Float64Array.from(arrays[`feature.${name}`], (count) => count * head.quantum);
    let at = 0;
    for (const step of arrays["exact.steps"]) {
      const count = starts[step + 1] - starts[step];
      feature.set(arrays[`exact.${name}`].subarray(at, at += count), starts[step]);
    }
    arrays[`feature.${name}`] = feature;
  }
}
