// The page: connects all parts.

const byId = (id) => document.getElementById(id);
const REST_SPOKEN_MS = 300; // a screen reader reads a step that is shown this long, never while playing

/** The page: its state, and everything that redraws it. */
class App {
  constructor(trace) {
    this.trace = trace;
    this.colour = "S";
    this.pointed = this.chosenByHand = null;
    this.scene = new Scene(byId("scene"), trace);
    this.timeline = new Timeline(byId("chart"), trace, (step) => this.playback.go(step));
    this.playback = new Playback(trace.last, trace.head.dt, () => this.#moved());
    this.redraw = once(() => this.#draw());
    if (trace.explained) this.#explained();
    this.changed = new Array(trace.decisions).fill(false);
    this.#controls();
    this.judge();
    listenToPointer(byId("scene"), this.scene, this);
    listenToKeys(this);
    new ResizeObserver(once(() => this.#resize())).observe(byId("scene"));
    new ResizeObserver(once(() => this.timeline.resize())).observe(byId("chart"));
    this.#resize();
    this.#speak();
  }

  /** Decide every step again with the parameters of the panel. */
  judge() {
    if (this.trace.explained) {
      const { parameters } = this.panel;
      this.verdicts = this.changed.map((_, step) => decide(this.trace, step, parameters));
      this.changed = this.verdicts.map((verdict, step) => !sameSubgoal(verdict, this.trace.recorded(step)));
      this.timeline.judge(this.verdicts, this.changed);
      byId("reset-all").disabled = !this.panel.moved;
    }
    this.redraw();
  }

  /** The pointer is over this candidate, or over none. */
  point(index) {
    if (index === this.pointed) return;
    this.pointed = index;
    this.redraw();
  }

  /** Keep this candidate in the chart, or none. */
  pick(index) {
    this.chosenByHand = index;
    this.redraw();
  }

  /** Move down the ranking of the candidates by `places`; false if there are no candidates. */
  rank(places) {
    if (!this.#deciding()) return false;
    const scores = this.#scores();
    const order = Array.from(scores.keys()).sort((a, b) => scores[b] - scores[a] || a - b);
    const now = this.chosenByHand === null ? -Math.sign(places) : order.indexOf(this.chosenByHand);
    this.pick(order[Math.min(Math.max(now + places, 0), order.length - 1)]);
    this.#speak(candidateText(this.trace, this.playback.step, this.chosenByHand, scores, this.panel.parameters.weights));
    return true;
  }

  /** Go to the next (1) or previous (−1) step where the robot switched or would decide otherwise. */
  jump(direction) {
    const { switched } = this.trace.arrays;
    let step = this.playback.step + direction;
    while (step > 0 && step < this.trace.decisions && !switched[step] && !this.changed[step]) step += direction;
    this.playback.go(step);
  }

  zoom(factor) {
    this.scene.camera.zoom(factor);
    this.redraw();
  }

  pan(dx, dy) {
    this.scene.camera.pan(dx, dy);
    this.redraw();
  }

  fit() {
    this.scene.fit();
    this.redraw();
  }

  /** Click a control. */
  click(id) {
    byId(id).click();
  }

  /** Whether letter keys are on. */
  get shortcuts() {
    return byId("shortcuts").checked;
  }

  #explained() {
    const { head } = this.trace;
    this.meanings = new Meanings(byId("meaning"), byId("meanings"), head.about);
    this.bars = new Bars(byId("terms").tBodies[0], head.names, this.meanings);
    this.panel = new ParameterPanel(byId("parameters"), head, this.meanings, () => {
      this.judge();
      this.#speak(this.#whatIf());
    });
    this.legend = new Legend(byId("legend"));
    byId("colour").append(new Option("S", "S"), new Option("S, reachable", "free"));
    for (const name of head.names) {
      byId("colour").append(Object.assign(new Option(name, name), { title: head.about[name] }));
    }
    if (head.timed) this.colour = byId("colour").value = "free"; // the scores of the others are a thousand lower
    this.meanings.explain(byId("colour"), "S");
    byId("colour").addEventListener("change", (event) => {
      this.colour = event.target.value;
      this.meanings.explain(byId("colour"), head.names.includes(this.colour) ? this.colour : "S");
      this.redraw();
    });
    byId("reset-all").addEventListener("click", () => {
      this.panel.reset();
      byId(`p-${head.names[0]}`).focus(); // the button is now disabled
    });
    byId("better").addEventListener("click", () => this.rank(-1));
    byId("worse").addEventListener("click", () => this.rank(1));
  }

  #controls() {
    const on = (id, event, action) => byId(id).addEventListener(event, action);
    const { playback } = this;
    on("first", "click", () => playback.go(0));
    on("back", "click", () => playback.go(playback.step - 1));
    on("play", "click", () => playback.toggle());
    on("forward", "click", () => playback.go(playback.step + 1));
    on("end", "click", () => playback.go(playback.last));
    on("before", "click", () => this.jump(-1));
    on("after", "click", () => this.jump(1));
    on("step", "input", (event) => playback.go(Number(event.target.value)));
    on("speed", "change", (event) => Object.assign(playback, { speed: Number(event.target.value) }));
    on("truth", "change", this.redraw);
    on("follow", "change", (event) => {
      this.scene.camera.follow = event.target.checked;
      this.fit();
    });
    on("closer", "click", () => this.zoom(1.25));
    on("wider", "click", () => this.zoom(0.8));
    on("fit", "click", () => this.fit());
    on("help-open", "click", () => byId("help").showModal());
    on("theme", "click", () => switchTheme());
    whenThemeChanges(() => this.#recolour());
    byId("step").max = playback.last;
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) byId("speed").value = "0.25";
    playback.speed = Number(byId("speed").value);
  }

  #recolour() {
    this.scene.recolour();
    this.timeline.recolour();
    this.redraw();
  }

  #resize() {
    this.scene.resize();
    this.redraw();
  }

  #moved() {
    this.pointed = this.chosenByHand = null; // other candidates are drawn at every step
    if (!this.redraw) return;
    this.redraw();
    this.#speak();
  }

