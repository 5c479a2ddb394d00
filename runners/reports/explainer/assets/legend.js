// The colour scale of the candidates.

class Legend {
  /** @param {HTMLElement} holder - a canvas for the colours and an element for the numbers */
  constructor(holder) {
    this.bar = holder.querySelector("canvas");
    this.marks = holder.querySelector("span");
    const ctx = this.bar.getContext("2d");
    for (let i = 0; i < 256; i++) {
      ctx.fillStyle = SHADES[i];
      ctx.fillRect((i * this.bar.width) / 256, 0, this.bar.width / 256 + 1, this.bar.height);
    }
  }

  /** Write the numbers of a scale; ≤ and ≥ mark ends at which values are clipped. */
  show({ low, high, below, above }) {
    const texts = high > low
      ? [`${below ? "≤ " : ""}${number(low)}`, number((low + high) / 2), `${above ? "≥ " : ""}${number(high)}`]
      : ["", `all ${number(low)}`, ""];
    texts.forEach((text, i) => {
      this.marks.children[i].textContent = text;
    });
  }
}
