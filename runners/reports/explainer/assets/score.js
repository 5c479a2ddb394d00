// Scores and choices from features that Python computed. The page implements no criterion.

/**
 * @typedef {{weights: Float64Array, d1: number, d2: number}} Parameters
 * @typedef {{best: number, bestScore: number, oldScore: number, bestTime: number, oldTime: number, choice: string}} Verdict
 */

/** Algorithm 1, lines 9–13. Either distance may be infinite. */
function choose(hasOld, oldDistance, oldScore, newScore, d1, d2) {
  if (!hasOld) return "first";
  if (oldDistance < d1) return "reached";
  return newScore - oldScore > d2 ? "better" : "kept";
}

/** S of every candidate of a step (Eq. 7). */
function scoresOf(trace, step, weights) {
  const [from, to] = trace.span("candidates", step);
  const scores = new Float64Array(to - from);
  trace.features.forEach((row, criterion) => {
    const weight = weights[criterion];
    for (let i = from; i < to; i++) scores[i - from] += weight * row[i];
  });
  return scores;
}

/** The terms w·f of a candidate, in the order of the criteria. */
function termsOf(trace, step, weights, index) {
  const at = trace.starts.candidates[step] + index;
  return trace.features.map((row, criterion) => weights[criterion] * row[at]);
}

/** The terms of the old subgoal at its present position; null at the first step. */
function oldTermsOf(trace, step, weights) {
  if (!trace.hasOld(step)) return null;
  const count = trace.features.length;
  const row = trace.arrays.old_features.subarray(step * count, (step + 1) * count);
  return Array.from(row, (feature, criterion) => weights[criterion] * feature);
}

/** Index of the largest value; the first of equal ones, as in NumPy. */
function argmax(values) {
  let best = 0;
  for (let i = 1; i < values.length; i++) if (values[i] > values[best]) best = i;
  return best;
}

/** @returns {Verdict} what Algorithm 1 chooses in the recorded situation of a step */
function decide(trace, step, parameters) {
  const scores = scoresOf(trace, step, parameters.weights);
  const best = argmax(scores);
  const terms = oldTermsOf(trace, step, parameters.weights);
  const oldScore = terms ? sum(terms) : NaN;
  const distance = trace.arrays.old_distance[step];
  const choice = choose(terms !== null, distance, oldScore, scores[best], parameters.d1, parameters.d2);
  const bestTime = timeOf(trace, termsOf(trace, step, parameters.weights, best));
  return { best, bestScore: scores[best], oldScore, bestTime, oldTime: terms ? timeOf(trace, terms) : NaN, choice };
}

/** Expected time to the target [s], which is minus the score without c_o; NaN if the score is none. */
function timeOf({ head }, terms) {
  return head.timed ? terms[head.names.indexOf("c_o")] - sum(terms) : NaN;
}

/** Whether two verdicts choose the same subgoal, for any reason. */
function sameSubgoal(one, two) {
  const kept = one.choice === "kept";
  return kept === (two.choice === "kept") && (kept || one.best === two.best);
}

/** The sum of the terms, added in the order of the criteria. */
function sum(terms) {
  return terms.reduce((total, term) => total + term, 0);
}

/** Percentile of sorted values for a share of 0 to 1, interpolated linearly, as in NumPy. */
function percentile(sorted, share) {
  const place = share * (sorted.length - 1);
  const below = Math.floor(place);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (place - below) * (sorted[above] - sorted[below]);
}
