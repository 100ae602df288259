"""What a finished experiment gives: tables, figures, files."""

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.errors import DisagreementError
from radarsim.studies.registry import study

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.app.output import Written
    from radarsim.report.drawing import Figure
    from radarsim.report.figures import Canvas

MOST_ROWS = 40  # that a notebook shows


class Result:
    """A finished experiment: its cases, tables (pandas), figures (Matplotlib). Nothing is written unless asked for.

    written: what the last call of `write` wrote; None before the first.
    """

    def __init__(self, experiment: Experiment, cases: Sequence[CaseResult], facts: Mapping[str, Any]):
        self.experiment, self.cases, self.facts = experiment, tuple(cases), dict(facts)
        self.written: Written | None = None

    def __repr__(self) -> str:
        counts = sorted({case.count for case in self.cases})
        each = f"{counts[0]:,}" if len(counts) == 1 else f"{counts[0]:,} to {counts[-1]:,}"
        return f"<radarsim result {self.experiment.stem}: {len(self.cases)} cases of {each} realisations>"

    def _repr_html_(self) -> str:
        """What a notebook shows: question, answer, realisations, σ and gain at the last scan; text escaped."""
        from html import escape

        from radarsim.report import provenance

        shown = ("case", "filter", "component", "unit", "t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")
        columns = [*shown, *(name for name in ("gain_percent", "gain_lo", "gain_hi") if len(self.gains))]
        rows = self.last_scan[columns].dropna(axis=1, how="all")
        table = rows.to_html(index=False, border=0, float_format=lambda v: f"{v:.4g}", na_rep="", max_rows=MOST_ROWS)
        answer = "".join(f"<p>{escape(line)}</p>" for line in self.answer)
        count = escape(provenance.span(sorted({case.count for case in self.cases})))
        return f"<h4>{escape(self.question)}</h4>{answer}<p>{count} realisations; 95 % intervals.</p>{table}"

    @property
    def question(self) -> str:
        """What the experiment asks, in one sentence."""
        return study(self.experiment.study).question(self.experiment)

    @cached_property
    def answer(self) -> tuple[str, ...]:
        """Sentences with numbers and 95 % intervals.

        >>> import radarsim
        >>> radarsim.run("rls2", realisations=2000).answer[0].split(":")[0]
        'Range'
        """
        return tuple(study(self.experiment.study).answer(self.cases, self._tables))

    @property
    def tables(self) -> dict:
        """Every table by the stem of its file: `curves`, `gains`, `claims`, and the study's own.

        Copies, like those of `curves` and `gains`: whatever is done to them, `write` writes the numbers of the run.

        >>> import radarsim
        >>> sorted(radarsim.run("rls2", realisations=2000).tables)
        ['believed', 'claims', 'consistency', 'curves', 'gains', 'radar', 'steady']
        """
        return {name: table.copy() for name, table in self._tables.items()}

    @cached_property
    def _tables(self) -> dict:
        from radarsim.app import output

        return output.tables(self.cases, self.experiment.stem)

    @property
    def curves(self) -> "pd.DataFrame":
        """sigma(k), bias and spread of every case, filter and component: a DataFrame with the columns of curves.csv.

        >>> import radarsim
        >>> curves = radarsim.run("rls2", realisations=2000).curves
        >>> first = curves[(curves["filter"] == "r") & (curves["component"] == "r")].iloc[0]
        >>> bool(first["sigma_lo"] < first["exact_sigma"] < first["sigma_hi"])
        True
        """
        return self._tables["curves"].copy()

    @property
    def gains(self) -> "pd.DataFrame":
        """Gains against the baseline filter: a DataFrame with the columns of gains.csv."""
        return self._tables["gains"].copy()

    @property
    def last_scan(self) -> "pd.DataFrame":
        """The rows of curves at the last scan of each case, filter and component, with those of gains beside them.

        `note` says where σ's interval rests on too little, `gain_note` where the gain's does; either there if needed.
        """
        keys = ["case", "filter", "component"]
        last = self.curves.groupby(keys, sort=False).tail(1)
        gains = self.gains.groupby(keys, sort=False).tail(1).rename(columns={"note": "gain_note"})
        return last.merge(gains, on=[*keys, "k", "t_s"], how="left")

    @cached_property
    def _described(self) -> "dict[str, Figure]":
        from radarsim.app import output

        return output.figures(self.cases, self._tables, self.experiment)

    @property
    def figures(self) -> tuple[str, ...]:
        """The names that `figure` takes."""
        return tuple(self._described)

    def figure(self, name: str) -> "Canvas":
        """A Matplotlib figure by its name; KeyError names those there are.

        >>> import radarsim
        >>> result = radarsim.run("rls2", realisations=2000)
        >>> result.figures[:2]
        ('gain_r', 'sigma_r')
        >>> result.figure("sigma_r").axes[0].get_xlabel()
        'time from the first plot, s'
        """
        from radarsim.report import figures

        if name not in self._described:
            raise KeyError(f"no figure {name!r}; there are: {', '.join(self._described)}")
        return figures.render(self._described[name])

    def write(
        self, out: str | os.PathLike[str], figures: bool | str | Sequence[str] = True, width_mm: float | None = None
    ) -> "Written":
        """Write tables, figures, claims, run.json and report.html into out/<stem>/, and out/index.html again.

        figures may name the formats of their files: svg, png, pdf; width_mm is their width in place of their own. What
        was written comes back. Raises DisagreementError, with all written, where there are `faults`.
        """
        from radarsim.app import arguments, output
        from radarsim.report import index, provenance

        folder = Path(out) / self.experiment.stem
        self._tables["claims"] = output.over_readings(self._tables["claims"], self.experiment.study, Path(out))
        formats = arguments.formats(figures)
        self.facts["warnings"] = [*self.facts["warnings"], *provenance.replaced(folder, self.experiment)]
        facts = self.facts | {"finished": datetime.now(UTC).isoformat("T", "seconds")}
        facts["warnings"] = [*self.faults, *facts["warnings"]]
        write = partial(output.write, draw=bool(formats), formats=formats, width_mm=width_mm)
        self.written = write(self.experiment, self.cases, folder, facts, made=self.tables)
        index.write(Path(out))
        self.check()
        return self.written

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """What no chance makes, a line each: exact and measured values apart."""
        from radarsim.report import agreement, claims

        own, made = study(self.experiment.study), self._tables
        nearly = [case.name for case in self.experiment.cases if own.exact_but_for(case)]
        bounds = ("claims",) if own.exact_errors else ("claims", "curves", "gains")
        return (*agreement.faults(made, nearly, bounds), *claims.errors(made["claims"]))

    def check(self) -> None:
        """Raises DisagreementError where there are `faults`."""
        if self.faults:
            error = DisagreementError(*self.faults)
            error.result = self
            raise error

    def verdicts(self, column: str = "class") -> dict[str, list[str]]:
        """The claims of a class over all readings that their papers allow, or `as_shipped`; empty where there are none.

        What is of an extension stands apart.
        """
        from radarsim.report.claims import page

        found: dict[str, list[str]] = {}
        claims = page.grouped(self._tables["claims"].to_dict("records"))
        for parts in sorted(claims, key=lambda parts: page.ORDER.index(parts[0][column])):
            said = parts[0][column] + (", extension" if page.extension(parts) else "")
            found.setdefault(said, []).append(parts[0]["claim"])
        return found

    def unjudged(self) -> dict[str, list[str]]:
        """The claims of this config that it cannot judge any more, or not in every part, by the reason."""
        from radarsim.report.claims import NOT_JUDGED

        table = self._tables["claims"]
        found: dict[str, list[str]] = {}
        for row in table[table["verdict"] == NOT_JUDGED].to_dict("records"):
            names = found.setdefault(row["why"], [])
            if row["claim"] not in names:
                names.append(row["claim"])
        return found

    def as_shipped(self) -> list[str]:
        """The claims judged under the shipped reading alone although their paper leaves open what they hang on."""
        from radarsim.report.claims import classes, first_rows

        rows = first_rows(self._tables["claims"].to_dict("records"))
        return [row["claim"] for row in rows if classes.alone(row)]

    @property
    def unmet(self) -> list[str]:
        """The targets of precision or time that the run did not reach, a text each; empty if all was done."""
        return list(self.facts.get("unmet", ()))

    @property
    def warnings(self) -> list[str]:
        """What a reader of the numbers must know: faults, damaged or mixed blocks, too few realisations."""
        return [*self.faults, *self.facts["warnings"], *self._of_intervals]

    @cached_property
    def _of_intervals(self) -> list[str]:
        from radarsim.report import provenance

        return provenance.of_intervals(
            self.cases, self._tables, partial(study(self.experiment.study).answer, self.cases)
        )
