"""The papers' claims: data, what is measured for them, the rule of the verdicts, interpretations, and their pages.

Nothing outside this package imports it: it adds itself to runs, reports and commands by `radarsim.papers.extension`."""
