// What the search lists first: pages for users. The program's own names, its modules and long tables come after them.
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: {0: 15, 1: 5, 2: -5}, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
  behind: [[/^docs\/reference\/(modules|python)/, 100], [/^(CHANGELOG|docs\/(claims|interpretations_p\d)|benchmarks)/, 50]],
  score: ([page, , , , score, , kind]) =>
    score - (kind === "object" ? 100 : 0) - (Scorer.behind.find(([pages]) => pages.test(page)) || [0, 0])[1],
};
