"""Tables of filters that are given their plots (P3): what plots buy, gains of growing memory, the conversion's bias."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import statistics
from radarsim.report import tables as common
from radarsim.studies.sonar import exact
from radarsim.studies.sonar.axes import GivenPlotsAxes

if TYPE_CHECKING:
    import pandas as pd


def tables(results: Sequence[CaseResult[GivenPlotsAxes]]) -> "dict[str, pd.DataFrame]":
    """The tables of these cases beside those of all parts."""
    return {
        "plots": common.joined([_plots(result) for result in results if textbook(result)], PLOTS),
        "smoothing_gains": common.joined([_gains(result) for result in results if textbook(result)], GAINS),
        "conversion": common.joined([_conversion(r) for r in results if r.spec.frame != "polar"], CONVERSION),
    }


def textbook(result: CaseResult[GivenPlotsAxes]) -> bool:
    """Whether a case is what the paper's closed forms are of: equal intervals and weights, white errors, no miss."""
    sensor, target = result.spec.sensor, result.spec.target
    whole = sensor.detection_probability == 1 and not sensor.missed_scans and not sensor.further
    steady = (
        target.kind == "polynomial" and not target.fluctuation_mps2 and result.spec.frame == target.frame == "polar"
    )
    straight = steady and all(len(c) <= 2 or not any(c[2:]) for c in (target.range_m, target.bearing_rad))
    return whole and straight and not result.axes.rho.any()


PLOTS = (
    *("case", "filter", "degree", "component", "what", "plots", "ratio", "ratio_lo", "ratio_hi", "formula"),
    *("bought_percent", "formula_bought_percent"),
)


def _plots(result: CaseResult[GivenPlotsAxes]) -> dict:
    """What each further plot buys: σ of growing memory per σ of a plot after n plots, smoothed and one scan ahead.

    `formula` is the paper's for degree 1, and its (3) for the acceleration of degree 2; `bought_percent` is what the
    n-th plot takes off.
    """
    parts = []
    for f, choice in enumerate(result.spec.filters):
        if choice.kind == "growing_memory":
            for c in range(len(result.axes.coordinates)):
                parts += [_bought(result, f, c, what) for what in ("smoothed", "extrapolated", "acceleration")]
    parts = [part for part in parts if part]
    return {name: np.concatenate([np.asarray(part[name]) for part in parts]) if parts else [] for name in PLOTS}


def _bought(result: CaseResult[GivenPlotsAxes], f: int, c: int, what: str) -> dict | None:
    axes, choice = result.axes, result.spec.filters[f]
    size, width = choice.degree + 1, len(axes.components) // len(axes.coordinates)
    sigma, period = axes.sigma[c], axes.scan_period_s
    n = np.arange(size, len(axes.k) + (what != "extrapolated"))
    if what == "acceleration" and size < 3:
        return None
    if what == "extrapolated":
        moments, unit = result.sums["ahead"][f, n - 1, c], sigma
    else:
        j = 0 if what == "smoothed" else 2
        moments, unit = result.sums["error"][f, n - 1, width * c + j], sigma / period**j
    of = statistics.root_mean_square(moments[:, 1], moments[:, 3], result.count)
    known = {"smoothed": exact.sigma_smoothed, "extrapolated": exact.sigma_extrapolated}.get(what)
    if what == "acceleration":
        formula = exact.sigma_acceleration(n, 1.0)
    else:
        formula = known(n) if size == 2 else np.full(len(n), np.nan)
    return {
        "case": [result.name] * len(n),
        "filter": [choice.name] * len(n),
        "degree": [choice.degree] * len(n),
        "component": [axes.coordinates[c][0]] * len(n),
        "what": [what] * len(n),
        "plots": n,
        "ratio": of.value / unit,
        "ratio_lo": of.lo / unit,
        "ratio_hi": of.hi / unit,
        "formula": formula,
        "bought_percent": np.append(np.nan, 100 * (1 - of.value[1:] / of.value[:-1])),
        "formula_bought_percent": np.append(np.nan, 100 * (1 - formula[1:] / formula[:-1])),
    }


GAINS = ("case", "filter", "component", "plots", "A", "A_lo", "A_hi", "A_formula", "B", "B_lo", "B_hi", "B_formula")


def _gains(result: CaseResult[GivenPlotsAxes]) -> dict:
    """A_n and B_n of (14) as measured: a filter of degree 1 without process noise has var r / σ² = A, T₀ cov(r, v) /
    σ² = B.
    """
    axes, parts = result.axes, []
    width = len(axes.components) // len(axes.coordinates)
    n = np.arange(2, len(axes.k) + 1)
    A, B = exact.gains_closed(n)
    for f, choice in enumerate(result.spec.filters):
        plain = choice.kind in ("growing_memory", "kalman") and not choice.manoeuvre_variance and choice.degree == 1
        for c, (name, _) in enumerate(axes.coordinates) if plain else ():
            unit = axes.sigma[c] ** 2
            of = statistics.root_mean_square(*result.sums["error"][f, 1:, width * c, 1::2].T, result.count)
            joint = result.sums["joint"][f, 1:, c]
            both = statistics.mean(joint[:, 2], joint[:, 3], result.count)
            parts.append(
                {"case": [result.name] * len(n), "filter": [choice.name] * len(n), "component": [name] * len(n)}
                | {"plots": n, "A_formula": A, "B_formula": B}
                | {key: part**2 / unit for key, part in zip(("A", "A_lo", "A_hi"), of, strict=True)}
                | {key: part * axes.scan_period_s / unit for key, part in zip(("B", "B_lo", "B_hi"), both, strict=True)}
            )
    return {name: np.concatenate([np.asarray(part[name]) for part in parts]) if parts else [] for name in GAINS}


CONVERSION = (
    *("case", "frame", "range_m", "sigma_range_m", "sigma_bearing_rad", "across_m"),
    *("bias_m", "bias_lo", "bias_hi", "formula_m", "bias_to_sigma_range"),
)


def _conversion(result: CaseResult[GivenPlotsAxes]) -> dict:
    """Mean error along the line of sight of the converted first plot; `across_m` is range × bearing error."""
    axes, sensor = result.axes, result.spec.sensor
    width = len(axes.components) // len(axes.coordinates)
    r, b = axes.polar[0, :2, 0]
    of = statistics.errors(result.sums["error"][0, 0, [0, width]], result.count)
    along = np.array([np.cos(b), np.sin(b)])
    bias, half = float(along @ of.bias), statistics.Z95 * float(np.hypot(*(along * of.bias_se)))
    formula = axes.conversion_bias
    row = (
        result.name,
        result.spec.frame,
        r,
        sensor.sigma_range_m,
        sensor.sigma_bearing_rad,
        r * sensor.sigma_bearing_rad,
    )
    row += (bias, bias - half, bias + half, formula, bias / sensor.sigma_range_m)
    return {name: [value] for name, value in zip(CONVERSION, row, strict=True)}
