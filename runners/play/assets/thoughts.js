// Why the robot goes there: the sentence, the facts and the terms of the system that is looked at.

const REST_SPOKEN_MS = 300;

class Thoughts {
  constructor(app) {
    this.app = app;
    this.legend = new Legend(byId("legend"));
    byId("colour").addEventListener("change", ({ target }) => {
      app.colour = target.value;
      app.redraw();
    });
    byId("better").addEventListener("click", () => this.rank(-1));
    byId("worse").addEventListener("click", () => this.rank(1));
  }

  /** The lane that is looked at. */
  get view() {
    return this.app.views[Math.min(this.app.looked ?? 0, this.app.views.length - 1)];
  }

  /** Other criteria may count from now on. */
  begin() {
    const { head } = this.view.trace;
    document.body.classList.toggle("unexplained", !head.explained);
    document.body.classList.toggle("explained", head.explained);
    this.head = head;
    byId("terms").tBodies[0].replaceChildren();
    if (!head.explained) return;
    byId("colour").replaceChildren(new Option("S", "S"), new Option("S, reachable", "free"),
      ...head.names.map((name) => Object.assign(new Option(name, name), { title: head.about[name] })));
    if (![...byId("colour").options].some(({ value }) => value === this.app.colour)) this.app.colour = "S";
    byId("colour").value = this.app.colour;
    this.meanings = { button: (name) => Object.assign(named("span", name), { title: head.about[name] ?? PARAMETERS[name] ?? "" }) };
    this.bars = new Bars(byId("terms").tBodies[0], head.names, this.meanings);
  }

  /** Move down the ranking of the candidates. */
  rank(places) {
    const { view } = this;
    if (!view?.deciding) return;
    const { scores } = view;
    const order = Array.from(scores.keys()).sort((a, b) => scores[b] - scores[a] || a - b);
    const now = view.picked === null ? -Math.sign(places) : order.indexOf(view.picked);
    view.picked = order[Math.min(Math.max(now + places, 0), order.length - 1)];
    this.app.redraw();
  }

  show() {
    const { view } = this;
    const { trace, step } = view;
    if (trace.last < 0) return;
    if (trace.head !== this.head) this.begin();
    const several = this.app.views.length > 1 ? `${trace.head.system}: ` : "";
    byId("sentence").textContent = several + sentenceAt(trace, step);
    byId("choice").textContent = choiceAt(trace, step);
    byId("choice").className = choiceAt(trace, step).split(":")[0].replace(" ", "-");
    const facts = [...factsAt(trace, step), ["decided in", decidedIn(trace, step)]];
    byId("facts").replaceChildren(...facts.flatMap(([name, value]) => [named("dt", name), named("dd", value)]));
    document.body.classList.toggle("no-decision", !view.deciding);
    if (view.deciding) this.#terms(view, trace, step);
    this.#speak(`Step ${step}, ${choiceAt(trace, step)}. ${sentenceAt(trace, step)}`);
    view.canvas.setAttribute("aria-label", sceneText(trace, step));
  }

  /** Describe a step to a screen reader once it has been shown for a while, never while playing. */
  #speak(text) {
    if (text === this.said) return;
    this.said = text;
    clearTimeout(this.speaking);
    if (!this.app.playing) this.speaking = setTimeout(() => (byId("spoken").textContent = text), REST_SPOKEN_MS);
  }

  #terms(view, trace, step) {
    if (view.scale) this.legend.show(view.scale);
    const { weights, scores } = view;
    const { best, choice } = trace.recorded(step);
    const picked = view.pointed ?? view.picked;
    const index = picked !== null && picked < scores.length ? picked : best;
    const old = oldTermsOf(trace, step, weights);
    const chosen = choice === "kept" ? old : termsOf(trace, step, weights, best);
    this.bars.show({ picked: termsOf(trace, step, weights, index), chosen, old });
    byId("candidate").textContent = (picked === null ? "The best candidate. " : "") + candidateText(trace, step, index, scores, weights);
  }
}

/** The computing time of the decision. */
function decidedIn(trace, step) {
  return step < trace.decisions ? `${(trace.decisionUs[step] / 1000).toFixed(2)} ms` : DASH;
}
