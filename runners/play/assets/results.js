// How the drives of each system ended: a table that counts.

class Results {
  constructor(body) {
    this.body = body;
    this.rows = new Map();
  }

  /** Count a drive that has ended. */
  add(trace) {
    const { system, outcome, time } = trace.head;
    const row = this.rows.get(system) ?? { success: 0, collision: 0, timeout: 0, times: [] };
    row[outcome] += 1;
    if (outcome === "success") row.times.push(time);
    this.rows.set(system, row);
    this.#show();
  }

  clear() {
    this.rows.clear();
    this.#show();
  }

  #show() {
    byId("results").hidden = !this.rows.size;
    this.body.replaceChildren(...[...this.rows].map(([system, { success, collision, timeout, times }]) => {
      const row = document.createElement("tr");
      const mean = times.length ? seconds(times.reduce((sum, time) => sum + time, 0) / times.length) : DASH;
      row.append(Object.assign(named("th", system), { scope: "row" }), ...[success, collision, timeout, mean].map((text) => named("td", text)));
      return row;
    }));
  }
}
