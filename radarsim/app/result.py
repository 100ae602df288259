"""The result of a finished experiment: tables, figures, claims, run.json and report.html, in memory and as files."""

import os
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.app import configs
from radarsim.app.shown import Several, Shown
from radarsim.app.stored import classes_of
from radarsim.config.experiment import DRAWN_FOR_ALL, Case, Experiment, matches
from radarsim.engine.machine import machine_facts
from radarsim.engine.results import CaseResult
from radarsim.errors import OF_AUTHORS, DisagreementError, MeasureError, RadarsimError
from radarsim.language import ENGLISH, called, current, plural, tr
from radarsim.report import claims, files, notes, outside, panels, seen
from radarsim.report import tables as common
from radarsim.report.claims import page
from radarsim.report.claims.page import OVER, with_classes
from radarsim.report.drawing import Figure, reworded
from radarsim.report.page_figure import DrawnFigure
from radarsim.report.wording import estimate, spoken
from radarsim.studies.interface import Study
from radarsim.studies.registry import quantities, study

if TYPE_CHECKING:
    import pandas as pd


MOST_ROWS = 40  # shown in a notebook


class Result(Shown):
    """A finished experiment: cases, tables (pandas) and figures (Matplotlib). It writes nothing unless `write` is
    called.

    written: the files of the last call of `write`; None before the first."""

    def __init__(self, experiment: Experiment, cases: Sequence[CaseResult], facts: Mapping[str, Any]):
        self.experiment, self.facts = experiment, dict(facts)
        self.cases: tuple[CaseResult, ...] = Several(cases)
        self.written: Written | None = None

    def _said(self) -> Sequence[str]:
        """The experiment, then the answer."""
        cases = plural("{count} case", "{count} cases", len(self.cases))
        told = {"cases": cases, "realisations": files.in_all([case.count for case in self.cases])}
        return (tr("{config}: {cases}, {realisations}", config=self._label, **told), *self.answer)

    @property
    def _label(self) -> str:
        return self.experiment.stem

    @property
    def _html(self) -> Sequence[str]:
        """Question, answer, realisations; below the figure σ and gain at the last scan; text escaped."""
        from html import escape

        shown = ("case", "filter", "component", "unit", "t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")
        columns = [*shown, *(name for name in ("gain_percent", "gain_lo", "gain_hi") if len(self.gains))]
        rows = self.last_scan[columns].dropna(axis=1, how="all")
        table = rows.to_html(index=False, border=0, float_format=lambda v: f"{v:.4g}", na_rep="", max_rows=MOST_ROWS)
        answer = "".join(f"<p>{escape(line)}</p>" for line in self.answer)
        count = escape(files.in_all([case.count for case in self.cases]))
        return f"<h4>{escape(self.question)}</h4>{answer}<p>{count}; {tr('95 % intervals')}.</p>", table

    @property
    def question(self) -> str:
        """The experiment's question, in one sentence."""
        return asked(self.experiment)

    @cached_property
    def answer(self) -> tuple[str, ...]:
        """Sentences with numbers and 95 % intervals.

        >>> import radarsim
        >>> radarsim.run("rls2", realisations=2000).answer[0].split(":")[0]
        'Range'
        """
        return answered(self.cases, self._tables)

    @property
    def tables(self) -> dict:
        """Every table by the stem of its file: `curves`, `gains`, `claims`, and the study's own.

        They are copies, like `curves` and `gains`: `write` always writes the numbers of the run.

        >>> import radarsim
        >>> sorted(radarsim.run("rls2", realisations=2000).tables)
        ['believed', 'claims', 'consistency', 'curves', 'floor', 'gains', 'radar', 'steady']
        """
        return {name: table.copy() for name, table in self._tables.items()}

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
        return self._tables["curves"].copy()

    @property
    def gains(self) -> "pd.DataFrame":
        """Gains against the baseline filter: a DataFrame with the columns of gains.csv."""
        return self._tables["gains"].copy()

    @property
    def last_scan(self) -> "pd.DataFrame":
        """The rows of curves at the last scan of each case, filter and component, joined with those of gains.

        `note` warns where σ's interval is unreliable, `gain_note` where the gain's is; each column exists only if
        needed."""
        keys = ["case", "filter", "component"]
        last = self.curves.groupby(keys, sort=False).tail(1)
        gains = against_first({"gains": self.gains}, self.cases)["gains"]
        gains = gains.groupby(keys, sort=False).tail(1).rename(columns={"note": "gain_note"})
        return last.merge(gains, on=[*keys, "k", "t_s"], how="left")

    @cached_property
    def _described(self) -> "dict[str, Figure]":

        return case_figures(self.cases, self._tables, self.experiment)

    def write(
        self, out: str | os.PathLike[str], figures: bool | str | Sequence[str] = True, width_mm: float | None = None
    ) -> "Written":
        """Write tables, figures, claims, run.json and report.html into out/<stem>/, and update out/index.html.

        figures may name the formats of their files: svg, png, pdf; width_mm overrides their width. Returns the files
        written. Raises DisagreementError, after writing, if there are `faults`."""
        from radarsim.report import html

        configs.check(out=out, figures=figures, width_mm=width_mm)
        folder = Path(out) / self.experiment.stem
        self._tables["claims"] = over_readings(self._tables["claims"], self.experiment.study, Path(out))
        formats = configs.formats(figures)
        self.facts["warnings"] = [*self.facts["warnings"], *files.replaced(folder, self.experiment)]
        facts = self.facts | {"finished": datetime.now(UTC).isoformat("T", "seconds")}
        facts["warnings"] = [*self.faults, *facts["warnings"]]
        write = partial(write_files, draw=bool(formats), formats=formats, width_mm=width_mm)
        self.written = write(self.experiment, self.cases, folder, facts, made=self.tables)
        html.write_index(Path(out))
        self.check()
        return self.written

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """Differences between exact and measured values that chance does not explain, a line for each."""
        own, made = study(self.experiment.study), self._tables
        nearly = [case.name for case in self.experiment.cases if own.exact_but_for(case)]
        bounds = ("claims",) if own.exact_errors else ("claims", "curves", "gains")
        return (
            *notes.faults(made, nearly, bounds, quantities(own.name, self.cases[0].spec)),
            *claims.errors(made["claims"]),
        )

    def check(self) -> None:
        """Raises DisagreementError if there are `faults`, or MeasureError if the measure of a claim failed."""
        if self.faults:
            error = DisagreementError(*self.faults)
            error.result = self
            raise error
        if failed := claims.failed(self._tables["claims"]):
            unmeasured = MeasureError(*failed)
            unmeasured.result = self
            raise unmeasured

    def verdicts(self, column: str = "class") -> dict[str, list[str]]:
        """The claims by class over all readings that their papers allow, or `as_shipped`; empty if there are none.
        Extensions are listed separately."""
        found: dict[str, list[str]] = {}
        grouped = page.grouped(self._tables["claims"].to_dict("records"))
        for parts in sorted(grouped, key=lambda parts: page.ORDER.index(parts[0][column])):
            said = parts[0][column] + (", extension" if page.extension(parts) else "")
            found.setdefault(said, []).append(parts[0]["claim"])
        return found

    def unjudged(self) -> dict[str, list[str]]:
        """Claims of this config that it no longer judges, or not in every part, by reason."""
        table = self._tables["claims"]
        found: dict[str, list[str]] = {}
        for row in table[table["verdict"] == claims.NOT_JUDGED].to_dict("records"):
            names = found.setdefault(row["why"], [])
            if row["claim"] not in names:
                names.append(row["claim"])
        return found

    def as_shipped(self) -> list[str]:
        """Claims judged only under the shipped reading although they depend on an open choice of their paper."""
        rows = claims.first_rows(self._tables["claims"].to_dict("records"))
        return [row["claim"] for row in rows if page.alone(row)]

    @property
    def unmet(self) -> list[str]:
        """The targets of precision or time that the run did not reach, a text for each."""
        return list(self.facts.get("unmet", ()))

    @property
    def warnings(self) -> list[str]:
        """Warnings on the numbers: faults, damaged or mixed blocks, too few realisations."""
        return [*self.faults, *self.facts["warnings"], *self._of_intervals]

    @cached_property
    def _of_intervals(self) -> Sequence[str]:
        if self.written is not None:
            return self.written.of_intervals
        return of_intervals(self.cases, self._tables)


