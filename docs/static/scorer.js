// What the search shows first: a page to learn from, then a guide, then a reference, and what was written down last.

var Scorer = {
  pages: [
    [/^docs\/learn\/faq/, 1.5],
    [/^docs\/learn\//, 2],
    [/^docs\/howto\//, 2.5],
    [/^docs\/reference\/commands/, 1.5],
    [/^(CHANGELOG|CONTRIBUTING|SECURITY|benchmarks\/)/, 0.1],
    [/^docs\/reference\/config\//, 0.6],
  ],
  score: function ([page, title, , , score]) {
    const found = this.pages.find(([pattern]) => pattern.test(page));
    const words = (new URLSearchParams(window.location.search).get("q") ?? "").toLowerCase().split(/\s+/);
    const isNamed = words.every((word) => title.toLowerCase().includes(word)); // the page is about it
    return score * (found ? found[1] : 1) * (isNamed ? 2 : 1);
  },

  // Sphinx's own
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
