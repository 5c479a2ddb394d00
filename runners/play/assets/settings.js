// What drives, and where: words of the command line, as controls.

const NUMBERS = { // key: name, unit, step
  "robot.v_max": ["top speed", "m/s", 0.1],
  "robot.omega_max": ["top turn rate", "rad/s", 0.1],
  "robot.alpha_v": ["acceleration", "m/s²", 0.5],
  "robot.alpha_omega": ["turn acceleration", "rad/s²", 0.5],
  "robot.lidar.num_beams": ["beams", "", 10],
  "robot.lidar.fov": ["field of view", "rad", 0.1],
  "robot.lidar.range_max": ["range", "m", 0.5],
  "robot.lidar.noise_std": ["lidar noise", "m", 0.005],
  "sim.latency": ["delay", "s", 0.05],
  "sim.lag": ["lag", "s", 0.05],
  "sim.slip": ["slip", "", 0.02],
  "sim.odometry_error": ["odometry error", "", 0.01],
  "sim.scan_noise": ["scan noise", "m", 0.01],
  "sim.scan_dropout": ["lost beams", "share", 0.05],
  "sim.goal_noise": ["localisation error", "m", 0.02],
  "sim.goal_noise_yaw": ["heading error", "rad", 0.02],
};
const CHOICES = { // key: the group of options
  robot: "robot", sim: "sim", map: "map", crowd: "crowd", ablation: "ablation", weights: "weights",
};
const DEFAULTS = { robot: "jackal", sim: "fast", map: "empty", crowd: "none", ablation: "none", weights: "published" };

class Settings {
  constructor(app) {
    this.app = app;
    this.words = {};
    for (const key of Object.keys(CHOICES)) byId(`set-${key}`).addEventListener("change", ({ target }) => this.#choose(key, target.value));
    for (const id of ["set-system", "set-beside"]) byId(id).addEventListener("change", () => this.#systems());
    byId("set-people").addEventListener("change", ({ target }) => this.set({ people: target.value }));
    byId("set-world").addEventListener("change", ({ target }) => this.set({ "map.worlds": `[${target.value}]` }));
    for (const key of ["seed", "run"]) byId(`set-${key}`).addEventListener("change", ({ target }) => this.set({ [key]: target.value }));
    byId("more-words").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#typed(byId("words").value);
    });
    this.inputs = {};
    for (const key of Object.keys(NUMBERS)) this.inputs[key] = this.#number(key);
  }

  /** Fill the lists of options. */
  offer(options) {
    this.options = options;
    for (const [key, group] of Object.entries(CHOICES)) fillList(byId(`set-${key}`), options[group]);
    for (const file of options.files) byId("set-map").append(new Option(file, `file ${file}`));
    fillList(byId("set-system"), options.system);
    fillList(byId("set-beside"), options.system, true);
  }

  /** Show what the session drives. */
  show(situation) {
    this.words = Object.fromEntries(situation.words.map((word) => [word.split("=")[0].replace(/^\++/, ""), word.slice(word.indexOf("=") + 1)]));
    const systems = (this.words.system ?? (this.words.guide || this.words.planner ? "" : "lme_plus")).split(",");
    chosen(byId("set-system"), systems[0]);
    chosen(byId("set-beside"), systems[1] ?? "");
    for (const key of Object.keys(CHOICES)) chosen(byId(`set-${key}`), this.words[key] ?? DEFAULTS[key]);
    if (this.words.map === "file") {
      const file = this.options.files.find((name) => this.words["map.path"]?.replaceAll("'", "").endsWith(name));
      if (file) chosen(byId("set-map"), `file ${file}`);
    }
    chosen(byId("set-people"), this.words.people ?? "truth");
    byId("set-world").value = situation.world;
    byId("set-run").value = situation.run;
    byId("set-seed").value = situation.seed;
    const { worlds } = situation;
    byId("worlds").replaceChildren(...worlds.slice(0, 1000).map((number) => new Option(number, number)));
    for (const [key, input] of Object.entries(this.inputs)) {
      const value = situation.values[key];
      input.parentElement.hidden = value === undefined;
      if (document.activeElement !== input) input.value = value === undefined ? "" : Number(value.toPrecision(6));
      input.parentElement.classList.toggle("moved", key in this.words);
    }
    byId("words").value = situation.words.join("  ");
  }

  /** Change words; null takes one away. */
  set(changes) {
    return this.app.send({ type: "words", set: changes });
  }

  #choose(key, value) {
    if (value.startsWith("file ")) this.set({ map: "file", "map.path": value.slice(5) });
    else this.set({ [key]: value });
  }

  #systems() {
    const [one, two] = [byId("set-system").value, byId("set-beside").value];
    this.set({ system: two && two !== one ? `${one},${two}` : one });
  }

  /** Take the words that were typed: those that are gone, those that differ. */
  #typed(text) {
    const words = text.trim().split(/\s+(?=[+~]?[a-z_.]+=)/).filter(Boolean);
    const wanted = Object.fromEntries(words.map((word) => [word.split("=")[0].replace(/^\++/, ""), word.slice(word.indexOf("=") + 1).trim()]));
    const changes = {};
    for (const key of Object.keys(this.words)) if (!(key in wanted)) changes[key] = null;
    for (const [key, value] of Object.entries(wanted)) if (this.words[key] !== value) changes[key] = value;
    this.set(changes);
  }

  #number(key) {
    const [name, unit, step] = NUMBERS[key];
    const label = Object.assign(document.createElement("label"), { className: "number", title: key });
    const input = Object.assign(document.createElement("input"), { type: "number", step, min: 0, id: `set-${key}` });
    label.append(named("span", unit ? `${name} [${unit}]` : name), input);
    input.addEventListener("change", () => this.set({ [key]: input.value === "" ? null : input.value }));
    byId(key.startsWith("sim") ? "sim-numbers" : "robot-numbers").append(label);
    return input;
  }
}

/** Fill a list with options, by name. Longer texts become the tip of each. */
function fillList(list, options, none = false) {
  list.replaceChildren(...(none ? [new Option("–", "")] : []),
    ...Object.entries(options).map(([name, text]) => Object.assign(new Option(list.id === "set-system" || list.id === "set-beside" ? text : name, name), { title: text })));
}

/** Choose an option; one that the list lacks is added. */
function chosen(list, value) {
  if (![...list.options].some((option) => option.value === value)) list.append(new Option(value || "–", value));
  list.value = value;
}
