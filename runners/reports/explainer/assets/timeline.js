// Scores, or expected times, and clearance over the steps, with marks at switches and at decisions that would differ.

const MARK_PX = 7;
const STRIDES = [1, 2, 5].flatMap((digit) => [1, 10, 100, 1000].map((ten) => digit * ten)).sort((a, b) => a - b);

class Timeline {
  /**
   * @param {HTMLElement} holder
   * @param {Trace} trace
   * @param {function(number): void} go - called with the step pointed at
   */
  constructor(holder, trace, go) {
    Object.assign(this, { holder, trace, go, changed: [] });
    this.steps = Float64Array.from({ length: trace.last + 1 }, (_, i) => i);
    const clearance = Array.from(trace.arrays.clearance, (value) => (Number.isFinite(value) ? value : null));
    this.data = [this.steps, ...(trace.explained ? [this.#nothing(), this.#nothing()] : []), clearance];
    this.cursor = document.createElement("div");
    this.cursor.className = "now";
    this.step = 0;
    this.recolour();
  }

  /** The best candidate and the old subgoal, by step, and the steps that would choose another subgoal. */
  judge(verdicts, changed) {
    this.changed = changed;
    const { timed } = this.trace.head;
    verdicts.forEach(({ bestScore, oldScore, bestTime, oldTime }, step) => {
      this.data[1][step] = timed ? bestTime : bestScore;
      const old = timed ? oldTime : oldScore;
      this.data[2][step] = Number.isNaN(old) ? null : old;
    });
    this.plot.setData(this.data);
  }

  /** Move the line at the current step. */
  move(step) {
    this.step = step;
    this.cursor.style.transform = `translateX(${this.plot.valToPos(step, "x")}px)`;
  }

  /** Fit the chart to its place on the page. */
  resize() {
    this.plot.setSize(this.#size());
    this.move(this.step);
  }

  /** Draw again in the theme's colours. */
  recolour() {
    this.colours = themeColours();
    if (this.plot) this.plot.destroy();
    this.plot = new uPlot(this.#options(), this.data, this.holder);
    this.plot.over.append(this.cursor);
    this.#listen(this.plot.over);
    this.move(this.step);
  }

  #nothing() {
    return new Array(this.trace.last + 1).fill(null);
  }

  #size() {
    return { width: this.holder.clientWidth, height: this.holder.clientHeight };
  }

  #options() {
    const { colours } = this;
    const scores = [
      { scale: "S", stroke: colours.chosen, width: 1.5, points: { show: false } },
      { scale: "S", stroke: colours.old, width: 1.5, dash: [5, 3], points: { show: false } },
    ];
    const clearance = { scale: "m", stroke: colours.muted, width: 1.25, dash: [2, 3], points: { show: false } };
    const axis = {
      stroke: colours.ink, font: "11px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif",
      grid: { stroke: colours.line, width: 0.5 }, ticks: { stroke: colours.line, width: 0.5, size: 4 },
    };
    const { explained, head } = this.trace;
    return {
      ...this.#size(),
      padding: [10, explained ? null : 24, 0, 0],
      legend: { show: false },
      cursor: { y: false, points: { show: false }, drag: { x: false, y: false } },
      scales: { x: { time: false, range: [0, Math.max(this.trace.last, 1)] }, m: { range: (_, __, top) => [0, 1.08 * top] } },
      series: [{}, ...(explained ? scores : []), clearance],
      axes: [
        { ...axis, size: 22, gap: 2, incrs: STRIDES },
        ...(explained ? [{ ...axis, scale: "S", size: 48, gap: 3, ...(head.timed ? { values: inUnit("s") } : {}) }] : []),
        { ...axis, scale: "m", side: explained ? 1 : 3, size: 40, gap: 3, grid: { show: !explained },
          values: inUnit("m") },
      ],
      hooks: { draw: [(plot) => this.#marks(plot)] },
    };
  }

  /** Triangles: at the bottom where the subgoal was switched, at the top where it would differ. */
  #marks(plot) {
    const { ctx, bbox } = plot;
    const size = MARK_PX * (window.devicePixelRatio || 1);
    const triangle = (step, y, towards) => {
      const x = plot.valToPos(step, "x", true);
      ctx.moveTo(x, y + towards * size);
      ctx.lineTo(x - size / 2.5, y);
      ctx.lineTo(x + size / 2.5, y);
    };
    const draw = (steps, colour, y, towards) => {
      ctx.beginPath();
      for (const step of steps) triangle(step, y, towards);
      ctx.fillStyle = colour;
      ctx.fill();
    };
    ctx.save();
    draw(whereTrue(this.trace.arrays.switched), this.colours.ink, bbox.top + bbox.height, -1);
    draw(whereTrue(this.changed), this.colours.other, bbox.top, 1);
    ctx.restore();
  }

  #listen(over) {
    const pick = (event) => {
      const step = this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
      this.go(Math.round(step));
    };
    over.addEventListener("pointerdown", (event) => {
      over.setPointerCapture(event.pointerId);
      pick(event);
    });
    over.addEventListener("pointermove", (event) => {
      if (over.hasPointerCapture(event.pointerId)) pick(event);
    });
  }
}

/** The labels of an axis. */
function inUnit(unit) {
  return (_, ticks) => ticks.map((value) => `${value} ${unit}`);
}

/** Indices of true flags. */
function whereTrue(flags) {
  const found = [];
  flags.forEach((flag, index) => {
    if (flag) found.push(index);
  });
  return found;
}
