"""Which cases a figure or an answer shows, how they are grouped into panels, and remarks on the others."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.translate import plural, tr
from radarsim.report.drawing.model import MAX_PANEL_LINES
from radarsim.report.key_labels import (
    config_device,
    config_stem,
    key_symbol,
    plain_case_label,
    swept_description,
    swept_title,
    titled_value,
    value_with_unit,
    without_markup,
)

MAX_CASES = 8  # cases of a panel; the others are named in its caption
MAX_PANELS = 12
MAX_MISSING_NAMES = 8  # names of what a figure leaves out
FEW_FILTERS = 3  # distinguished by dash, while shades distinguish the cases


def after_swept_values(result: CaseResult, sentence: str) -> str:
    """A sentence on a case, preceded by its swept values where there are several.

    What a list is of (`RMS error: least with a; largest with b`) belongs to each of its parts, with these values."""
    return after_case_name(without_markup(swept_description(result)), sentence)


def after_case_name(name: str, sentence: str) -> str:
    """A sentence on a case, preceded by the case's name, as `after_swept_values` by its values; unchanged without one.

    >>> after_case_name("D = 15 m/s", "RMS error: least with a; largest with b")
    'D = 15 m/s, RMS error: least with a; largest with b'
    >>> after_case_name("RLS 4", "Least RMS error: a, 15 m"), after_case_name("RLS 4", "a is best")
    ('RLS 4, least RMS error: a, 15 m', 'RLS 4: a is best')
    """
    if not name or ": " not in sentence:
        return f"{name}: {sentence}" if name else sentence
    first = sentence[0].lower() if sentence[1].islower() else sentence[0]
    return f"{name}, {first}{sentence[1:]}"


def select_reported(results: Sequence[CaseResult], max_cases: int = 3) -> tuple[list[CaseResult], list[str]]:
    """The cases that an answer reports: all, or the first and last of more than so many; and words on the others."""
    if len(results) <= max_cases:
        return list(results), []
    remark = plural("The other case is in the tables.", "The other {count} cases are in the tables.", len(results) - 2)
    return [results[0], results[-1]], [remark]


def swept_cases(results: Sequence[CaseResult]) -> list[str]:
    """How sentences name each of several swept cases (`after_swept_values`); none of a single one."""
    if len(results) < 2:
        return []
    return [without_markup(swept_description(result)) for result in results if result.swept_values]


def swept_keys(results: Sequence[CaseResult]) -> dict[str, set[str]]:
    """The keys in which cases differ, as sentences and figures name them, each with its values in all unswept cases."""
    keys = list(dict.fromkeys(key for result in results for key, _ in result.swept_values))
    unswept = [result for result in results if not result.swept_values]
    texts: dict[str, set[str]] = {}
    for key in keys:
        twins = [_twin_values(result, key, results) for result in unswept]
        name = next(key_symbol(result, key) for result in results if key in dict(result.swept_values))
        texts.setdefault(without_markup(name), set()).update(set.intersection(*twins) if twins else set())
    return texts


def _twin_values(unswept: CaseResult, key: str, results: Sequence[CaseResult]) -> set[str]:
    """The values of a key, in words, of swept cases that are in all else as an unswept one."""
    values = [(result, dict(result.swept_values)) for result in results if result.spec == unswept.spec]
    return {value_with_unit(result, key, swept[key]) for result, swept in values if key in swept}


def group_by_config(results: Sequence[CaseResult]) -> dict[str, list[CaseResult]]:
    """Cases by config, in order: one panel each."""
    groups: dict[str, list[CaseResult]] = {}
    for result in results:
        groups.setdefault(config_stem(result), []).append(result)
    return groups


def group_by_panel(results: Sequence[CaseResult], max_lines: float = MAX_PANEL_LINES) -> dict[str, list[CaseResult]]:
    """Group the cases that share a panel, by the panel's title.

    A panel holds the cases of one config; where several keys are swept, those alike in all but the last. Cases with
    many filters get a panel each if together they would draw more than `max_lines` lines."""
    has_several_families = len(group_by_config(results)) > 1
    groups: dict[tuple[str, str, str], list[CaseResult]] = {}
    for result in results:
        swept_text = ", ".join(titled_value(result, key, value) for key, value in result.swept_values[:-1])
        device_name = config_device(result) if has_several_families or not swept_text else ""
        groups.setdefault((config_stem(result), device_name, swept_text), []).append(result)

    titled: list[tuple[str, list[CaseResult]]] = []
    for (_, *title_parts), members in groups.items():
        line_counts = [len(result.axes.filters) for result in members]
        if sum(line_counts) <= max_lines or max(line_counts) <= FEW_FILTERS or len(members) == 1:
            titled.append((", ".join(filter(None, title_parts)), members))
        else:
            prefix = [config_device(members[0])] if has_several_families else []
            titled += [(", ".join([*prefix, swept_title(result) or result.name]), [result]) for result in members]
    titles_and_stems = [(title, config_stem(members[0])) for title, members in titled]
    return with_distinct_titles(titles_and_stems, [members for _, members in titled])


def with_distinct_titles(titles: Sequence[tuple[str, str]], values: Sequence[Any]) -> dict[str, Any]:
    """Values by their titles; by config and title, the second of each pair first, where a title occurs twice."""
    often = Counter(title for title, _ in titles)
    names = [title if often[title] == 1 else ", ".join(filter(None, (config, title))) for title, config in titles]
    return dict(zip(names, values, strict=True))


def pick_evenly(items: Sequence[Any], max_count: int) -> list[Any]:
    """At most so many of the items, evenly spaced from the first to the last."""
    if len(items) <= max_count:
        return list(items)
    return [items[i] for i in np.linspace(0, len(items) - 1, max_count).round().astype(int)]


def realisations_text(results: Sequence[CaseResult]) -> str:
    """The number of realisations of a figure: "100,000 to 200,000 realisations" where its cases differ."""
    return _of_realisations([result.count for result in results])


def _of_realisations(counts: Sequence[int]) -> str:
    smallest, largest = min(counts), max(counts)
    if smallest == largest:
        return plural("{count:,} realisation", "{count:,} realisations", largest)
    return plural("{least:,} to {count:,} realisations", "{least:,} to {count:,} realisations", largest, least=smallest)


def left_out_remark(all_names: Sequence[str], shown_names: Sequence[str]) -> str:
    """Words on the omissions of a figure, after its caption: how many of how many it shows."""
    missing = [name for name in all_names if name not in shown_names]
    if not missing:
        return ""
    shown = len(all_names) - len(missing)
    return " " + tr("Shown: {count} of {all}; the others are in the tables.", count=shown, all=len(all_names))


def distinct_case_names(results: Sequence[CaseResult]) -> list[str]:
    """Distinct names of cases: by swept values, with the device where there are several."""
    has_several_devices = len(group_by_config(results)) > 1
    names = [
        plain_case_label(result)
        if has_several_devices or not result.swept_values
        else without_markup(swept_description(result))
        for result in results
    ]
    return names if len(set(names)) == len(names) else [result.name for result in results]


def cases_left_out_remark(all_results: Sequence[CaseResult], shown_results: Sequence[CaseResult]) -> str:
    """`left_out` of cases."""
    names = dict(zip((result.name for result in all_results), distinct_case_names(all_results), strict=True))
    return left_out_remark(list(names.values()), [names[result.name] for result in shown_results])


def unswept_cases(results: Sequence[CaseResult]) -> list[CaseResult]:
    """The cases without swept keys, if any; else all."""
    return [result for result in results if not result.swept_values] or list(results)


def cases_for_figure(experiment: Experiment, figure: str) -> list[str]:
    """The cases that a config names for a figure."""
    return [case.name for case in experiment.cases_in_figure(figure)]


def select_cases(results: Sequence[CaseResult], names: Sequence[str]) -> tuple[list[CaseResult], str]:
    """The results in a figure, of the cases named, at most eight evenly spaced; and words on the others."""
    named_results = [result for result in results if result.name in set(names)]
    visible = pick_evenly(named_results, MAX_CASES)
    return visible, cases_left_out_remark(named_results, visible)


def select_cases_by_panel(results: Sequence[CaseResult], names: Sequence[str]) -> tuple[list[CaseResult], str]:
    """The results of a figure with a panel for each of `group_by_panel`: at most twelve panels of at most eight cases.
    If more, evenly spaced ones from the first to the last."""
    named_results = [result for result in results if result.name in set(names)]
    groups = pick_evenly(list(group_by_panel(named_results).values()), MAX_PANELS)
    visible = [result for members in groups for result in pick_evenly(members, MAX_CASES)]
    return visible, cases_left_out_remark(named_results, visible)
