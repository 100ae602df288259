"""Tables of filters with several models of motion (P2).

stage: name of a stage of the flight"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency_tables, interval_notes, statistics
from radarsim.report import tables as report_tables
from radarsim.studies.multimodel import cost as costs
from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.kernels.layout import MERGED, MERGES, NEES, NIS

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.report.row_notes import RowNote
    from radarsim.studies.multimodel.study import FlightAxes

table = report_tables.TableMakers()
FREEDOM = 3  # degrees of freedom of a position's or a plot's normalised error squared


@table("probabilities")
def _probabilities(result: CaseResult) -> report_tables.Columns:
    """How probable a filter takes each of its models to be, by scan.

    model: number of the model, from 1
    probability ±: mean over the realisations
    motion: the model in words
    """
    axes, models = result.axes, [model_bank.model_labels(options.models) for options in result.spec.filters]
    filter_models = [(f, m) for f, labels in enumerate(models) for m in range(len(labels)) if len(labels) > 1]
    scans = len(axes.k)
    f = np.repeat([f for f, _ in filter_models], scans).astype(int)
    m = np.repeat([m for _, m in filter_models], scans).astype(int)
    k = np.tile(np.arange(scans), len(filter_models))
    sums = np.asarray(result.sums["probability"])[f, k, m]
    mean_probability = statistics.probability(sums[:, 0], sums[:, 1], result.count)
    return {
        **report_tables.label_columns(result, f, k, model=m + 1),
        "n": np.full(f.size, result.count),
        "probability": mean_probability,
        "motion": np.array([models[a][b] for a, b in zip(f, m, strict=True)], dtype=object),
    }


def stage_names(result: CaseResult) -> tuple[str, ...]:
    """Names (S,) of the stages of a case, also of those without scans, in the order of the sums."""
    return tuple(stage.name for stage in result.spec.target.stages)


def stage_bounds(result: "CaseResult[FlightAxes]") -> list[tuple[str, float, float]]:
    """Name, begin and end (s) of each stage of a case that has scans."""
    ends = [*result.spec.target.stage_ends_s, float(result.axes.t_s[-1])]
    bounds = zip(stage_names(result), [0.0, *ends[:-1]], ends, strict=True)
    return [bound for bound, count in zip(bounds, result.axes.stage_scans, strict=True) if count > 0]


def stage_sigma(result: CaseResult, f: int, s: int, c: int) -> statistics.Estimate:
    """σ of component c of filter f over stage s: a realisation's mean square over the stage is one observation."""
    square, fourth = np.asarray(result.sums["stage"])[f, s, c]
    return statistics.root_mean_square(square, fourth, result.count)


def stage_gain(result: CaseResult, f: int, base: int, s: int, c: int) -> statistics.Estimate:
    """Paired gain of filter f relative to any other in component c over stage s, %."""
    (a, aa), (b, bb) = (np.asarray(result.sums["stage"])[i, s, c] for i in (f, base))
    return statistics.gain(a, aa, b, bb, np.asarray(result.sums["pairs"])[f, base, s, c], result.count)


def _heavy_note(is_heavy: bool, is_baseline_heavy: bool) -> "RowNote | str":
    """The note on a row whose σ, or whose baseline's σ, few realisations decide; empty for others."""
    if is_heavy:
        return interval_notes.HEAVY_TAILS
    return interval_notes.HEAVY_TAILS.about("gain") if is_baseline_heavy else ""


@table("stages")
def _stages(result: CaseResult) -> report_tables.Columns:
    """σ over each stage of the flight, of all its scans, and the paired gain against the first baseline filter.

    begin_s, end_s: times from which and to which the stage lasts
    """
    rows, axes, b = [], result.axes, result.axes.baseline
    stage_numbers = {name: s for s, name in enumerate(stage_names(result))}
    square, fourth = np.moveaxis(np.asarray(result.sums["stage"]), -1, 0)
    is_heavy = statistics.effective(square, fourth, result.count) < interval_notes.MIN_EFFECTIVE
    no_gain = statistics.Estimate(np.nan, np.nan, np.nan)
    for f, label in enumerate(axes.filters):
        for stage, begin, end in stage_bounds(result):
            for c, (component, unit) in enumerate(axes.components):
                s = stage_numbers[stage]
                row = {
                    **{"case": result.name, "filter": label, "stage": stage, "begin_s": begin, "end_s": end},
                    **{"component": component, "unit": unit, "n": result.count},
                    "sigma": stage_sigma(result, f, s, c),
                    "baseline": axes.filters[b],
                    "gain_percent|gain": stage_gain(result, f, b, s, c) if f != b else no_gain,
                    "note": _heavy_note(is_heavy[f, s, c], is_heavy[b, s, c]),
                }
                rows.append(row)
    return report_tables.columns_from_rows(rows)


