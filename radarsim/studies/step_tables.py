"""The tables of a step study: predicted σ beside the true one, whole states, tracks among false plots."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency_tables, statistics, tables

if TYPE_CHECKING:
    from radarsim.studies.stepwise import StepStudy


def curve_columns(study: "StepStudy", result: CaseResult) -> Mapping[str, Any]:
    """The curves, with the σ that filters with a covariance predict: the root of its mean variance."""
    if "believed" not in result.sums:
        return tables.curve_columns(result)
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.asarray(result.sums["believed"]) / tables.realisation_counts(result))
    predicts = np.array([study.kinds[member.kind].covariance is not None for member in result.spec.filters])
    return tables.curve_columns(result, np.where(predicts[:, None, None], sigma, np.nan))


def consistency_columns(study: "StepStudy", result: CaseResult) -> Mapping[str, Any]:
    """Mean NEES of all components by scan, per degree of freedom, with bounds and verdict."""
    scans, freedom = result.axes.k.size, len(study.components)
    is_tested = np.zeros((len(result.axes.filters), scans), dtype=bool)
    for number, member in enumerate(result.spec.filters):
        if study.kinds[member.kind].covariance is not None:
            is_tested[number, study.tested_from(result.spec, member) :] = True
    f, k = np.nonzero(is_tested)
    n = tables.realisation_counts(result)[f, k, 0]
    sums = np.asarray(result.sums["nees"])[f, k] / [freedom, freedom**2]
    bounds = consistency_tables.bounds_from_spread(sums[:, 0], sums[:, 1], n, len(sums))
    mean = statistics.mean_square(sums[:, 0], sums[:, 1], n)
    return {
        **tables.label_columns(result, f, k),
        "n": n.astype(int),
        **consistency_tables.normalised_square_columns("nees", mean, bounds),
    }


def track_columns(study: "StepStudy", result: CaseResult) -> Mapping[str, Any]:
    """Tracks among false plots, by scan.

    kept_share ±: share of realisations in which the track is still the target's
    confirmed_share ±: share of kept tracks that are confirmed
    wrong_plot_share ±: share of kept tracks whose likeliest plot of the scan is false"""
    counts = np.asarray(result.sums["counts"])
    filters, scans = counts.shape[:2]
    kept, *others = counts.reshape(-1, counts.shape[2]).T
    shares = {"kept": statistics.rate(kept, np.full(kept.shape, float(result.count)))}
    shares |= {name: statistics.rate(count, kept) for name, count in zip(study.counted, others, strict=True)}
    columns: dict[str, Any] = {
        **tables.label_columns(result, np.repeat(np.arange(filters), scans), np.tile(np.arange(scans), filters)),
        "n": np.full(kept.shape, result.count),
    }
    for name, share in shares.items():
        columns |= tables.interval_columns(f"{name}_share", share)
    return columns
