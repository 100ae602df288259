"""The result of a finished experiment: tables, figures, answer, run record and report, in memory and in files."""

import os
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import arguments, configs
from radarsim.api.display import Displayable, ShortTuple
from radarsim.api.replacement import earlier_result
from radarsim.api.result_config import config_text
from radarsim.api.result_content import case_figures, case_tables, make_answer, question_text, with_first_baseline
from radarsim.api.write_result import WrittenFiles, write_files
from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.errors import DisagreementError, MeasureError
from radarsim.extensions import extension_tables, extensions
from radarsim.language.translate import plural, tr
from radarsim.report import exact_check, provenance
from radarsim.report.column_units import column_units
from radarsim.report.row_notes import with_note_texts
from radarsim.studies.registry import quantities, study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    import xarray

    from radarsim.api.dataset import LabelledArrays
    from radarsim.api.result_content import Answer
    from radarsim.report.drawing.model import Figure


MAX_NOTEBOOK_ROWS = 40


class Result(Displayable):
    """A finished experiment: cases, tables (pandas) and figures (Matplotlib). It writes nothing unless `write` is
    called.

    written: the files of the last call of `write`; None before the first."""

    def __init__(self, experiment: Experiment, cases: Sequence[CaseResult], facts: Mapping[str, Any]):
        self.experiment, self.facts = experiment, dict(facts)
        self.cases: tuple[CaseResult, ...] = ShortTuple(cases)
        self.written: WrittenFiles | None = None

    def _answer_lines(self) -> Sequence[str]:
        """The experiment, then the answer."""
        cases = plural("{count} case", "{count} cases", len(self.cases))
        counts = {"cases": cases, "realisations": provenance.realisations_text([case.count for case in self.cases])}
        return (tr("{config}: {cases}, {realisations}", config=self._label, **counts), *self.answer)

    @property
    def _label(self) -> str:
        return self.experiment.stem

    @property
    def _html(self) -> Sequence[str]:
        """Question, answer, realisations; below the figure σ and gain at the last scan; text escaped."""
        from html import escape

        curve_columns = ("case", "filter", "component", "unit", "t_s", "sigma", "sigma_lo", "sigma_hi")
        known_columns = (name for name in ("exact_sigma", "bound") if name in self.curves)
        gain_columns = (name for name in ("gain_percent", "gain_lo", "gain_hi") if len(self.gains))
        rows = self.last_scan[[*curve_columns, *known_columns, *gain_columns]].dropna(axis=1, how="all")
        table = rows.to_html(
            index=False, border=0, float_format=lambda v: f"{v:.4g}", na_rep="", max_rows=MAX_NOTEBOOK_ROWS
        )
        answer = "".join(f"<p>{escape(line)}</p>" for line in self.answer)
        count = escape(provenance.realisations_text([case.count for case in self.cases]))
        return f"<h4>{escape(self.question)}</h4>{answer}<p>{count}; {tr('95 % intervals')}.</p>", table

    @property
    def question(self) -> str:
        """The experiment's question, in one sentence."""
        return question_text(self.experiment)

    @cached_property
    def answer(self) -> tuple[str, ...]:
        """Sentences with numbers and 95 % intervals.

        >>> import radarsim
        >>> radarsim.run("rls2", realisations=2000).answer[0].split(":")[0]
        'Range'
        """
        return self._answer.texts

    @cached_property
    def _answer(self) -> "Answer":
        return make_answer(self.cases, self._tables)

    @property
    def tables(self) -> dict:
        """Every table by the stem of its file: `curves`, `gains`, the study's own, and those of extensions.

        They are copies, like `curves` and `gains`: `write` always writes the numbers of the run.

        >>> import radarsim
        >>> sorted(radarsim.run("rls2", realisations=2000).tables)
        ['claims', 'consistency', 'curves', 'gains', 'radar', 'steady']
        """
        return {name: self.table(name) for name in self._tables}

    def table(self, name: str) -> "pd.DataFrame":
        """One of `tables`, which makes a copy of no other.

        >>> import radarsim
        >>> radarsim.run("rls2", realisations=2000).table("radar").columns[0]
        'case'
        """
        return self._described(with_note_texts(self._tables[name]))

    @cached_property
    def _tables(self) -> dict:

        return case_tables(self.cases, configs.shipped_stem(self.experiment))

    @property
    def curves(self) -> "pd.DataFrame":
        """sigma(k), bias and spread of every case, filter and component: a DataFrame with the columns of curves.csv.

        >>> import radarsim
        >>> curves = radarsim.run("rls2", realisations=2000).curves
        >>> first = curves[(curves["filter"] == "r") & (curves["component"] == "r")].iloc[0]
        >>> bool(first["sigma_lo"] < first["exact_sigma"] < first["sigma_hi"])
        True
        """
        return self.table("curves")

    @property
    def gains(self) -> "pd.DataFrame":
        """Gains against the baseline filter: a DataFrame with the columns of gains.csv."""
        return self.table("gains")

    @property
    def config(self) -> str:
        """The text of config.yaml: the whole experiment, which `run` takes; empty where no text describes it."""
        return self._config

    @cached_property
    def _config(self) -> str:
        return config_text(self.experiment, self.cases)

    def _described(self, table: "pd.DataFrame") -> "pd.DataFrame":
        """The table with the units of its columns, the seed and the config in its `attrs`."""
        table.attrs.update(units=column_units(table.columns), seed=self.experiment.seed, config=self.config)
        return table

    def to_xarray(self) -> "xarray.Dataset":
        """Curves and gains as a dataset of xarray, which must be installed.

        Its dimensions are case, filter, component and scan k, of gains also baseline; it has times, units, seed and
        config.

        >>> import radarsim
        >>> dataset = radarsim.run("rls2", realisations=2000).to_xarray()
        >>> dict(dataset["sigma"].sizes)
        {'case': 1, 'filter': 2, 'component': 3, 'k': 15}
        """
        from radarsim.api import dataset

        return dataset.to_xarray(self._labelled_arrays())

    def write_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Write what `to_xarray` has to a netCDF file, which needs no further package. Raises StoreError."""
        from radarsim.api import dataset

        dataset.write_netcdf(path, self._labelled_arrays())

    def _labelled_arrays(self) -> "LabelledArrays":
        from radarsim.api import dataset

        attributes = {"title": self._label, "study": self.experiment.study, "config": self.config}
        attributes |= {"seed": str(self.experiment.seed), "source": f"radarsim {provenance.versions()['radarsim']}"}
        return dataset.labelled_arrays(self.curves, self.gains, attributes)

    @property
    def last_scan(self) -> "pd.DataFrame":
        """The rows of curves at the last scan of each case, filter and component, joined with those of gains.

        `note` warns where σ's interval is unreliable, `gain_note` where the gain's is; each column exists only if
        needed."""
        keys = ["case", "filter", "component"]
        last = self.curves.groupby(keys, sort=False).tail(1)
        gains = with_first_baseline({"gains": self.gains}, self.cases)["gains"]
        gains = gains.groupby(keys, sort=False).tail(1).rename(columns={"note": "gain_note"})
        return last.merge(gains, on=[*keys, "k", "t_s"], how="left")

    def errors(
        self, filter: str, component: str, case: str | None = None, realisations: int | None = None
    ) -> "Iterator[np.ndarray]":
        """The errors (n, K) of a filter's estimates in a component, realisation by realisation, a block at a time.

        They are drawn again, not-a-number where there is no estimate; `case` is a name, by default the first;
        `realisations` how many, from the first on. Raises ConfigError for an unknown name.

        >>> import radarsim
        >>> result = radarsim.run("rls2", realisations=2000)
        >>> sum(len(errors) for errors in result.errors("r", "r"))
        2000
        """
        from radarsim.api import realisation_errors

        return realisation_errors.result_errors(self, filter, component, case, realisations)

    def add_runs_table(self, span: str = "all") -> None:
        """Add the table `runs`: of each run's root mean square over the scans of a span, `2:60`, the mean, median,
        variance and quantiles over the runs. Raises ConfigError for an impossible span."""
        from radarsim.api import runs_table

        self._tables["runs"] = runs_table.runs_table(self, span)

    @cached_property
    def _figures_by_name(self) -> "dict[str, Figure]":
        return case_figures(self.cases, self._tables, self.experiment)

    def write(
        self,
        out: str | os.PathLike[str],
        figures: bool | str | Sequence[str] = True,
        width_mm: float | None = None,
        replace: bool = False,
    ) -> "WrittenFiles":
        """Write tables, figures, run.json and report.html into out/<stem>/, and update out/index.html.

        figures may name the formats of their files: svg, png, pdf; width_mm overrides their width. Returns the files
        written. Raises ConfigError where tables of other settings, another seed or more realisations would be lost,
        unless `replace`; DisagreementError, after writing, if there are `faults`."""
        from radarsim.report import index_page

        arguments.check_arguments(out=out, figures=figures, width_mm=width_mm)
        if not replace:
            earlier = earlier_result(self.experiment, out)
            earlier.check_replacement(list(self.facts.get("judged", ())))
            earlier.check_counts({case.name: case.count for case in self.cases})
        folder = Path(out) / self.experiment.stem
        for extension in extensions():
            self._tables.update(extension.updated_tables(self._tables, self.experiment.study, Path(out)))
        formats = arguments.figure_formats(figures)
        facts = self.facts | {"finished": datetime.now(UTC).isoformat("T", "seconds")}
        facts["warnings"] = [*self.faults, *facts["warnings"]]
        write = partial(write_files, draw=bool(formats), formats=formats, width_mm=width_mm)
        self.written = write(self.experiment, self.cases, folder, facts, tables_by_name=self._tables)
        index_page.write_index(Path(out))
        self.check()
        return self.written

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """A line for each difference between exact and measured values that chance does not explain."""
        case_study, tables = study(self.experiment.study), self._tables
        approximate_cases = [case.name for case in self.experiment.cases if case_study.exact_but_for(case)]
        exempt_tables = (*extension_tables(), *(() if case_study.exact_errors else ("curves", "gains")))
        return (
            *exact_check.disagreements(
                tables, approximate_cases, exempt_tables, quantities(case_study.name, self.cases[0].spec)
            ),
            *(line for extension in extensions() for line in extension.disagreements(tables)),
        )

    def check(self) -> None:
        """Raises DisagreementError if there are `faults`, or MeasureError for errors of a study's author."""
        if self.faults:
            error = DisagreementError(*self.faults)
            error.result = self
            raise error
        if errors := [line for extension in extensions() for line in extension.author_errors(self._tables)]:
            unmeasured = MeasureError(*errors)
            unmeasured.result = self
            raise unmeasured

    @property
    def unmet(self) -> list[str]:
        """The targets of precision or time that the run did not reach, a text for each."""
        return list(self.facts.get("unmet", ()))

    @property
    def warnings(self) -> list[str]:
        """Warnings on the numbers: faults, damaged or mixed blocks, too few realisations."""
        return [*self.faults, *self.facts["warnings"], *self._answer_warnings]

    @cached_property
    def _answer_warnings(self) -> Sequence[str]:
        return self.written.answer_warnings if self.written is not None else self._answer.warnings
