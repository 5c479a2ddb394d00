// The selected part of the world as numbers, so that everything can be done by keyboard too.

const FIELDS = { // by kind: rows of [name, reader, writer]
  circles: [position("x", 0), position("y", 1), size("radius", "radius")],
  boxes: [position("x", 0), position("y", 1), side("length", 0), side("width", 1), size("angle [°]", "yaw_deg")],
  walls: [...[0, 1].flatMap((end) => [0, 1].map((axis) => corner("points", end, axis))), size("thickness", "thickness")],
  polygons: [],
  movers: [...[0, 1].flatMap((end) => [0, 1].map((axis) => corner("path", end, axis))), size("radius", "radius"), size("speed [m/s]", "speed")],
};
const WALKS = { motion: ["scripted", "orca", "social_force"], repeat: ["once", "back_and_forth", "cycle"] };
const KIND_NAMES = { circles: "disc", boxes: "box", walls: "wall", polygons: "polygon", movers: "person" };

function position(name, axis) {
  return [`${name} [m]`, (entry) => entry.centre[axis], (entry, value) => ({ ...entry, centre: entry.centre.with(axis, value) })];
}

function size(name, key) {
  return [name.includes("[") ? name : `${name} [m]`, (entry) => entry[key], (entry, value) => ({ ...entry, [key]: value })];
}

function side(name, axis) {
  return [`${name} [m]`, (entry) => entry.size[axis], (entry, value) => ({ ...entry, size: entry.size.with(axis, value) })];
}

function corner(key, end, axis) {
  const name = `${["from", "to"][end]} ${["x", "y"][axis]} [m]`;
  return [name, (entry) => entry[key].at(end && -1)?.[axis], (entry, value) => {
    const at = end ? entry[key].length - 1 : 0;
    return { ...entry, [key]: entry[key].with(at, entry[key][at].with(axis, value)) };
  }];
}

class Selection {
  constructor(app) {
    this.app = app;
    byId("selected-erase").addEventListener("click", () => app.selected && app.erase(app.selected, app.tools.gesture()));
  }

  /** Show the numbers of what is selected. */
  show() {
    const { app } = this;
    const part = app.selectedPart;
    byId("selection").hidden = !part;
    if (!part) {
      this.shown = null;
      return;
    }
    byId("selected-name").textContent = `${KIND_NAMES[part.kind]} ${part.name}`;
    if (this.shown !== part.name) this.#rows(part);
    this.shown = part.name;
    for (const { input, read } of this.rows) {
      const value = read(part.entry);
      input.parentElement.hidden = value === undefined;
      if (document.activeElement !== input && input.type !== "checkbox") input.value = typeof value === "number" ? Number(value.toFixed(3)) : value;
    }
  }

  #rows(part) {
    this.rows = FIELDS[part.kind].map(([name, read, write]) => this.#row(name, { type: "number", step: 0.1 }, read,
      (entry, text) => (text === "" ? entry : write(entry, Number(text)))));
    if (part.kind === "movers" && part.entry.radius) {
      for (const [key, values] of Object.entries(WALKS)) this.rows.push(this.#list(key, values));
    }
    byId("selected-fields").replaceChildren(...this.rows.map(({ input }) => input.parentElement));
  }

  #row(name, attributes, read, write) {
    const label = Object.assign(document.createElement("label"), { className: "number" });
    const input = Object.assign(document.createElement("input"), attributes);
    label.append(named("span", name), input);
    input.addEventListener("change", () => this.#put((entry) => write(entry, input.value)));
    return { input, read };
  }

  #list(key, values) {
    const label = Object.assign(document.createElement("label"), { className: "number" });
    const input = document.createElement("select");
    for (const value of values) input.append(new Option(value.replaceAll("_", " "), value));
    label.append(named("span", key), input);
    input.addEventListener("change", () => this.#put((entry) => ({ ...entry, [key]: input.value })));
    return { input, read: (entry) => entry[key] ?? values[0] };
  }

  #put(change) {
    const { app } = this;
    const part = app.selectedPart;
    if (part) app.put(part.name, part.kind, change(part.entry), app.tools.gesture());
  }
}