# ---- output ----------------------------------------------------------------------------------------------------------
def case_tables(results: Sequence[CaseResult], stem: str = "") -> dict:
    """All tables of an experiment by the stem of their file: curves, gains, the study's own, claims. A study whose
    errors are not of all realisations at common scans makes its own curves and gains. stem is the shipped config's: all
    its claims are in the table, also those that it can no longer judge."""
    of = study(results[0].study)
    made, from_outside = measured(results), outside.measured(results)
    verdicts = claims.judged(of.claims(), results, outside.for_claims(made, from_outside), configs.shipped, stem)
    made["claims"] = over_readings(verdicts, results[0].study)
    made["floor"] = of.floors(results)
    made = notes.noted(made, results, of.exact_errors, quantities(results[0].study, results[0].spec))
    return outside.added(made, results, from_outside)


def over_readings(verdicts: "pd.DataFrame", name: str, out: Path | None = None) -> "pd.DataFrame":
    """claims.csv of a study with the classes over all readings: those under `out`, else the shipped ones."""
    of = study(name)
    readings, papers = of.readings(), of.claims()
    if readings is None or papers is None or not len(verdicts):
        return verdicts
    own: Any = verdicts.to_dict("records")
    rows = with_classes(own, classes_of([(readings, papers)], out))
    return verdicts.assign(**{column: [row[column] for row in rows] for column in OVER})


