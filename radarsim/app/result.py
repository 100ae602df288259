"""The result of a finished experiment: tables, figures, run.json and report.html, in memory and as files."""

import os
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.app import configs
from radarsim.app.shown import Several, Shown
from radarsim.config.experiment import DRAWN_FOR_ALL, Case, Experiment, matches
from radarsim.engine.machine import machine_facts
from radarsim.engine.results import CaseResult
from radarsim.errors import OF_AUTHORS, DisagreementError, MeasureError, RadarsimError
from radarsim.extensions import extension_figures, extension_tables, extensions
from radarsim.language import ENGLISH, called, current, plural, tr
from radarsim.report import files, notes, outside, panels, seen, sentences
from radarsim.report import tables as common
from radarsim.report.drawing import Figure, reworded
from radarsim.report.page_figure import DrawnFigure
from radarsim.report.row_notes import has_note, with_note_texts
from radarsim.report.sentences import Sentence
from radarsim.report.wording import estimate, spoken
from radarsim.studies import floor
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
        return {name: with_note_texts(table) for name, table in self._tables.items()}

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
        return with_note_texts(self._tables["curves"])

    @property
    def gains(self) -> "pd.DataFrame":
        """Gains against the baseline filter: a DataFrame with the columns of gains.csv."""
        return with_note_texts(self._tables["gains"])

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
        """Write tables, figures, run.json and report.html into out/<stem>/, and update out/index.html.

        figures may name the formats of their files: svg, png, pdf; width_mm overrides their width. Returns the files
        written. Raises DisagreementError, after writing, if there are `faults`."""
        from radarsim.report import html

        configs.check(out=out, figures=figures, width_mm=width_mm)
        folder = Path(out) / self.experiment.stem
        for extension in extensions():
            self._tables.update(extension.updated_tables(self._tables, self.experiment.study, Path(out)))
        formats = configs.formats(figures)
        self.facts["warnings"] = [*self.facts["warnings"], *files.replaced(folder, self.experiment)]
        facts = self.facts | {"finished": datetime.now(UTC).isoformat("T", "seconds")}
        facts["warnings"] = [*self.faults, *facts["warnings"]]
        write = partial(write_files, draw=bool(formats), formats=formats, width_mm=width_mm)
        self.written = write(self.experiment, self.cases, folder, facts, made=self._tables)
        html.write_index(Path(out))
        self.check()
        return self.written

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """Differences between exact and measured values that chance does not explain, a line for each."""
        own, made = study(self.experiment.study), self._tables
        nearly = [case.name for case in self.experiment.cases if own.exact_but_for(case)]
        bounds = (*extension_tables(), *(() if own.exact_errors else ("curves", "gains")))
        return (
            *notes.disagreements(made, nearly, bounds, quantities(own.name, self.cases[0].spec)),
            *(line for extension in extensions() for line in extension.disagreements(made)),
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


# ---- output ----------------------------------------------------------------------------------------------------------
def case_tables(results: Sequence[CaseResult], stem: str = "") -> dict:
    """All tables of an experiment by the stem of their file: curves, gains, the study's own, extensions'. A study whose
    errors are not of all realisations at common scans makes its own curves and gains. stem is the shipped config's: all
    its claims are in the table, also those that it can no longer judge."""
    of = study(results[0].study)
    made, from_outside = measured(results), outside.measured(results)
    for extension in extensions():
        made |= extension.tables(results, made, from_outside, stem)
    made = notes.add_notes(made, results, of.exact_errors, quantities(results[0].study, results[0].spec))
    made = outside.added(made, results, from_outside)
    made["curves"] = floor.with_floors(made["curves"], of.floors(results))
    return made


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


MAX_FURTHER = 6  # sentences on further baselines


class Answer(NamedTuple):
    """The answer of an experiment: its sentences, and warnings on the intervals that they rest on."""

    texts: tuple[str, ...]
    warnings: tuple[str, ...]


def make_answer(results: Sequence[CaseResult], made: Mapping[str, "pd.DataFrame"]) -> Answer:
    """The answer of an experiment: on user filters, of its study, and gains against further baselines."""
    study_tables = against_first(outside.without(made, results), results)
    further = [gain for result in results for gain in result.against]
    answer = [
        *outside.answer(results, made),
        *(
            sentences.as_sentence(sentence, study_tables)
            for sentence in study(results[0].study).answer(results, study_tables)
        ),
        *(sentence for baseline in further[:MAX_FURTHER] for sentence in _gains_against(baseline, made)),
    ]
    names = names_in(results)
    texts = [called(str(sentence), names) for sentence in answer]
    if further:
        texts.append(tr("Further gains are in gains.csv."))
    warnings = [called(line, names) for line in notes.answer_warnings(results, made, answer)]
    return Answer(tuple(texts), tuple(warnings))


def asked(experiment: Experiment) -> str:
    """The question of an experiment, in one sentence."""
    question = outside.question(experiment) or study(experiment.study).question(experiment)
    return called(question, names_in(experiment.cases))


def names_in(cases: Iterable[Case | CaseResult]) -> frozenset[str]:
    """Words for names and values of the configs; none where names are used as they stand."""
    if current() == ENGLISH:
        return frozenset()
    found: set[str] = set()
    for case in cases:
        found |= {case.name, case.name.partition(" ")[0]}
        found.update(re.findall(r"'([^']+)'", f"{case.spec.model_dump()}{case.swept}"))
    return frozenset(name for one in found for name in (one, one.replace("_", " ")) if name)


def _gains_against(result: CaseResult, made: Mapping[str, "pd.DataFrame"]) -> list[Sentence]:
    """The gain of each filter in the first component against the baseline of a result, at the last scan of both."""
    gains = common.against_own(made["gains"], [result])
    last = gains[gains["component"].eq(gains["component"].iloc[0])] if len(gains) else gains
    last = last.groupby("filter", sort=False).tail(1)
    if not len(last):
        return []
    keys = ("gain_percent", "gain_lo", "gain_hi")
    texts = [f"{row['filter']} {estimate((row[key] for key in keys), '%', '.3g')}" for row in last.to_dict("records")]
    text = tr(
        "{case}, gain in {component} against {base} at {t} s: {filters}.",
        case=result.name,
        base=result.baseline,
        component=last["component"].iloc[0],
        t=f"{last['t_s'].max():g}",
        filters="; ".join(texts),
    )
    return [Sentence(text, sentences.intervals("gains", "gain", last))]


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
    for extension in extensions():
        drawn |= extension.figures(made)
    if not own.draws_sweeps:
        from radarsim.report import sweeps

        curves = common.groups(banded["curves"], "case", "filter", "component")
        drawn |= sweeps.figures(outside.joined(results), curves)
    if any(has_note(made[name]).any() for name in ("curves", "gains")):
        drawn = {name: panels.unbanded(figure) for name, figure in drawn.items()}
    names = names_in(results)
    translate = partial(called, names=names)
    return {
        name: panels.joined(reworded(seen.with_meaning_of_crosses(figure), translate)) for name, figure in drawn.items()
    }


def _banded(made: Mapping[str, "pd.DataFrame"]) -> Mapping[str, "pd.DataFrame"]:
    """The tables for figures: σ and gains without an interval where theirs is marked."""
    thinned = {}
    for name, ends in (("curves", ("sigma_lo", "sigma_hi")), ("gains", ("gain_lo", "gain_hi"))):
        table = made[name]
        if (thin := has_note(table)).any():
            thinned[name] = table.assign(**{end: table[end].mask(thin) for end in ends})
    return {**made, **thinned}


@dataclass(frozen=True)
class Written:
    """Output of `write_files`: the folder, its files by their path in it, the tables, and the sentences of the answer.

    removed: files of an earlier run that this one did not write. seconds: of drawing, and of writing with the report.
    answer_warnings: warnings on the intervals that the answer rests on."""

    folder: Path
    files: tuple[str, ...]
    removed: tuple[str, ...]
    tables: Mapping[str, "pd.DataFrame"] = field(repr=False)
    answer: tuple[str, ...]
    seconds: Mapping[str, float]
    answer_warnings: tuple[str, ...]


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
        answer = make_answer(results, made)
        for name in [*described][:1]:
            described[name] = replace(described[name], headline=html.headline(answer.texts))
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
    made = {name: with_note_texts(table) for name, table in made.items()}
    run = {**run, "warnings": [*run.get("warnings", ()), *answer.warnings, *unnamed(own, described)]}
    record = files.record(experiment, results, run, contents, answer.texts, machine_facts())
    report = html.report_page(
        experiment,
        made,
        drawings,
        record,
        answer.texts,
        question,
        inputs=own.inputs(results),
        cost=own.cost(outside.without(made, results), run),
        agreement=notes.agreement(made["curves"]) if own.exact_errors else None,
        drawn_from=own.drawn_from(),
    )
    contents["report.html"] = report.encode()
    contents["run.json"] = files.to_json(files.with_output(record, "report.html", contents["report.html"]))
    removed = sorted(set(files.outputs(folder)) - set(contents))
    files.replace_all(folder, contents, stale=files.outputs)
    seconds = {"drawing": drawn - began, "writing": time.perf_counter() - drawn}
    return Written(folder, tuple(sorted(contents)), tuple(removed), made, answer.texts, seconds, answer.warnings)


def unnamed(own: Study, described: Iterable[str]) -> list[str]:
    """A line on figures that are not among those that the study's keys name, if any. A figure drawn several times has a
    suffix: `gain_r_2`."""
    known = own.keys().figure_names
    if known is None:
        return []
    every = (*known, *extension_figures(), *DRAWN_FOR_ALL)
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
