// Sentences about a step.

const CHOICE_WORDS = { first: "first", reached: "switched: reached", better: "switched: better", kept: "kept" };

/** The decision of a step and its reason. */
function sentenceAt(trace, step) {
  if (step >= trace.decisions) return `The end: ${trace.head.outcome} after ${lasted(trace)}. No decision follows.`;
  if (trace.explained) return trace.head.sentences[step];
  return `Heads for a subgoal ${whereabouts(trace.pair("subgoal", step))}.`;
}

/** The choice in a word or two. */
function choiceAt(trace, step) {
  if (step >= trace.decisions) return trace.head.outcome;
  if (trace.explained) return CHOICE_WORDS[trace.recorded(step).choice];
  return trace.arrays.switched[step] ? "switched" : "under way";
}

/** The robot's state as pairs of name and value. */
function factsAt(trace, step) {
  const { arrays } = trace;
  const pose = trace.pose(step);
  const facts = [
    ["time", seconds(arrays.time[step])],
    ["position", `${number(pose.x)}, ${number(pose.y)} m`],
    ["target", metres(Math.hypot(...trace.pair("target", step)))],
    ["clearance", clearance(arrays.clearance[step])],
    ["drives", `${number(arrays.twist[2 * step])} m/s, ${number(arrays.twist[2 * step + 1])} rad/s`],
  ];
  if (step >= trace.decisions) return facts;
  const [v, omega] = trace.pair("command", step);
  return [...facts, ["command", `${number(v)} m/s, ${number(omega)} rad/s`]];
}

/** Distance to the nearest obstacle, of the world or, where that is not known, of what the robot sees. */
function clearance(value) {
  if (Number.isNaN(value)) return "not known";
  return value === Infinity ? "nothing in sight" : metres(value);
}

/** The scene as text, for a screen reader. */
function sceneText(trace, step) {
  const facts = factsAt(trace, step).map(([name, value]) => `${name} ${value}`).join("; ");
  const ending = step < trace.decisions ? ` Chosen subgoal ${whereabouts(trace.pair("subgoal", step))}.` : "";
  const weighed = trace.explained && step < trace.decisions ? ` ${trace.candidates(step)} candidates.` : "";
  return `The robot seen from above at step ${step} of ${trace.last}: ${facts}.${ending}${weighed}`;
}

/** A candidate: its index, rank, score or expected time, and position. */
function candidateText(trace, step, index, scores, weights) {
  const rank = 1 + scores.reduce((above, score, i) => above + (score > scores[index] || (score === scores[index]
    && i < index)), 0);
  const place = whereabouts(trace.candidate(step, index));
  const free = trace.arrays["feature.c_o"][trace.starts.candidates[step] + index];
  const reach = free >= 1 ? "" : free > 0 ? ", reachable with less margin" : ", not reachable";
  const worth = worthText(scores[index], timeOf(trace, termsOf(trace, step, weights, index)));
  return `Candidate ${index}: rank ${rank} of ${scores.length}, ${worth}, ${place}${reach}`;
}

/** The score of a subgoal, or its expected time if the score is one. */
function worthText(score, time) {
  return Number.isNaN(time) ? `S ${number(score)}` : `${seconds(time)} to the target`;
}

/** What the parameters would change here and in the whole episode. */
function whatIfText(trace, step, verdict, changed, moved) {
  const count = changed.reduce((total, flag) => total + flag, 0);
  const all = `In the whole episode ${count} of ${trace.decisions} decisions would differ.`;
  if (!moved && !count) return "These are the parameters of the record. Move one to see what it would change.";
  if (step >= trace.decisions) return all;
  if (!changed[step]) return `At this step the choice stays the same. ${all}`;
  const candidate = `candidate ${verdict.best} (${worthText(verdict.bestScore, verdict.bestTime)}), ${
    whereabouts(trace.candidate(step, verdict.best))}`;
  const here = verdict.choice === "kept" ? `would keep the old subgoal (${worthText(verdict.oldScore, verdict.oldTime)})`
    : `would choose ${candidate}`;
  return `At this step it ${here}. ${all}`;
}

/** Duration of the episode by the clock of its task, as in the records. */
function lasted(trace) {
  const { time } = trace.head;
  const late = trace.arrays.time[trace.last] - time;
  return late < 0.05 ? seconds(time)
    : `${seconds(time)} by the clock of its task, which started ${seconds(late)} into the drive`;
}

function seconds(time) {
  return `${time.toFixed(1)} s`;
}
