"""Tables of any part of P3, and of filters that know their plots."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency_tables, statistics
from radarsim.report import tables as common
from radarsim.report.tables import Columns, label_columns, stack_columns
from radarsim.studies.sonar import closed_forms
from radarsim.studies.sonar.axes import GivenPlotsAxes, SonarAxes

if TYPE_CHECKING:
    import pandas as pd

GAIN_COLUMNS = {"A": "position_gain", "B": "velocity_gain"}  # of smoothing_gains.csv, by the paper's letter
Index = tuple[np.ndarray, ...]
table = common.TableMakers()


def coordinate_rows(result: CaseResult[SonarAxes], mask: np.ndarray) -> tuple[Index, dict[str, np.ndarray]]:
    """The indices (filter, scan, coordinate), each (n,), where mask (F, K, C) is true, and the rows' first columns.

    Rows are ordered by filter, coordinate, scan."""
    f, c, k = np.nonzero(np.moveaxis(mask, 1, 2))
    names, units = zip(*result.axes.coordinates, strict=True)
    return (f, k, c), label_columns(
        result, f, k, component=common.pick_names(names, c), unit=common.pick_names(units, c)
    )


def complete_counts(result: CaseResult[SonarAxes]) -> np.ndarray:
    """The number of realisations (F, K, C) in which the state of a filter is complete in a coordinate."""
    counts = np.asarray(result.sums["estimates"])
    split = counts.reshape(*counts.shape[:2], len(result.axes.coordinates), -1)
    return np.take_along_axis(split, (result.axes.sizes - 1)[:, None, None, None], axis=3)[..., 0]


@table("extrapolation")
def _extrapolation(result: CaseResult[SonarAxes]) -> Columns:
    """σ of each coordinate extrapolated by one scan, in the row of the scan that it is extrapolated from."""
    n = complete_counts(result)
    mask = n > 0
    mask[:, -1] = False
    index, columns = coordinate_rows(result, mask)
    statistics_of_errors = statistics.errors(result.sums["ahead"][index], n[index])
    return {
        **columns,
        "n": n[index].astype(np.int64),
        "sigma": statistics_of_errors.sigma,
        "bias": statistics_of_errors.bias,
        "bias_se": statistics_of_errors.bias_se,
        "exact_sigma": result.axes.exact_ahead[index],
    }


@table("curves")
def _curves(result: CaseResult[SonarAxes]) -> Columns:
    """As everywhere. What filters with a test of manoeuvres believe varies much: alarms change their window."""
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = result.sums["believed"] / common.realisation_counts(result)
    return common.curve_columns(result, np.sqrt(variance))


def curves(results: Sequence[CaseResult[SonarAxes]]) -> "pd.DataFrame":
    """The table `curves` alone."""
    return common.join_columns(map(_curves, results))


@table("consistency")
def _normalised_errors(result: CaseResult[SonarAxes]) -> Columns:
    """NEES of a coordinate's state, where it is complete; the bounds are shared among all scans of a filter."""
    n = complete_counts(result)
    index, columns = coordinate_rows(result, n > 0)
    looks = np.sum(n > 0, axis=1)[index[0], index[2]]
    size, n = result.axes.sizes[index[0]], n[index]
    joint = result.sums["joint"][index]
    mean = statistics.mean_square(joint[:, 0] / size, joint[:, 1] / size**2, n)
    bounds = statistics.normalised_bounds(size * n, looks)
    nees = consistency_tables.normalised_square_columns("nees", mean, bounds, result.axes.exact_nees[index] / size)
    return {**columns, "n": n.astype(np.int64), **nees}


@table.add_of_all_cases("operations")
def _operations(results: Sequence[CaseResult[SonarAxes]]) -> "pd.DataFrame":
    """Operations of one scan of one coordinate at degree 1, no intermediate result computed twice; a test counts them.

    algorithm: in words, with the equation of the paper
    numbers_kept: how many numbers are kept from scan to scan
    products, sums, operations: number of products and divisions, of sums and differences, and of both
    """
    rows = [("recursion (12)-(14)", 2, 9, 10)]
    rows += [(f"least squares (2) on {n} plots", 2 * n, 4 * n + 9, 5 * n + 5) for n in (2, 3, 5, 6, 10)]
    rows += [("Kalman (11), degree 1", 2, 36, 22), ("differenced", 3, 37, 23), ("augmented", 3, 93, 74)]
    names = ("algorithm", "numbers_kept", "products", "sums", "operations")
    columns = zip(*((*row, row[2] + row[3]) for row in rows), strict=True)
    return common.frame(dict(zip(names, columns, strict=True)))


def textbook(result: CaseResult[GivenPlotsAxes]) -> bool:
    """Whether the closed forms apply: known association, equal intervals and weights, white errors, no misses."""
    sensor, target = result.spec.sensor, result.spec.target
    has_all_plots = sensor.detection_probability == 1 and not sensor.missed_scans and not sensor.further
    polynomial = target.kind == "polynomial" and result.spec.frame == target.frame == "polar"
    straight = polynomial and not any(any(c[2:]) for c in (target.range_m, target.bearing_rad))
    is_known_association = isinstance(result.axes, GivenPlotsAxes)
    return (
        is_known_association
        and has_all_plots
        and straight
        and not target.fluctuation_mps2
        and not result.axes.rho.any()
    )


def _components_per_coordinate(result: CaseResult[GivenPlotsAxes]) -> int:
    """Components of a coordinate."""
    return len(result.axes.components) // len(result.axes.coordinates)