def measured(results: Sequence[CaseResult]) -> dict:
    """The measured tables alone: curves, gains, and the study's own."""
    own = study(results[0].study).tables(results)
    shared = {"curves": common.curves, "gains": common.gains}
    made = {name: own[name] if name in own else table(results) for name, table in shared.items()} | own
    if any(result.against for result in results):
        made["gains"] = _against_all(results, lambda one: measured([one])["gains"])
    return made


def gains_of(own: Study) -> "Callable[[Sequence[CaseResult]], pd.DataFrame]":
    """The gains alone of a study's results, against all their baselines."""

    def made(results: Sequence[CaseResult]) -> "pd.DataFrame":
        several = any(result.against for result in results)
        return _against_all(results, lambda one: own.gains([one])) if several else own.gains(results)

    return made


def _against_all(results: Sequence[CaseResult], gains: "Callable[[CaseResult], pd.DataFrame]") -> "pd.DataFrame":
    """The gains of each case against its first baseline, then against the others."""
    every = [replace(one, against=()) for result in results for one in (result, *result.against)]
    return common.below([gains(one) for one in every])


def against_first(made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]) -> Mapping[str, "pd.DataFrame"]:
    """The tables with gains against the first baseline of each case only."""
    if not any(result.against or result.outside for result in results):
        return made
    return {**made, "gains": common.against_own(made["gains"], results)}


MOST_FURTHER = 6  # sentences on further baselines


def answered(results: Sequence[CaseResult], made: Mapping[str, "pd.DataFrame"]) -> tuple[str, ...]:
    """The answer of an experiment: the study's, and the gains at the last scan against further baselines."""
    more = [tr("Further gains are in gains.csv.")] if any(one.against for one in results) else []
    names = names_in(results)
    return (*(called(sentence, names) for part in answers(results) for sentence in part(made)), *more)


def asked(experiment: Experiment) -> str:
    """The question of an experiment, in one sentence."""
    question = outside.question(experiment) or study(experiment.study).question(experiment)
    return called(question, names_in(experiment.cases))


def answers(results: Sequence[CaseResult]) -> "list[notes.Answer]":
    """Functions that make the answer from the tables: the study's own, and for each further baseline."""
    own = study(results[0].study)
    further = [partial(_gained, one) for result in results for one in result.against]
    return [
        *outside.answers(results),
        lambda made: own.answer(results, against_first(outside.without(made, results), results)),
        *further[:MOST_FURTHER],
    ]


def of_intervals(results: Sequence[CaseResult], made: Mapping[str, "pd.DataFrame"]) -> list[str]:
    """Warnings on the intervals in the answer."""
    names = names_in(results)
    return [called(line, names) for line in notes.of_intervals(results, made, answers(results))]


