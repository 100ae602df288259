"""Tables, answers and figures of a result, from the results of its cases."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from radarsim.config.experiment import COMMON_FIGURES, Case, Experiment, matches_pattern
from radarsim.engine.results import CaseResult
from radarsim.extensions import extension_figures, extensions
from radarsim.language.current import ENGLISH, current_language
from radarsim.language.translate import quote_name, tr, translate_names
from radarsim.report import (
    answer_warnings,
    caption_remarks,
    coinciding_lines,
    compared_value,
    exact_marks,
    gain_sentences,
    interval_notes,
    sentences,
)
from radarsim.report import tables as common
from radarsim.report.drawing.model import Figure, reworded
from radarsim.report.math_text import plain_text
from radarsim.report.page_sentences import split_long_sentence
from radarsim.report.quantities import GAIN
from radarsim.report.sentences import Sentence
from radarsim.report.user_filters import rows as user_filters_rows
from radarsim.studies.floors import floor_columns
from radarsim.studies.interface import Study
from radarsim.studies.registry import quantities, study

if TYPE_CHECKING:
    import pandas as pd


def case_tables(results: Sequence[CaseResult], stem: str = "") -> dict:
    """All tables of an experiment by the stem of their file: curves, gains, the study's own, those of extensions.

    A study whose errors are not of all realisations at common scans makes its own curves and gains. stem: that of the
    shipped config, whose claims are all in their table, even those that can no longer be judged."""
    case_study = study(results[0].study)
    tables_by_name, user_rows = measured_tables(results), _user_filter_rows(results)
    for extension in extensions():
        tables_by_name |= extension.tables(results, tables_by_name, user_rows, stem)
    tables_by_name = interval_notes.add_notes(
        tables_by_name, results, case_study.exact_errors, quantities(results[0].study, results[0].spec)
    )
    if user_rows:
        from radarsim.report.user_filters import tables as user_filters_tables

        tables_by_name = user_filters_tables.with_user_filters(tables_by_name, results, user_rows)
    tables_by_name["curves"] = floor_columns.with_floors(tables_by_name["curves"], case_study.floors(results))
    return tables_by_name


def _user_filter_rows(results: Sequence[CaseResult]) -> "Mapping[str, pd.DataFrame]":
    """The measured tables of user filters; none where there are no such filters."""
    if not _has_user_filters(results):
        return {}
    from radarsim.report.user_filters import tables as user_filters_tables

    return user_filters_tables.measured_rows(results)


def _has_user_filters(results: Iterable[Case | CaseResult]) -> bool:
    return any(result.user_filters for result in results)


def measured_tables(results: Sequence[CaseResult]) -> dict:
    """The measured tables: curves, gains, and the study's own."""
    study_tables = study(results[0].study).tables(results)
    shared = {"curves": common.curves, "gains": common.gains}
    tables_by_name = {
        name: study_tables[name] if name in study_tables else table(results) for name, table in shared.items()
    } | study_tables
    if any(result.further_baselines for result in results):
        tables_by_name["gains"] = _against_all(results, lambda result: measured_tables([result])["gains"])
    return tables_by_name


def gains_table(case_study: Study) -> "Callable[[Sequence[CaseResult]], pd.DataFrame]":
    """The function that makes only the gains table of a study's results, against all their baselines."""

    def gains(results: Sequence[CaseResult]) -> "pd.DataFrame":
        if any(result.further_baselines for result in results):
            return _against_all(results, lambda result: case_study.gains([result]))
        return case_study.gains(results)

    return gains


def _against_all(results: Sequence[CaseResult], gains: "Callable[[CaseResult], pd.DataFrame]") -> "pd.DataFrame":
    """The gains of each case against its first baseline, then against the others."""
    baseline_results = [
        replace(against, further_baselines=()) for result in results for against in (result, *result.further_baselines)
    ]
    return common.stack_tables([gains(result) for result in baseline_results])