@table("plots", textbook)
def _plots(result: CaseResult[GivenPlotsAxes]) -> Columns:
    """Benefit of each further plot to growing memory.

    degree: of the polynomial
    quantity: smoothed, extrapolated by one scan, or for degree 2 the acceleration
    plots: number in memory
    ratio ±: σ over σ of a plot
    formula: the paper's for degree 1, and its (3) for the acceleration
    reduction_percent, formula_reduction_percent: reduction of σ by the last of these plots
    """
    return stack_columns(
        [
            _plot_gains(result, f, c, quantity)
            for f, member in enumerate(result.spec.filters)
            if member.kind == "growing_memory"
            for c in range(len(result.axes.coordinates))
            for quantity in ("smoothed", "extrapolated", "acceleration")[: member.degree + 1]
        ]
    )


def _plot_gains(result: CaseResult[GivenPlotsAxes], f: int, c: int, quantity: str) -> Columns:
    axes, member = result.axes, result.spec.filters[f]
    n = np.arange(member.degree + 1, len(axes.k) + (quantity != "extrapolated"))
    formula: np.ndarray = np.full(len(n), np.nan)
    if quantity == "acceleration":
        unit, formula = axes.sigma[c] / axes.scan_period_s**2, np.asarray(closed_forms.sigma_acceleration(n, 1.0))
        moments = result.sums["error"][f, n - 1, _components_per_coordinate(result) * c + 2]
    elif quantity == "extrapolated":
        unit, moments = axes.sigma[c], result.sums["ahead"][f, n - 1, c]
    else:
        unit, moments = axes.sigma[c], result.sums["error"][f, n - 1, _components_per_coordinate(result) * c]
    if member.degree == 1:
        formula_function = closed_forms.sigma_smoothed if quantity == "smoothed" else closed_forms.sigma_extrapolated
        formula = np.asarray(formula_function(n))
    rms = statistics.root_mean_square(moments[:, 1], moments[:, 3], result.count)
    return {
        **label_columns(result, np.full(len(n), f)),
        "degree": np.full(len(n), member.degree),
        "component": np.full(len(n), axes.coordinates[c][0], dtype=object),
        "quantity": np.full(len(n), quantity, dtype=object),
        "plots": n,
        "ratio": statistics.Estimate(*(bound / unit for bound in rms)),
        "formula": formula,
        "reduction_percent": np.append(np.nan, 100 * (1 - rms.value[1:] / rms.value[:-1])),
        "formula_reduction_percent": np.append(np.nan, 100 * (1 - formula[1:] / formula[:-1])),
    }


@table("smoothing_gains", textbook)
def _gains(result: CaseResult[GivenPlotsAxes]) -> Columns:
    """A_n and B_n of (14), by filters of degree 1 without process noise: var r/σ² and T₀ cov(r, v)/σ².

    plots: their number n
    position_gain ±, velocity_gain ±: A_n and B_n as measured
    position_gain_formula, velocity_gain_formula: by the paper
    """
    axes = result.axes
    parts: list[Columns] = []
    n = np.arange(2, len(axes.k) + 1)
    A_formula, B_formula = closed_forms.gains_closed(n)
    for f, member in enumerate(result.spec.filters):
        plain = member.kind in ("growing_memory", "kalman") and not member.manoeuvre_variance and member.degree == 1
        for c, (name, _) in enumerate(axes.coordinates) if plain else ():
            unit = axes.sigma[c] ** 2
            square, fourth = result.sums["error"][f, 1:, _components_per_coordinate(result) * c, 1::2].T
            rms = statistics.root_mean_square(square, fourth, result.count)
            joint = result.sums["joint"][f, 1:, c]
            both = statistics.mean(joint[:, 2], joint[:, 3], result.count)
            A = statistics.Estimate(*(bound**2 / unit for bound in rms))
            B = statistics.Estimate(*(bound * axes.scan_period_s / unit for bound in both))
            columns = label_columns(result, np.full(len(n), f), component=np.full(len(n), name, dtype=object)) | {
                "plots": n
            }
            parts.append(
                columns
                | {GAIN_COLUMNS["A"]: A, f"{GAIN_COLUMNS['A']}_formula": A_formula}
                | {GAIN_COLUMNS["B"]: B, f"{GAIN_COLUMNS['B']}_formula": B_formula}
            )
    return stack_columns(parts)


@table("conversion", lambda result: result.spec.frame != "polar")
def _conversion(result: CaseResult[GivenPlotsAxes]) -> Columns:
    """Errors of a first plot that is converted to another frame.

    frame: what it is converted to
    range_m: its range
    sigma_range_m, sigma_bearing_rad: σ of its measurement
    across_m: error across the line of sight, range × bearing error
    bias_m ±: mean error along the line of sight
    formula_m: the same by formula
    bias_to_sigma_range: the mean error over σ of the range
    """
    axes, sensor = result.axes, result.spec.sensor
    r, b = axes.polar[0, :2, 0]
    statistics_of_errors = statistics.errors(
        result.sums["error"][0, 0, [0, _components_per_coordinate(result)]], result.count
    )
    along = np.array([np.cos(b), np.sin(b)])
    bias = float(along @ statistics_of_errors.bias)
    half = statistics.Z95 * float(np.hypot(*(along * statistics_of_errors.bias_se)))
    row = {
        **{"case": result.name, "frame": result.spec.frame, "range_m": float(r)},
        **{"sigma_range_m": sensor.sigma_range_m, "sigma_bearing_rad": sensor.sigma_bearing_rad},
        "across_m": float(r * sensor.sigma_bearing_rad),
        "bias_m": statistics.Estimate(bias, bias - half, bias + half),
        "formula_m": float(axes.conversion_bias),
        "bias_to_sigma_range": bias / sensor.sigma_range_m,
    }
    return common.columns_from_rows([row])


tables = table.make