@table("consistency")
def _consistency(result: CaseResult) -> report_tables.Columns:
    """NEES of the position by stage, at the reported scans, and NIS of the plots, at all scans.

    The plot against what the hypothesis predicted that was the most probable before it. The bounds, from the spread of
    the realisations, are shared among all filters and stages of a case.
    """
    axes, n = result.axes, result.count
    names = stage_names(result)
    s = np.array([names.index(stage) for stage, *_ in stage_bounds(result)])
    filters = len(axes.filters)
    sums = np.asarray(result.sums["stage"])[:, s].reshape(filters * s.size, -1, 2)
    columns: dict[str, np.ndarray] = {}
    for quantity, mean_index in (("nees", NEES), ("nis", NIS)):
        total, square = sums[:, mean_index, 0] / FREEDOM, sums[:, mean_index, 1] / FREEDOM**2
        bounds = consistency_tables.bounds_from_spread(total, square, n, len(sums))
        means = [statistics.mean_square(*pair, n) for pair in zip(total, square, strict=True)]
        columns |= consistency_tables.normalised_square_columns(
            quantity, statistics.Estimate(*np.transpose(means)), bounds
        )
    return {
        **report_tables.label_columns(
            result, np.repeat(np.arange(filters), s.size), stage=report_tables.pick_names(names, np.tile(s, filters))
        ),
        "n": np.full(len(sums), n),
        **columns,
    }


@table("operations")
def _operations(result: "CaseResult[FlightAxes]") -> report_tables.Columns:
    """Arithmetic operations of one update of one realisation, counted: mean over each stage, and the whole flight.

    family, merge, models: family of the filter, its rule of merging, and number of its models
    merged, merges: number of hypotheses that go into merges of more than one, and of these merges
    operations: number of operations
    """
    rows, scans = [], result.axes.stage_scans
    for f, options in enumerate(result.spec.filters):
        fixed, per_hypothesis, per_merge = costs.operations_of(options)
        merge_means = np.asarray(result.sums["stage"])[f, :, [MERGED, MERGES], 0].T / result.count
        flight_means = scans @ merge_means / scans.sum()
        means_by_stage = [(name, merge_means[s]) for s, name in enumerate(stage_names(result)) if scans[s] > 0]
        filter_columns = {"family": options.family, "merge": options.merge, "models": len(options.models)}
        for stage, (merged, merges) in [*means_by_stage, ("whole", flight_means)]:
            row = {"case": result.name, "filter": result.axes.filters[f], **filter_columns, "stage": stage}
            counts = {
                "merged": merged,
                "merges": merges,
                "operations": fixed + per_hypothesis * merged + per_merge * merges,
            }
            rows.append(row | counts)
    return report_tables.columns_from_rows(rows)


tables = table.make


def cost(tables_by_name: "Mapping[str, pd.DataFrame]", run: Mapping[str, Any]) -> "pd.DataFrame | None":
    """Counted operations and measured nanoseconds of one update, with σ of the height by stage; None if not measured.

    run: the facts of the run, with `seconds_per_update`."""
    measured = run.get("seconds_per_update")
    if not measured:
        return None
    operation_rows = report_tables.select_rows(tables_by_name["operations"], stage="whole")
    table = operation_rows[["case", "filter", "family", "merge", "models", "operations"]].reset_index(drop=True)
    table["measured, ns"] = [1e9 * measured[c][f] for c, f in zip(table["case"], table["filter"], strict=True)]
    height = report_tables.select_rows(tables_by_name["stages"], component="y")
    wide = height.pivot(index=["case", "filter"], columns="stage", values="sigma")
    stages = list(dict.fromkeys(height["stage"]))
    wide = wide[stages].rename(columns={stage: f"σ of y, {stage}, m" for stage in stages})
    return table.merge(wide, left_on=["case", "filter"], right_index=True, how="left")
