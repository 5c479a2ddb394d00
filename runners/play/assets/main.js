// The page: connects all parts.

const byId = (id) => document.getElementById(id);
const AHEAD_S = 0.15; // of drawn time that is asked for before it is shown
const LONGEST_S = 0.25; // a page that was hidden continues where it was
const NOTICE_MS = 6000;

class App {
  constructor() {
    Object.assign(this, { position: 0, playing: false, speed: 1, tool: "move", selected: null, colour: "S" });
    this.layers = new Layers(this, byId("layers"));
    this.views = [];
    this.worlds = new Worlds();
    this.previews = [];
    this.changes = []; // that wait to be sent
    this.named = 0; // things so far
    this.details = new Details(this);
    this.tools = new Tools(this);
    this.settings = new Settings(this);
    this.selection = new Selection(this);
    this.results = new Results(byId("results-rows"));
    this.thoughts = new Thoughts(this);
    this.dirty = true;
    this.#controls();
    this.connection = new Connection({
      message: (message, arrays) => this.#hear(message, arrays),
      opened: () => this.notice(""),
      lost: (takenOver) => this.#lost(takenOver),
    });
    requestAnimationFrame((now) => this.#tick(now, now));
  }

  get step() {
    return Math.floor(this.position);
  }

  /** The last step that is known. */
  get last() {
    return Math.max(0, ...this.views.map(({ trace }) => trace.last));
  }

  get ended() {
    return this.views.every(({ trace }) => trace.ended);
  }

  /** The world at the step that is shown. */
  get world() {
    return this.worlds.at(this.step);
  }

  get selectedPart() {
    return this.selected === null ? undefined : this.world?.parts.find(({ name }) => name === this.selected);
  }

  redraw() {
    this.dirty = true;
  }

  /** Say something for a while; nothing for "". */
  notice(text, lasting = false) {
    clearTimeout(this.noticed);
    byId("notice").textContent = text;
    byId("notice").hidden = !text;
    if (text && !lasting) this.noticed = setTimeout(() => this.notice(""), NOTICE_MS);
  }

  // The drive

  go(position) {
    this.position = Math.min(Math.max(position, 0), this.last);
    this.redraw();
  }

  play(playing = !this.playing) {
    this.playing = playing;
    if (playing && this.ended && this.step >= this.last) this.go(0);
    this.redraw();
  }

  /** A step forward, driven if it was not yet. */
  async forward(steps = 1) {
    this.play(false);
    const wanted = this.step + steps;
    while (this.last < wanted && !this.ended) if (!await this.connection.ask({ type: "advance", until: wanted })) return;
    this.go(wanted);
  }

  reset() {
    this.connection.ask({ type: "reset" });
  }

  /** Ask for something at the step that is shown. */
  send(message) {
    return this.connection.ask({ ...message, step: this.step });
  }

  // The world

  /** A name that nothing has, also of what is not answered yet. */
  newName() {
    do this.named += 1; while (this.world.parts.some(({ name }) => name === `d${this.named}`));
    return `d${this.named}`;
  }

  partAt(place, near) {
    const found = this.world.parts.map((part) => [away(part.kind, part.entry, place), part]).filter(([far]) => far <= near);
    return found.length ? found.reduce((one, other) => (other[0] <= one[0] ? other : one))[1] : null;
  }

  select(name) {
    this.selected = name;
    this.redraw();
  }

  put(name, kind, entry, gesture) {
    this.previews = [{ name, kind, entry }];
    this.#change({ type: "put", name, kind, entry, gesture });
  }

  erase(name, gesture) {
    if (this.selected === name) this.select(null);
    this.#change({ type: "erase", name, gesture });
  }

  placeRobot(start, gesture) {
    this.#change({ type: "start", start, gesture });
  }

  placeGoal(goal, gesture) {
    this.#change({ type: "goal", goal, gesture });
  }

  point(view, pixel, near) {
    view.pointed = pixel && this.tool === "move" ? view.scene.candidateAt(...pixel, near) : null;
    this.redraw();
  }

  click(view) {
    this.select(null);
    view.picked = view.pointed;
  }

  /** Show the thoughts of a lane. */
  look(number) {
    this.looked = number % this.views.length;
    for (const view of this.views) view.frame.classList.toggle("looked", this.views.length > 1 && view.number === this.looked);
    this.redraw();
  }

  pan(dx, dy) {
    for (const { scene } of this.views) scene.camera.pan(dx, dy);
    this.redraw();
  }

  zoom(factor) {
    for (const { scene } of this.views) scene.camera.zoom(factor);
    this.redraw();
  }

  fit() {
    for (const { scene } of this.views) {
      scene.box = this.#box();
      scene.fit();
    }
    this.redraw();
  }

  /** Send changes one after the other; of a gesture that goes on, only the newest one waits. */
  async #change(message) {
    this.redraw();
    const change = { ...message, step: this.step };
    const last = this.changes.at(-1);
    if (last && ["type", "name", "gesture"].every((key) => last[key] === change[key])) this.changes.pop();
    this.changes.push(change);
    if (this.sending) return;
    this.sending = true;
    while (this.changes.length) await this.connection.ask(this.changes.shift());
    this.sending = false;
    this.previews = [];
    this.redraw();
  }

