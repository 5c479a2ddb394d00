// A slider, a number and a reset for each parameter.

const TICKS = 1000; // of a slider: 0 is zero, the rest is logarithmic
const RANGE = { weight: [0.01, 10000], d1: [0.01, 10], d2: [0.01, 10000] };

/** Value of a tick. The last tick of a maintenance parameter is infinity. */
function valueAt(name, tick) {
  if (tick <= 0) return 0;
  if (tick >= TICKS && mayBeInfinite(name)) return Infinity;
  const [low, high] = rangeOf(name);
  return Number((low * (high / low) ** ((tick - 1) / (TICKS - 2))).toPrecision(3));
}

/** The tick nearest to a value. */
function tickOf(name, value) {
  if (value <= 0) return 0;
  if (value === Infinity) return TICKS;
  const [low, high] = rangeOf(name);
  const tick = 1 + ((TICKS - 2) * Math.log(value / low)) / Math.log(high / low);
  return Math.round(Math.min(Math.max(tick, 1), TICKS - 1));
}

/** The typed value; null if it is not valid for this parameter. */
function parsed(name, text) {
  const word = text.trim().toLowerCase().replace(",", ".");
  if (/^(∞|inf|\.inf|infinity)$/.test(word)) return mayBeInfinite(name) ? Infinity : null;
  const value = word === "" ? NaN : Number(word);
  return Number.isFinite(value) && value >= 0 ? value : null;
}

function mayBeInfinite(name) {
  return name === "d1" || name === "d2";
}

function rangeOf(name) {
  return RANGE[name] || RANGE.weight;
}

class ParameterPanel {
  /**
   * @param {HTMLElement} holder - gets a row per parameter
   * @param {Object} head - names, parameters as recorded
   * @param {Meanings} meanings - of the names
   * @param {function(Parameters): void} changed
   */
  constructor(holder, head, meanings, changed) {
    this.names = [...head.names, "d1", "d2"];
    this.recorded = {};
    for (const name of this.names) this.recorded[name] = Number(head.parameters[name] === "inf" ? Infinity
      : head.parameters[name]);
    this.values = { ...this.recorded };
    this.changed = changed;
    this.rows = {};
    for (const name of this.names) this.rows[name] = this.#row(holder, name, meanings);
    for (const name of this.names) this.#show(name);
  }

  /** @returns {Parameters} */
  get parameters() {
    const weights = this.names.slice(0, -2).map((name) => this.values[name]);
    return { weights: Float64Array.from(weights), d1: this.values.d1, d2: this.values.d2 };
  }

  /** Whether any differs from the record. */
  get moved() {
    return this.names.some((name) => this.values[name] !== this.recorded[name]);
  }

  /** Set one or more by name. */
  set(values) {
    Object.assign(this.values, values);
    for (const name of Object.keys(values)) this.#show(name);
    this.changed(this.parameters);
  }

  /** All as recorded. */
  reset() {
    this.set(this.recorded);
  }

  #row(holder, name, meanings) {
    const row = document.createElement("div");
    row.className = "parameter";
    row.append(
      Object.assign(named("label", name), { htmlFor: `p-${name}`, className: "name" }),
      Object.assign(document.createElement("input"), { type: "range", id: `p-${name}`, max: TICKS }),
      Object.assign(document.createElement("input"), { type: "text", inputMode: "decimal", id: `n-${name}` }),
      Object.assign(document.createElement("button"), { type: "button", textContent: "↺", className: "reset" }),
    );
    const [label, slider, box, button] = row.children;
    for (const element of [label, slider]) meanings.explain(element, name);
    box.setAttribute("aria-label", `${name}, as a number`);
    button.setAttribute("aria-label", `Reset ${name} to ${parameter(this.recorded[name])}`);
    button.title = `Back to ${parameter(this.recorded[name])}`;
    slider.addEventListener("input", () => this.set({ [name]: valueAt(name, Number(slider.value)) }));
    box.addEventListener("change", () => this.#typed(name, box));
    button.addEventListener("click", () => {
      this.set({ [name]: this.recorded[name] });
      slider.focus(); // the button is now disabled
    });
    holder.append(row);
    return { row, slider, box, button };
  }

  #typed(name, box) {
    const value = parsed(name, box.value);
    box.setAttribute("aria-invalid", value === null);
    box.title = value === null ? `A number of at least 0${mayBeInfinite(name) ? ", or inf" : ""}` : "";
    if (value !== null) this.set({ [name]: value });
  }

  #show(name) {
    const { row, slider, box, button } = this.rows[name];
    const value = this.values[name];
    slider.value = tickOf(name, value);
    slider.setAttribute("aria-valuetext", value === Infinity ? "infinite" : String(value));
    box.value = parameter(value);
    box.removeAttribute("aria-invalid");
    button.disabled = value === this.recorded[name];
    row.classList.toggle("moved", !button.disabled);
  }
}
