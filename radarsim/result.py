"""What a finished experiment gives: tables, figures, files."""

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

from radarsim.config.load import Experiment
from radarsim.engine.results import CaseResult


class Result:
    """A finished experiment: its cases, tables (pandas), figures (Matplotlib). Nothing is written unless asked for."""

    def __init__(self, experiment: Experiment, cases: Sequence[CaseResult], facts: Mapping):
        self.experiment, self.cases, self.facts = experiment, tuple(cases), dict(facts)

    def __repr__(self):
        counts = sorted({case.count for case in self.cases})
        each = f"{counts[0]:,}" if len(counts) == 1 else f"{counts[0]:,} to {counts[-1]:,}"
        return f"<radarsim result {self.experiment.stem}: {len(self.cases)} cases of {each} realisations>"

    @cached_property
    def tables(self) -> dict:
        """Every table by the stem of its file: `curves`, `gains`, `claims`, and the study's own."""
        from radarsim.report import output

        return output.tables(self.cases, self.experiment.control_variate)

    @property
    def curves(self):
        """sigma(k), bias and spread of every case, filter and component: a DataFrame with the columns of curves.csv."""
        return self.tables["curves"]

    @property
    def gains(self):
        """Gains against the baseline filter: a DataFrame with the columns of gains.csv."""
        return self.tables["gains"]

    @property
    def last_scan(self):
        """The rows of curves at the last scan of each case, filter and component, with those of gains beside them."""
        keys = ["case", "filter", "component"]
        last = self.curves.groupby(keys, sort=False).tail(1)
        return last.merge(self.gains.groupby(keys, sort=False).tail(1), on=[*keys, "k", "t_s"], how="left")

    @cached_property
    def _described(self) -> dict:
        from radarsim.report import output

        return output.figures(self.cases, self.tables, self.experiment)

    @property
    def figures(self) -> tuple[str, ...]:
        """The names that `figure` takes."""
        return tuple(self._described)

    def figure(self, name: str):
        """A Matplotlib figure by its name; KeyError names those there are."""
        from radarsim.report import figures

        if name not in self._described:
            raise KeyError(f"no figure {name!r}; there are: {', '.join(self._described)}")
        return figures.render(self._described[name])

    def write(self, out: str | os.PathLike, figures: bool = True, formats: Sequence[str] = ("svg", "png")):
        """Write tables, figures, claims, run.json and report.html into out/<stem>/, and out/index.html anew.

        formats are those of the figures' files: svg, png, pdf. What was written comes back.
        """
        from radarsim.report import index, output

        folder = Path(out) / self.experiment.stem
        facts = self.facts | {"finished": datetime.now(UTC).isoformat("T", "seconds")}
        self.written = output.write(
            self.experiment, self.cases, folder, facts, draw=figures, made=self.tables, formats=formats
        )
        index.write(Path(out))
        return self.written

    def verdicts(self) -> dict[str, list[str]]:
        """The claims that came out so, by verdict; empty where this experiment judges none."""
        judged = self.tables["claims"].drop_duplicates("claim")
        return {verdict: list(group["claim"]) for verdict, group in judged.groupby("overall", sort=False)}

    @property
    def unmet(self) -> list[str]:
        """The targets of precision or time that the run did not reach, in words; empty if it is all that was asked."""
        return list(self.facts.get("unmet", ()))

    @property
    def warnings(self) -> list[str]:
        """What a reader of the numbers must know: damaged or mixed blocks, too few realisations."""
        from radarsim.report import provenance

        return [*self.facts["warnings"], *provenance.few(self.cases)]
