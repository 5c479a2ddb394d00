// Sentences about a step.

const CHOICE_WORDS = { first: "first", reached: "switched: reached", better: "switched: better", kept: "kept" };

/** What was decided, and why. */
function sentenceAt(tale, step) {
  if (step >= tale.decisions) return `The end: ${tale.head.outcome} after ${lasted(tale)}. No decision follows.`;
  if (tale.explained) return tale.head.sentences[step];
  return `Heads for a subgoal ${whereabouts(tale.pair("subgoal", step))}.`;
}

/** The choice in a word or two. */
function choiceAt(tale, step) {
  if (step >= tale.decisions) return tale.head.outcome;
  if (tale.explained) return CHOICE_WORDS[tale.recorded(step).choice];
  return tale.arrays.switched[step] ? "switched" : "under way";
}

/** Where the robot is and how it drives, as pairs of name and value. */
function factsAt(tale, step) {
  const { arrays } = tale;
  const pose = tale.pose(step);
  const facts = [
    ["time", seconds(arrays.time[step])],
    ["position", `${number(pose.x)}, ${number(pose.y)} m`],
    ["target", metres(Math.hypot(...tale.pair("target", step)))],
    ["clearance", metres(arrays.clearance[step])],
    ["drives", `${number(arrays.twist[2 * step])} m/s, ${number(arrays.twist[2 * step + 1])} rad/s`],
  ];
  if (step >= tale.decisions) return facts;
  const [v, omega] = tale.pair("command", step);
  return [...facts, ["command", `${number(v)} m/s, ${number(omega)} rad/s`]];
}

/** The scene for those who do not see it. */
function sceneText(tale, step) {
  const facts = factsAt(tale, step).map(([name, value]) => `${name} ${value}`).join("; ");
  const ending = step < tale.decisions ? ` Chosen subgoal ${whereabouts(tale.pair("subgoal", step))}.` : "";
  const weighed = tale.explained && step < tale.decisions ? ` ${tale.candidates(step)} candidates.` : "";
  return `The robot seen from above at step ${step} of ${tale.last}: ${facts}.${ending}${weighed}`;
}

/** Which candidate it is and how it ranks. */
function candidateText(tale, step, index, scores) {
  const rank = 1 + scores.reduce((above, score, i) => above + (score > scores[index] || (score === scores[index]
    && i < index)), 0);
  const place = whereabouts(tale.candidate(step, index));
  const free = tale.arrays["feature.c_o"][tale.starts.candidates[step] + index];
  const reach = free ? "" : ", not reachable";
  return `Candidate ${index}: rank ${rank} of ${scores.length}, S ${number(scores[index])}, ${place}${reach}`;
}

/** What the parameters would change here and in the whole episode. */
function whatIfText(tale, step, verdict, changed, moved) {
  const count = changed.reduce((total, flag) => total + flag, 0);
  const all = `In the whole episode ${count} of ${tale.decisions} decisions would differ.`;
  if (!moved && !count) return "These are the parameters of the record. Move one to see what it would change.";
  if (step >= tale.decisions) return all;
  if (!changed[step]) return `At this step the choice stays the same. ${all}`;
  const candidate = `candidate ${verdict.best} (S ${number(verdict.bestScore)}), ${
    whereabouts(tale.candidate(step, verdict.best))}`;
  const here = verdict.choice === "kept" ? `would keep the old subgoal (S ${number(verdict.oldScore)})`
    : `would choose ${candidate}`;
  return `At this step it ${here}. ${all}`;
}

/** How long the episode took by the clock of its task, as in the records. */
function lasted(tale) {
  const { time } = tale.head;
  const late = tale.arrays.time[tale.last] - time;
  return late < 0.05 ? seconds(time)
    : `${seconds(time)} by the clock of its task, which started ${seconds(late)} into the drive`;
}

function seconds(time) {
  return `${time.toFixed(1)} s`;
}
