// What the search shows first: a page to learn from, then a guide, then a reference, and what was written down last.

var Scorer = {
  pages: [
    [/^docs\/learn\//, 3],
    [/^docs\/howto\//, 2],
    [/^docs\/reference\/commands/, 1.5],
    [/^(CHANGELOG|CONTRIBUTING|SECURITY|benchmarks\/)/, 0.1],
    [/^docs\/reference\/config\//, 0.6],
  ],
  score: function ([page, , , , score]) {
    const found = this.pages.find(([pattern]) => pattern.test(page));
    return score * (found ? found[1] : 1);
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
