// The terms of S as bars with numbers: of the candidate pointed at, the chosen subgoal and the old one.

const SIDES = ["picked", "chosen", "old"];

class Bars {
  /** @param {HTMLTableSectionElement} body - gets a row per criterion and one for S */
  constructor(body, names, meanings) {
    this.rows = [...names, "S"].map((name) => termRow(body, name, meanings));
  }

  /**
   * Show terms; each side is a list of numbers in the order of the criteria, or null.
   * @param {{picked: ?number[], chosen: ?number[], old: ?number[]}} sides
   */
  show(sides) {
    const [low, high] = termScale(SIDES.map((side) => sides[side]).filter(Boolean));
    this.rows.forEach((row, i) => {
      for (const side of SIDES) {
        const terms = sides[side];
        const total = i === this.rows.length - 1;
        const value = terms ? (total ? sum(terms) : terms[i]) : NaN;
        row.cells[side].textContent = number(value);
        row.cells[side].dataset.value = terms ? String(value) : "";
        if (!total) stretch(row.bars[side], value, low, high);
      }
    });
  }
}

function termRow(body, name, meanings) {
  const row = body.insertRow();
  const head = document.createElement("th");
  head.scope = "row";
  head.append(meanings.button(name));
  row.append(head);
  const chart = row.insertCell();
  chart.className = "chart";
  chart.setAttribute("aria-hidden", "true");
  const [cells, bars] = [{}, {}];
  for (const side of SIDES) {
    bars[side] = document.createElement("i");
    bars[side].className = `bar ${side}`;
    cells[side] = row.insertCell();
    cells[side].className = side;
  }
  if (name === "S") row.className = "total";
  else chart.append(...Object.values(bars));
  return { cells, bars };
}

/** The ends of the scale of bars: of the terms that differ between the sides, if any do, and zero. */
function termScale(shown) {
  const differ = shown.map((terms) => terms.filter((term, i) => shown.some((other) => other[i] !== term))).flat();
  const all = differ.length ? differ : shown.flat();
  return [Math.min(0, ...all), Math.max(0, ...all)];
}

/** A bar from zero to its value, or to the end of the scale; at least a pixel wide, so that it is visible. */
function stretch(bar, value, low, high) {
  bar.hidden = !Number.isFinite(value) || value === 0;
  if (bar.hidden) return;
  const span = high - low || 1;
  const [from, to] = [Math.min(0, value), Math.max(0, value)].map((end) => Math.min(Math.max(end, low), high));
  bar.style.left = `${(100 * (from - low)) / span}%`;
  bar.style.width = `max(1px, ${(100 * (to - from)) / span}%)`;
}