def names_in(cases: Iterable[Case | CaseResult]) -> frozenset[str]:
    """Words for names and values of the configs; none where names are used as they stand."""
    if current() == ENGLISH:
        return frozenset()
    found: set[str] = set()
    for case in cases:
        found |= {case.name, case.name.partition(" ")[0]}
        found.update(re.findall(r"'([^']+)'", f"{case.spec.model_dump()}{case.swept}"))
    return frozenset(name for one in found for name in (one, one.replace("_", " ")) if name)


def _gained(result: CaseResult, made: Mapping[str, "pd.DataFrame"]) -> list[str]:
    """The gain of each filter in the first component against the baseline of a result, at the last scan of both."""
    gains = common.against_own(made["gains"], [result])
    last = gains[gains["component"].eq(gains["component"].iloc[0])] if len(gains) else gains
    last = last.groupby("filter", sort=False).tail(1)
    keys = ("gain_percent", "gain_lo", "gain_hi")
    each = [f"{row['filter']} {estimate((row[key] for key in keys), '%', '.3g')}" for row in last.to_dict("records")]
    if not each:
        return []
    told = {"case": result.name, "base": result.baseline, "component": last["component"].iloc[0]}
    told |= {"t": f"{last['t_s'].max():g}", "filters": "; ".join(each)}
    return [tr("{case}, gain in {component} against {base} at {t} s: {filters}.", **told)]


FEW_CLAIMS = 3  # whose verdicts are clearer than a figure


def case_figures(
    results: Sequence[CaseResult], made: Mapping[str, "pd.DataFrame"], experiment: Experiment
) -> dict[str, Figure]:
    """All figures of an experiment, described, by the stem of their file: the study's own, and of sweeps.

    The config may select fewer: `Experiment.drawn`."""
    own = study(results[0].study)
    banded = _banded(made)
    alone = outside.without(banded, results)
    drawn = dict(own.figures(results, against_first(alone, results), experiment))
    for n in range(max(len(result.against) for result in results)):
        others = [result.against[n] for result in results if len(result.against) > n]
        found = own.figures(others, {**alone, "gains": common.against_own(alone["gains"], others)}, experiment)
        drawn |= {f"{name}_{n + 2}": figure for name, figure in found.items() if name.startswith("gain_")}
    of_outside = outside.figures(results, banded, experiment, drawn, own.shown())  # first: the answer is about them
    drawn = of_outside | {name: figure for name, figure in drawn.items() if name not in of_outside}
    if made["claims"]["claim"].nunique() > FEW_CLAIMS and (judged := page.figure(made["claims"].to_dict("records"))):
        drawn["claims"] = judged
    if not own.draws_sweeps:
        from radarsim.report import sweeps

        curves = common.groups(banded["curves"], "case", "filter", "component")
        drawn |= sweeps.figures(outside.joined(results), curves)
    if any(notes.heavy(made[name]).any() for name in ("curves", "gains")):
        drawn = {name: panels.unbanded(figure) for name, figure in drawn.items()}
    names = names_in(results)
    said = {name: reworded(seen.crossed(figure), partial(called, names=names)) for name, figure in drawn.items()}
    return {name: panels.joined(figure) for name, figure in said.items()}


def _banded(made: Mapping[str, "pd.DataFrame"]) -> Mapping[str, "pd.DataFrame"]:
    """The tables for figures: σ and gains without an interval where theirs is marked."""
    thinned = {}
    for name, ends in (("curves", ("sigma_lo", "sigma_hi")), ("gains", ("gain_lo", "gain_hi"))):
        table = made[name]
        if (thin := notes.heavy(table)).any():
            thinned[name] = table.assign(**{end: table[end].mask(thin) for end in ends})
    return {**made, **thinned}


@dataclass(frozen=True)
class Written:
    """Output of `write_files`: the folder, its files by their path in it, the tables, and the sentences of the answer.

    removed: files of an earlier run that this one did not write. seconds: of drawing, and of writing with the report.
    of_intervals: warnings on the intervals in the answer."""

    folder: Path
    files: tuple[str, ...]
    removed: tuple[str, ...]
    tables: Mapping[str, "pd.DataFrame"] = field(repr=False)
    answer: tuple[str, ...]
    seconds: Mapping[str, float]
    of_intervals: tuple[str, ...]