  // What comes from the session

  #hear(message, arrays) {
    this.redraw();
    const heard = {
      situation: () => this.#situation(message),
      world: () => this.#world(message, arrays),
      frames: () => this.#frames(message, arrays),
      detail: () => this.details.hear(message, arrays),
      options: () => this.settings.offer(message),
      saved: () => this.#saved(message),
      settled: () => (this.settling = false),
      error: () => this.notice(message.text),
    };
    heard[message.type]?.();
  }

  #situation(message) {
    this.situation = message;
    this.settling = true; // nothing is drawn until all of it is here
    this.cut = message.kept; // the worlds since then are replaced when the new ones come
    if (message.kept === 0) this.begin = message.lanes;
    else for (const { trace } of this.views) trace.truncate(message.kept);
    if (message.step !== this.step) this.position = message.step;
    this.settings.show(message);
    byId("undo").disabled = !message.undoable;
    byId("redo").disabled = !message.redoable;
  }

  #saved({ path, command }) {
    byId("saved").replaceChildren(named("code", path), document.createElement("br"), named("code", command));
  }

  #frames(message, arrays) {
    const { trace } = this.views[message.lane];
    trace.append(message, arrays);
    if (message.outcome) this.results.add(trace);
  }

  #world(message, arrays) {
    if (this.cut !== null) this.worlds.truncate(this.cut);
    this.cut = null;
    this.worlds.add(message, arrays);
    if (!this.begin) return;
    const heads = this.begin;
    this.begin = null;
    while (this.views.length > heads.length) this.views.pop().remove();
    while (this.views.length < heads.length) this.views.push(new LaneView(this.views.length, byId("lanes"), this));
    const place = `${this.situation.map} ${this.situation.world}`;
    heads.forEach((head, i) => this.views[i].begin(head, this.worlds, this.#box()));
    if (place !== this.place) this.views.forEach((view) => {
      view.ghosts = [];
      view.scene.box = this.#box();
      view.scene.resize();
    });
    this.place = place;
    this.look(Math.min(this.looked ?? 0, this.views.length - 1));
    this.thoughts.begin();
    byId("subtitle").textContent = `${this.situation.map}, world ${this.situation.world}, run ${this.situation.run}`;
    document.body.classList.add("ready");
  }

  /** What to show: the world, the start and the goal. */
  #box() {
    const { arrays, start, goal } = this.worlds.all[0];
    const corners = [start, goal];
    for (let i = 0; i < arrays.circles.length; i += 3) corners.push([arrays.circles[i], arrays.circles[i + 1]]);
    for (let i = 0; i < arrays.segments.length; i += 2) corners.push([arrays.segments[i], arrays.segments[i + 1]]);
    for (let i = 0; i < arrays.corners.length; i += 2) corners.push([arrays.corners[i], arrays.corners[i + 1]]);
    return bounds(corners, 0.5);
  }

  #lost(takenOver) {
    this.play(false);
    this.notice(takenOver ? "The session is now in another page. Reload this one to take it back."
      : "The connection is lost: is lme play still running?", true);
  }

  // Time

  #tick(now, before) {
    requestAnimationFrame((next) => this.#tick(next, now)); // first, so that one mistake does not end it all
    const elapsed = Math.min((now - before) / 1000, LONGEST_S);
    if (this.views.length && !this.settling) {
      if (this.playing) this.#drive(elapsed);
      if (this.dirty) this.#draw();
    }
  }

  #drive(elapsed) {
    const { dt } = this.views[0].trace.head;
    const per = this.speed / dt;
    const wanted = Math.ceil(this.position + Math.max(per * AHEAD_S, 1));
    if (this.last < wanted && !this.ended && !this.asking) {
      this.asking = true;
      this.connection.ask({ type: "advance", until: wanted }).then(() => (this.asking = false));
    }
    this.go(this.position + elapsed * per);
    if (this.ended && this.position >= this.last) this.play(false);
  }

  #draw() {
    this.dirty = false;
    for (const view of this.views) view.draw();
    this.#texts();
    this.thoughts.show();
    this.selection.show();
    this.details.update();
    this.drawn = (this.drawn ?? 0) + 1; // for who measures how smooth it is
    this.drawnAt = performance.now();
  }

  #texts() {
    byId("step").max = this.last;
    byId("step").value = this.step;
    byId("step").setAttribute("aria-valuetext", `step ${this.step} of ${this.last}`);
    byId("count").textContent = `${this.step} / ${this.last}`;
    byId("play").setAttribute("aria-label", this.playing ? "Pause" : "Play");
    byId("play").dataset.playing = this.playing;
  }

  #controls() {
    const on = (id, event, action) => byId(id).addEventListener(event, action);
    on("play", "click", () => this.play());
    on("help-open", "click", () => byId("help").showModal());
    on("save", "submit", (event) => {
      event.preventDefault();
      byId("saved").textContent = "Saving …";
      this.send({ type: "save", kind: byId("save-kind").value, name: byId("save-name").value }).then(() => {
        if (byId("saved").textContent === "Saving …") byId("saved").textContent = "";
      });
    });
    listenToKeys(this);
    on("results-clear", "click", () => this.forgetDrives());
    on("back", "click", () => (this.play(false), this.go(this.step - 1)));
    on("forward", "click", () => this.forward());
    on("reset", "click", () => this.reset());
    on("undo", "click", () => this.connection.ask({ type: "undo" }));
    on("redo", "click", () => this.connection.ask({ type: "redo" }));
    on("clear", "click", () => this.connection.ask({ type: "clear", step: this.step }));
    on("step", "input", (event) => (this.play(false), this.go(Number(event.target.value))));
    on("speed", "change", (event) => Object.assign(this, { speed: Number(event.target.value) }));
    on("closer", "click", () => this.zoom(1.25));
    on("wider", "click", () => this.zoom(0.8));
    on("fit", "click", () => this.fit());
    on("theme", "click", () => switchTheme());
    on("follow", "change", (event) => {
      for (const { scene } of this.views) scene.camera.follow = event.target.checked;
      this.fit();
    });
    for (const button of document.querySelectorAll("[data-tool]")) {
      button.addEventListener("click", () => this.choose(button.dataset.tool));
    }
    whenThemeChanges(() => {
      for (const { scene } of this.views) scene.recolour();
      this.redraw();
    });
  }

  /** Forget how drives ended, and their paths. */
  forgetDrives() {
    this.results.clear();
    for (const view of this.views) view.ghosts = [];
    this.redraw();
  }

  choose(tool) {
    this.tool = tool;
    for (const button of document.querySelectorAll("[data-tool]")) {
      button.setAttribute("aria-pressed", button.dataset.tool === tool);
    }
  }
}

recallTheme();
window.play = new App();