def with_first_baseline(
    tables_by_name: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> Mapping[str, "pd.DataFrame"]:
    """The tables with gains against the first baseline of each case only."""
    if not any(result.further_baselines or result.user_filters for result in results):
        return tables_by_name
    return {**tables_by_name, "gains": common.gains_against_baselines(tables_by_name["gains"], results)}


MAX_BASELINE_SENTENCES = 6  # on baselines after the first


class Answer(NamedTuple):
    """The answer of an experiment: its sentences, and warnings on the intervals that they rest on.

    marked_texts: the sentences with a mark behind each exact value (`report.exact_marks`); main_count: how many of
    them, which come first, `radarsim judge` prints; sources: what each rests on, as `Sentence.sources`."""

    marked_texts: tuple[str, ...]
    warnings: tuple[str, ...]
    main_count: int
    sources: tuple[tuple[str, ...], ...]

    @property
    def texts(self) -> tuple[str, ...]:
        """The sentences as readers see them."""
        return tuple(map(exact_marks.without_marks, self.marked_texts))


def make_answer(results: Sequence[CaseResult], tables_by_name: Mapping[str, "pd.DataFrame"]) -> Answer:
    """The answer of an experiment: on user filters, of its study, gains against further baselines, and last how
    exact values are told from simulated ones."""
    with exact_marks.marking():
        return _marked_answer(results, tables_by_name)


def _marked_answer(results: Sequence[CaseResult], tables_by_name: Mapping[str, "pd.DataFrame"]) -> Answer:
    study_tables = with_first_baseline(user_filters_rows.without_user_filters(tables_by_name, results), results)
    further_baselines = [gain for result in results for gain in result.further_baselines]
    names = config_names(results)
    main, details = (
        _short_sentences(long_sentences, names) for long_sentences in _user_filter_answer(results, tables_by_name)
    )
    of_study = [
        *(
            sentences.as_sentence(sentence, study_tables)
            for sentence in study(results[0].study).answer(results, study_tables)
        ),
        *(
            sentence
            for baseline in further_baselines[:MAX_BASELINE_SENTENCES]
            for sentence in _gains_against(baseline, tables_by_name)
        ),
    ]
    answer = [*main, *details, *_short_sentences(of_study, names)]
    warnings = [
        translate_names(line, names) for line in answer_warnings.answer_warnings(results, tables_by_name, answer)
    ]
    if further_baselines:
        answer.append(Sentence(tr("Further gains are in gains.csv.")))
    if convention := exact_marks.convention(sentence.text for sentence in answer):
        answer.append(Sentence(convention))
    texts, sources = [sentence.text for sentence in answer], [sentence.sources for sentence in answer]
    return Answer(tuple(texts), tuple(warnings), len(main), tuple(sources))


def _short_sentences(long_sentences: Iterable[Sentence], names: frozenset[str]) -> list[Sentence]:
    """The sentences with names in the language in use, the long ones split."""
    return [
        sentence.with_text(part)
        for sentence in long_sentences
        for part in split_long_sentence(translate_names(sentence.text, names))
    ]


def question_text(experiment: Experiment) -> str:
    """The question of an experiment, in one sentence."""
    if _has_user_filters(experiment.cases):
        from radarsim.report.user_filters import answer as user_filters_answer

        question = user_filters_answer.question(experiment)
    else:
        question = study(experiment.study).question(experiment)
    return translate_names(question, config_names(experiment.cases))


def _user_filter_answer(
    results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> tuple[Sequence[Sentence], Sequence[Sentence]]:
    """How user filters compare with the config's, and more of them; nothing where there are none."""
    if not _has_user_filters(results):
        return (), ()
    from radarsim.report.user_filters import answer as user_filters_answer

    return user_filters_answer.judgement(results, tables_by_name)


def config_names(cases: Iterable[Case | CaseResult]) -> frozenset[str]:
    """Names in configs that sentences translate; none in English, which uses them as they stand."""
    if current_language() == ENGLISH:
        return frozenset()
    words: set[str] = set()
    for case in cases:
        words |= {case.name, case.name.partition(" ")[0]}
        words.update(re.findall(r"'([^']+)'", f"{case.spec.model_dump()}{case.swept_values}"))
    return frozenset(name for word in words for name in (word, word.replace("_", " ")) if name)


def _gains_against(result: CaseResult, tables_by_name: Mapping[str, "pd.DataFrame"]) -> list[Sentence]:
    """The gain of each filter in the first component against the baseline of a result, at the last scan of both."""
    gains = common.gains_against_baselines(tables_by_name["gains"], [result])
    last = gains[gains["component"].eq(gains["component"].iloc[0])] if len(gains) else gains
    last = last.groupby("filter", sort=False).tail(1)
    if not len(last):
        return []
    gains_by_filter = [(row["filter"], compared_value.row_value(row, GAIN)) for _, row in last.iterrows()]
    texts = [f"{quote_name(name)} {gain_sentences.percent_text(gain, result.count)}" for name, gain in gains_by_filter]
    text = tr(
        "{case}, gain in {component} over {base} at {t} s: {filters}.",
        case=result.name,
        base=quote_name(result.baseline),
        component=last["component"].iloc[0],
        t=f"{last['t_s'].max():g}",
        filters="; ".join(texts),
    )
    return [Sentence(text, tuple(interval for _, gain in gains_by_filter for interval in gain.intervals))]


def case_figures(
    results: Sequence[CaseResult], tables_by_name: Mapping[str, "pd.DataFrame"], experiment: Experiment
) -> dict[str, Figure]:
    """All figures of an experiment, described, by the stem of their file: the study's own, and of sweeps.

    The config may select fewer: `Experiment.selected_figures`."""
    case_study = study(results[0].study)
    figure_tables = interval_notes.without_noted_intervals(tables_by_name)
    figures_by_name = _study_figures(
        results, user_filters_rows.without_user_filters(figure_tables, results), experiment
    )
    drawn_results = results
    if _has_user_filters(results):
        from radarsim.report.user_filters import figures as user_filters_figures

        drawn_results = user_filters_figures.with_user_filters_in_cases(results)
        user_figures = user_filters_figures.figures(
            results, figure_tables, experiment, figures_by_name, case_study.user_filter_components()
        )
        figures_by_name = user_figures | {  # those of user filters first: the answer is about them
            name: figure for name, figure in figures_by_name.items() if name not in user_figures
        }
    for extension in extensions():
        figures_by_name |= extension.figures(tables_by_name)
    if not case_study.draws_sweeps:
        from radarsim.report import sweep_figures

        curves = common.group_by(figure_tables["curves"], "case", "filter", "component")
        figures_by_name |= sweep_figures.sweep_figures(drawn_results, curves)
    translate = partial(translate_names, names=config_names(results))
    return {
        name: coinciding_lines.join_coinciding_lines(
            reworded(caption_remarks.with_meaning_of_crosses(figure), translate)
        )
        for name, figure in figures_by_name.items()
    }


def _study_figures(
    results: Sequence[CaseResult], study_tables: Mapping[str, "pd.DataFrame"], experiment: Experiment
) -> dict[str, Figure]:
    """The figures of a study; those of gains against each further baseline get its number: `gain_r_2`."""
    case_study = study(results[0].study)
    figures_by_name = dict(case_study.figures(results, with_first_baseline(study_tables, results), experiment))
    for n in range(max(len(result.further_baselines) for result in results)):
        baseline_results = [result.further_baselines[n] for result in results if len(result.further_baselines) > n]
        gains = common.gains_against_baselines(study_tables["gains"], baseline_results)
        baseline_figures = case_study.figures(baseline_results, {**study_tables, "gains": gains}, experiment)
        figures_by_name |= {
            f"{name}_{n + 2}": figure for name, figure in baseline_figures.items() if name.startswith("gain_")
        }
    return figures_by_name


def undeclared_figures(case_study: Study, described: Iterable[str]) -> list[str]:
    """A line on figures that the study's keys do not name, if any; one drawn several times has a suffix: `gain_r_2`."""
    declared = case_study.keys().figure_names
    if declared is None:
        return []
    allowed = (*declared, *extension_figures(), *COMMON_FIGURES)
    undeclared = [
        name
        for name in described
        if not any(matches_pattern(name, pattern) or name.startswith(f"{pattern}_") for pattern in allowed)
    ]
    if not undeclared:
        return []
    names = ", ".join(undeclared)
    return [f"study {case_study.name}: draws {names}, which its `figure_names` lacks: {', '.join(declared)}"]


def captions(figures_by_name: Mapping[str, Figure]) -> str:
    """The captions of figures as Markdown: their content, then how they are drawn."""
    parts = []
    for name, figure in figures_by_name.items():
        caption = f"**{plain_text(figure.title)}.** {plain_text(figure.caption)}\n"
        headline = "" if figure.headline == plain_text(figure.title) else figure.headline
        parts.append("\n\n".join(filter(None, (f"## {name}", headline, caption))))
    shared = caption_remarks.conventions(figures_by_name.values())
    return "\n".join([f"# {tr('Captions')}\n", *([f"{shared}\n"] if shared else []), *parts])
