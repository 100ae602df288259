"""The gain of filters over two swept keys: a figure of maps, and its least and greatest values in sentences."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import quote_name, tr
from radarsim.report import case_selection, compared_value, gain_sentences, key_labels, sentences, sweep_figures, tables
from radarsim.report.drawing.model import Figure, Panel
from radarsim.report.quantities import GAIN, Component

if TYPE_CHECKING:
    import pandas as pd

NAME = "gain_map"


def map_groups(results: Sequence[CaseResult]) -> Iterator[tuple[tuple[str, ...], list[CaseResult]]]:
    """The cases of each config that is swept over two keys, with these."""
    for (_, keys), members in sweep_figures.group_swept_cases(results).items():
        varying = [key for key in keys if len({str(dict(result.swept_values)[key]) for result in members}) > 1]
        if len(keys) == len(varying) == 2:
            yield keys, members


def final_gains(members: Sequence[CaseResult], gains: "pd.DataFrame") -> "pd.DataFrame":
    """The gains of some cases at the last scan."""
    rows = gains[gains["case"].isin([result.name for result in members])]
    return rows[rows["k"] == rows.groupby("case")["k"].transform("max")]


def gain_map_figures(
    results: Sequence[CaseResult], gains: "pd.DataFrame", components: Sequence[Component]
) -> dict[str, Figure]:
    """A figure for each config that is swept over two keys: a map for each filter and component."""
    figures, groups = {}, list(map_groups(results))
    for keys, members in groups:
        panels = _gain_panels(sweep_figures.SweptGrid(keys, members), final_gains(members, gains), components)
        if panels:
            name = f"{NAME}_{key_labels.config_stem(members[0])}" if len(groups) > 1 else NAME
            figures[name] = _figure(name, sweep_figures.SweptGrid(keys, members), panels)
    return figures


def _gain_panels(grid: sweep_figures.SweptGrid, gains: "pd.DataFrame", components: Sequence[Component]) -> list[Panel]:
    """A map for each filter and component, where there are gains."""
    rows, axes, panels = tables.group_by(gains, "case", "filter", "component"), grid.members[0].axes, list[Panel]()
    names = [name for f, name in enumerate(axes.filters) if f != axes.baseline]
    for filter_name in names:
        for component in components:
            words = tr(str(component.words))
            title = f"{key_labels.escape_dollars(filter_name)}: {words}" if len(names) > 1 else words
            values = {
                result.name: _gain_and_half_width(rows.get((result.name, filter_name, component.name)))
                for result in grid.members
            }
            panel = grid.panel(title, tr("gain, %"), values)
            panels += [panel] if panel else []
    return panels


def _gain_and_half_width(rows: "pd.DataFrame | None") -> Sequence[float]:
    """A gain at the last scan with half the width of its interval, per cent; exact ones without."""
    if rows is None:
        return (np.nan,)
    gain = compared_value.row_value(rows.iloc[-1], GAIN)
    return (gain.value,) if gain.is_exact else (gain.value, float(np.ptp(gain.estimate[1:])) / 2)


def _figure(name: str, grid: sweep_figures.SweptGrid, panels: Sequence[Panel]) -> Figure:
    members = grid.members
    axes, (first, second) = members[0].axes, (key_labels.key_label(members[0], key).text for key in grid.keys)
    caption = tr(
        "Gain over {base} in the RMS error at the last scan versus the {first} and the {second}, ± half the width of "
        "its 95 % interval (none where filters are nearly alike), of {realisations} in each cell.",
        base=axes.filters[axes.baseline],
        first=first,
        second=second,
        realisations=case_selection.realisations_text(members),
    )
    shown = panels[: sweep_figures.MOST_PANELS]
    caption += case_selection.left_out_remark([p.title for p in panels], [p.title for p in shown])
    return grid.figure(name, tr("Gain versus {first} and {second}", first=first, second=second), caption, shown)


def gain_map_sentences(
    results: Sequence[CaseResult], gains: "pd.DataFrame", components: Sequence[Component]
) -> list[sentences.Sentence]:
    """For each filter the least and the greatest gain over two swept keys, by component, and where."""
    made = []
    for _, members in map_groups(results):
        rows, axes, where = final_gains(members, gains), members[0].axes, _swept_texts(members)
        for filter_name in dict.fromkeys(rows["filter"]):
            for component in components:
                chosen = tables.select_rows(rows, filter=filter_name, component=component.name)
                if not len(chosen):
                    continue
                (low_row, low), (high_row, high) = (
                    compared_value.extreme(chosen, GAIN, largest=largest) for largest in (False, True)
                )
                text = tr(
                    "Gain of {filter} over {base} in the {quantity} at the last scan: {least} ({where_least}) to "
                    "{greatest} ({where_greatest}){remark}.",
                    filter=quote_name(filter_name),
                    base=quote_name(axes.filters[axes.baseline]),
                    quantity=component.words,
                    least=gain_sentences.number_text(low),
                    where_least=where[low_row["case"]],
                    greatest=gain_sentences.number_text(high),
                    where_greatest=where[high_row["case"]],
                    remark=high.choice_remark(),
                )
                made.append(sentences.Sentence(text, (*low.intervals, *high.intervals)))
    return made


def _swept_texts(members: Sequence[CaseResult]) -> Mapping[str, str]:
    """The swept values of cases, by name."""
    return {result.name: key_labels.without_markup(key_labels.swept_description(result)) for result in members}