  /** Describe the step to a screen reader after a pause. */
  #speak(text) {
    clearTimeout(this.speaking);
    if (this.playback.playing) return;
    this.speaking = setTimeout(() => {
      const { step } = this.playback;
      const summary = `Step ${step}, ${choiceAt(this.trace, step)}. ${sentenceAt(this.trace, step)}`;
      byId("spoken").textContent = text || (this.panel?.moved ? `${summary}. ${this.#whatIf()}` : summary);
      byId("scene").setAttribute("aria-label", sceneText(this.trace, step));
    }, REST_SPOKEN_MS);
  }

  #deciding() {
    return this.trace.explained && this.playback.step < this.trace.decisions;
  }

  #scores() {
    return scoresOf(this.trace, this.playback.step, this.panel.parameters.weights);
  }

  #draw() {
    const { trace, playback, scene } = this;
    const { step } = playback;
    const shown = { step, truth: byId("truth").checked, verdict: null, changed: false, picked: null };
    if (this.#deciding()) {
      const scores = this.#scores();
      Object.assign(shown, this.#coloured(step, scores));
      shown.picked = this.pointed ?? this.chosenByHand;
      shown.verdict = this.verdicts[step];
      shown.changed = this.changed[step];
      this.#terms(step, scores, shown.picked);
      this.legend.show(shown.scale);
    }
    scene.draw(shown);
    this.#texts(step);
    this.timeline.move(step);
  }

  /** The values that colour the candidates, and their scale. */
  #coloured(step, scores) {
    const { features, head } = this.trace;
    const span = this.trace.span("candidates", step);
    const row = head.names.indexOf(this.colour);
    const values = row < 0 ? scores : features[row].subarray(...span);
    const free = features[head.names.indexOf("c_o")].subarray(...span);
    const counted = this.colour === "free" && free.some(Boolean) ? values.filter((_, i) => free[i]) : values;
    return { values, scale: scaleOf(counted, values) };
  }

  /** The chart of terms: of the candidate pointed at (else the best), the chosen subgoal and the old one. */
  #terms(step, scores, picked) {
    const { trace } = this;
    const { weights } = this.panel.parameters;
    const index = picked ?? this.verdicts[step].best;
    const { best, choice } = trace.recorded(step);
    const old = oldTermsOf(trace, step, weights);
    const chosen = choice === "kept" ? old : termsOf(trace, step, weights, best);
    this.bars.show({ picked: termsOf(trace, step, weights, index), chosen, old });
    const which = picked === null ? "The best candidate. " : "";
    byId("candidate").textContent = which + candidateText(trace, step, index, scores, weights);
  }

  #whatIf() {
    const { step } = this.playback;
    return whatIfText(this.trace, step, this.verdicts[step], this.changed, this.panel.moved);
  }

  #texts(step) {
    const { trace, playback } = this;
    if (this.meanings) this.meanings.write(byId("sentence"), sentenceAt(trace, step));
    else byId("sentence").textContent = sentenceAt(trace, step);
    byId("choice").textContent = choiceAt(trace, step);
    byId("choice").className = choiceAt(trace, step).split(":")[0].replace(" ", "-");
    const facts = factsAt(trace, step);
    byId("facts").replaceChildren(...facts.flatMap(([name, value]) => [named("dt", name), named("dd", value)]));
    if (trace.head.play) byId("play-here").querySelector("code").textContent = `lme play ${toPlay(trace)} --step ${step}`;
    byId("step").value = step;
    byId("step").setAttribute("aria-valuetext", `step ${step} of ${playback.last}`);
    byId("count").textContent = `${step} / ${playback.last}`;
    byId("play").setAttribute("aria-label", playback.playing ? "Pause" : "Play");
    byId("play").dataset.playing = playback.playing;
    document.body.classList.toggle("no-decision", !this.#deciding());
    for (const id of ["better", "worse"]) byId(id).setAttribute("aria-disabled", !this.#deciding());
    if (trace.explained) byId("what-if").textContent = this.#whatIf();
  }
}