ALWAYS = ("curves", "gains")  # tables written even without a row; others only if they have rows


def write_files(
    experiment: Experiment,
    results: Sequence[CaseResult],
    folder: Path,
    run: Mapping[str, Any],
    *,
    draw: bool = True,
    made: "Mapping[str, pd.DataFrame] | None" = None,
    formats: Sequence[str] = ("svg",),
    width_mm: float | None = None,
) -> Written:
    """Write all outputs of an experiment into folder; each file completely or not at all.

    run: the facts of the run for run.json, see provenance.record; made: the tables, if at hand; formats: those of the
    figures' files; width_mm overrides their width. Outputs of an earlier run that this one does not write (figures
    without `draw`) are removed, so that nothing stale remains. Where figures or words of a package's study fail, only
    the tables are written."""
    from radarsim.report import html

    made = case_tables(results, configs.shipped_stem(experiment)) if made is None else made
    contents = {f"{name}.csv": common.to_csv(table) for name, table in made.items() if len(table) or name in ALWAYS}
    own, began = study(experiment.study), time.perf_counter()
    try:
        described = case_figures(results, made, experiment) if draw else {}
        foremost = [*described][:1] if any(result.outside for result in results) else []  # the answer is about it
        described = {name: described[name] for name in dict.fromkeys([*foremost, *experiment.drawn(described)])}
        answer = answered(results, made)
        for name in [*described][:1]:
            described[name] = replace(described[name], headline=html.headline(answer))
        question = asked(experiment)
    except RadarsimError:
        raise
    except OF_AUTHORS:  # in a package's figures or words, on which the tables do not depend
        files.replace_all(folder, contents, stale=files.outputs)
        raise
    drawings: list[DrawnFigure] = []
    if draw:
        from radarsim.report import figures  # Matplotlib

        made_by = f"radarsim {files.versions()['radarsim']}, {experiment.stem}, config {files.asked(experiment)}"
        drawings = [figures.draw(figure, formats, width_mm, made_by) for figure in described.values()]
        for name, drawing in zip(described, drawings, strict=True):
            contents |= {f"figures/{name}.{kind}": data for kind, data in drawing.files.items()}
        contents["figures/captions.md"] = captions(described).encode()
    drawn = time.perf_counter()
    warned = of_intervals(results, made)
    run = {**run, "warnings": [*run.get("warnings", ()), *warned, *unnamed(own, described)]}
    record = files.record(experiment, results, run, contents, answer, machine_facts())
    report = html.report_page(
        experiment,
        made,
        drawings,
        record,
        answer,
        question,
        inputs=own.inputs(results),
        cost=own.cost(outside.without(made, results), run),
        agreement=notes.agreement(made["curves"]) if own.exact_errors else None,
        drawn_from=own.drawn_from(),
        readings=own.readings(),
    )
    contents["report.html"] = report.encode()
    contents["run.json"] = files.to_json(files.with_output(record, "report.html", contents["report.html"]))
    removed = sorted(set(files.outputs(folder)) - set(contents))
    files.replace_all(folder, contents, stale=files.outputs)
    seconds = {"drawing": drawn - began, "writing": time.perf_counter() - drawn}
    return Written(folder, tuple(sorted(contents)), tuple(removed), made, answer, seconds, tuple(warned))


def unnamed(own: Study, described: Iterable[str]) -> list[str]:
    """A line on figures that are not among those that the study's keys name, if any. A figure drawn several times has a
    suffix: `gain_r_2`."""
    known = own.keys().figure_names
    if known is None:
        return []
    every = (*known, *DRAWN_FOR_ALL)
    found = [name for name in described if not any(matches(name, one) or name.startswith(f"{one}_") for one in every)]
    names = ", ".join(found)
    return [f"study {own.name}: draws {names}, which its `figure_names` lacks: {', '.join(known)}"] if found else []


def captions(described: Mapping[str, Figure]) -> str:
    """The captions of figures as Markdown: their content, then how they are drawn."""
    parts = []
    for name, one in described.items():
        own = f"**{spoken(one.title)}.** {spoken(one.caption)}\n"
        parts.append("\n\n".join(filter(None, (f"## {name}", one.headline, own))))
    return "\n".join([f"# {tr('Captions')}\n", *parts])