/** What `lme play` plays: a run of which this is a page, as far as the address tells, or a recording beside it. */
function toPlay({ head: { play } }) {
  const folder = window.location.protocol === "file:" ? decodeURIComponent(window.location.pathname.replace(/[^/]*$/, "")) : "";
  const quoted = (path) => (/^[\w./-]+$/.test(path) ? path : `'${path.replaceAll("'", "'\\''")}'`);
  if (!play.startsWith("RUN ")) return quoted(`${folder}${play}`);
  return folder.endsWith("/explain/") ? play.replace("RUN", () => quoted(folder.slice(0, -"/explain/".length))) : play;
}

/** A function that runs an action once at the next frame, however often it is called before. */
function once(action) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      action();
    });
  };
}

/** Write title and subtitle, and choose the visible parts of the page. */
function dress(trace) {
  const { head } = trace;
  byId("title").textContent = head.title;
  const ablation = head.ablation ? [`ablation ${head.ablation}`] : [];
  const ending = `${head.outcome} after ${seconds(head.time)}`;
  byId("story").textContent = head.story ? `It ${head.story}.` : "";
  byId("subtitle").textContent = [head.system, ...ablation, head.robot, ending].filter(Boolean).join(" · ");
  document.body.classList.add(trace.explained ? "explained" : "unexplained", head.planned ? "planned" : "unplanned");
  byId("truth").disabled = byId("truth").parentElement.hidden = !head.mapped;
  byId("play-here").hidden = !head.play;
  if (head.timed) {
    byId("key-best").textContent = "expected time to the target by way of the best: lower is better";
    byId("key-old").textContent = "by way of the old";
  }
  byId("key-people").hidden = !head.tracked;
  byId("key-blocking").hidden = !trace.arrays.blocking?.some((sector) => sector >= 0);
  byId("key-history").hidden = !trace.arrays["history.count"]?.some(Boolean);
  if (!trace.decisions) byId("without-reasons").textContent = "The episode ended before the first decision.";
}

/** Unpack the trace. Throws an error in a browser that cannot show the page correctly. */
async function readTrace() {
  if (!CSS.supports("color", "light-dark(red, red)")) throw new Error("This browser is too old");
  return unpack(byId("trace").textContent);
}

recallTheme();
readTrace().then((trace) => {
  dress(trace);
  window.explainer = { app: new App(trace), trace, scoresOf, choose, sectorColour };
  document.body.classList.add("ready");
}).catch((error) => {
  byId("title").textContent = "This page cannot be shown";
  byId("subtitle").textContent = `${error.message}. The page needs a browser of May 2024 or later.`;
  throw error;
});
