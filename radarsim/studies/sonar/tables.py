"""P3's own tables (extrapolation, plots, consistency, believed, conversion, operations) and the words of its report."""

from collections.abc import Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency, panels, statistics
from radarsim.report import tables as common
from radarsim.studies.sonar import exact
from radarsim.studies.sonar import figures as sonar_figures
from radarsim.studies.sonar.clutter import tables as clutter
from radarsim.studies.sonar.manoeuvre import tables as manoeuvres
from radarsim.studies.sonar.manoeuvre import words
from radarsim.studies.sonar.smoothing import operations as counted

figures = sonar_figures.figures
NAMES = sonar_figures.QUANTITIES


def tables(results: Sequence[CaseResult]) -> dict:
    """The tables beyond curves and gains; one without rows is left out."""
    made = {
        "extrapolation": common.joined([_extrapolation(result) for result in results], EXTRAPOLATION),
        "believed": common.joined([_believed(result) for result in results], consistency.BELIEVED),
        "consistency": common.joined([_normalised_errors(result) for result in results], CONSISTENCY),
        "plots": common.joined([_plots(result) for result in results if textbook(result)], PLOTS),
        "smoothing_gains": common.joined([_gains(result) for result in results if textbook(result)], GAINS),
        "conversion": common.joined([_conversion(r) for r in results if r.spec.frame != "polar"], CONVERSION),
        "operations": operations(),
    }
    made |= clutter.tables([result for result in results if result.spec.tracking])
    made |= manoeuvres.tables([result for result in results if result.spec.manoeuvring])
    return {name: table for name, table in made.items() if len(table)}


def textbook(result: CaseResult) -> bool:
    """Whether a case is what the paper's closed forms are of: equal intervals and weights, white errors, no miss."""
    sensor, target = result.spec.sensor, result.spec.target
    whole = sensor.detection_probability == 1 and not sensor.missed_scans and not sensor.further
    steady = (
        target.kind == "polynomial" and not target.fluctuation_mps2 and result.spec.frame == target.frame == "polar"
    )
    straight = steady and all(len(c) <= 2 or not any(c[2:]) for c in (target.range_m, target.bearing_rad))
    return whole and straight and not result.spec.tracking and not result.axes.extra["rho"].any()


def coordinate_rows(result: CaseResult, mask: np.ndarray):
    """The leading columns of a coordinate's rows, and where mask (F, K, C) has them.

    Returns indices (filter, scan, coordinate), each (n,), ordered filter, coordinate, scan; and the columns by name.
    """
    axes = result.axes
    f, c, k = np.nonzero(np.moveaxis(mask, 1, 2))
    coordinates = axes.extra["coordinates"]
    columns = {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": common.names(axes.filters, f),
        "component": common.names([name for name, _ in coordinates], c),
        "unit": common.names([unit for _, unit in coordinates], c),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
    }
    return (f, k, c), columns


def complete(result: CaseResult) -> np.ndarray:
    """Realisations (F, K, C) in which a filter's state is complete in a coordinate."""
    sizes, counts = result.axes.extra["sizes"], np.asarray(result.sums["estimates"])
    size = counts.shape[2] // len(result.axes.extra["coordinates"])
    split = counts.reshape(*counts.shape[:2], -1, size)
    return np.take_along_axis(split, (sizes - 1)[:, None, None, None], axis=3)[..., 0]


EXTRAPOLATION = (
    *("case", "filter", "component", "unit", "k", "t_s", "n"),
    *("sigma", "sigma_lo", "sigma_hi", "bias", "bias_se", "exact_sigma"),
)


def _extrapolation(result: CaseResult) -> dict:
    """σ of each coordinate extrapolated by one scan, in the row of the scan that it was extrapolated from."""
    n = complete(result)
    mask = n > 0
    mask[:, -1] = False
    at, columns = coordinate_rows(result, mask)
    of = statistics.errors(result.sums["ahead"][at], n[at])
    return columns | {
        "n": n[at].astype(np.int64),
        "sigma": of.sigma.value,
        "sigma_lo": of.sigma.lo,
        "sigma_hi": of.sigma.hi,
        "bias": of.bias,
        "bias_se": of.bias_se,
        "exact_sigma": result.axes.extra["exact_ahead"][at],
    }


def _believed(result: CaseResult) -> dict[str, np.ndarray]:
    """σ beside the one that the filter believes, the root of its mean variance."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return consistency.believed(result, np.sqrt(result.sums["believed"] / common.realisations(result)))


CONSISTENCY = ("case", "filter", "component", "unit", "k", "t_s", "n", *consistency.columns("nees", exact=True))


def _normalised_errors(result: CaseResult) -> dict:
    """NEES eᵀP⁻¹e of a coordinate's state per component, where it is complete.

    In 95 % of runs of a filter that is right about itself all its scans' means over as many realisations lie within
    their bounds.
    """
    n = complete(result)
    at, columns = coordinate_rows(result, n > 0)
    looks = np.sum(n > 0, axis=1)[at[0], at[2]]
    size, n = result.axes.extra["sizes"][at[0]], n[at]
    joint = result.sums["joint"][at]
    mean = statistics.mean_square(joint[:, 0] / size, joint[:, 1] / size**2, n)
    bounds = statistics.normalised_bounds(size * n, looks)
    nees = consistency.normalised("nees", mean, bounds, result.axes.extra["exact_nees"][at] / size)
    return columns | {"n": n.astype(np.int64), **nees}


PLOTS = (
    *("case", "filter", "degree", "component", "what", "plots", "ratio", "ratio_lo", "ratio_hi", "formula"),
    *("bought_percent", "formula_bought_percent"),
)


def _plots(result: CaseResult) -> dict:
    """What each further plot buys: σ of growing memory per σ of a plot after n plots, smoothed and one scan ahead.

    `formula` is the paper's for degree 1, and its (3) for the acceleration of degree 2; `bought_percent` is what the
    n-th plot takes off.
    """
    parts = []
    for f, choice in enumerate(result.spec.filters):
        if choice.kind == "growing_memory":
            for c in range(len(result.axes.extra["coordinates"])):
                parts += [_bought(result, f, c, what) for what in ("smoothed", "extrapolated", "acceleration")]
    parts = [part for part in parts if part]
    return {name: np.concatenate([np.asarray(part[name]) for part in parts]) if parts else [] for name in PLOTS}


def _bought(result: CaseResult, f: int, c: int, what: str) -> dict | None:
    axes, choice = result.axes, result.spec.filters[f]
    size, width = choice.degree + 1, len(axes.components) // len(axes.extra["coordinates"])
    sigma, period = axes.extra["sigma"][c], axes.extra["scan_period_s"]
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
        "component": [axes.extra["coordinates"][c][0]] * len(n),
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


def _gains(result: CaseResult) -> dict:
    """A_n and B_n of (14) as measured: a filter of degree 1 without process noise has var r / σ² = A, T₀ cov(r, v) /
    σ² = B.
    """
    axes, parts = result.axes, []
    width = len(axes.components) // len(axes.extra["coordinates"])
    n = np.arange(2, len(axes.k) + 1)
    A, B = exact.gains_closed(n)
    for f, choice in enumerate(result.spec.filters):
        plain = choice.kind in ("growing_memory", "kalman") and not choice.manoeuvre_variance and choice.degree == 1
        for c, (name, _) in enumerate(axes.extra["coordinates"]) if plain else ():
            unit = axes.extra["sigma"][c] ** 2
            of = statistics.root_mean_square(*result.sums["error"][f, 1:, width * c, 1::2].T, result.count)
            joint = result.sums["joint"][f, 1:, c]
            both = statistics.mean(joint[:, 2], joint[:, 3], result.count)
            parts.append(
                {"case": [result.name] * len(n), "filter": [choice.name] * len(n), "component": [name] * len(n)}
                | {"plots": n, "A_formula": A, "B_formula": B}
                | {key: part**2 / unit for key, part in zip(("A", "A_lo", "A_hi"), of, strict=True)}
                | {
                    key: part * axes.extra["scan_period_s"] / unit
                    for key, part in zip(("B", "B_lo", "B_hi"), both, strict=True)
                }
            )
    return {name: np.concatenate([np.asarray(part[name]) for part in parts]) if parts else [] for name in GAINS}


CONVERSION = (
    *("case", "frame", "range_m", "sigma_range_m", "sigma_bearing_rad", "across_m"),
    *("bias_m", "bias_lo", "bias_hi", "formula_m", "bias_to_sigma_range"),
)


def _conversion(result: CaseResult) -> dict:
    """Mean error along the line of sight of the converted first plot; `across_m` is range × bearing error."""
    axes, sensor = result.axes, result.spec.sensor
    width = len(axes.components) // len(axes.extra["coordinates"])
    r, b = axes.extra["polar"][0, :2, 0]
    of = statistics.errors(result.sums["error"][0, 0, [0, width]], result.count)
    along = np.array([np.cos(b), np.sin(b)])
    bias, half = float(along @ of.bias), statistics.Z95 * float(np.hypot(*(along * of.bias_se)))
    formula = axes.extra["conversion_bias"]
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


def operations():
    """Operations of a scan of one coordinate, degree 1: the recursion, least squares anew, Kalman, and for correlated
    errors.
    """
    rows = [("recursion (12)-(14)", 2, counted.recursion())]
    rows += [(f"least squares (2) on {n} plots", 2 * n, counted.batch_of(n)) for n in (2, 3, 5, 6, 10)]
    rows += [("Kalman (11), degree 1", 2, counted.kalman_of(2)), ("differenced", 3, counted.differenced())]
    rows += [("augmented", 3, counted.augmented())]
    return common.frame(
        {
            "algorithm": [name for name, _, _ in rows],
            "numbers_kept": [kept for _, kept, _ in rows],
            "products": [tally.products for _, _, tally in rows],
            "sums": [tally.sums for _, _, tally in rows],
            "operations": [tally.total for _, _, tally in rows],
        }
    )


def question(experiment) -> str:
    """What the experiment asks, in one sentence."""
    specs = [case.spec for case in experiment.cases]
    if any(spec.tracking for spec in specs):
        return clutter.QUESTION
    if any(spec.manoeuvring for spec in specs):
        return words.question(specs)
    if any(spec.frame != "polar" for spec in specs):
        return "What does it cost to convert range and bearing to x and y, and when does the conversion's bias matter?"
    if any(np.any(np.array(_rho(spec)) != 0) for spec in specs):
        return "What does it cost to ignore that the errors of neighbouring plots are correlated?"
    if any(spec.sensor.detection_probability < 1 or spec.sensor.missed_scans for spec in specs):
        return "What does a missed plot cost?"
    names = list(dict.fromkeys(f.name for spec in specs for f in spec.filters))
    return f"How accurate are range and bearing smoothed by {', '.join(names)}?"


def _rho(spec) -> tuple[float, ...]:
    given = spec.sensor.error_correlation
    return (given,) if isinstance(given, float) else (given.range, given.bearing, given.third)


def answer(results: Sequence[CaseResult], made: dict) -> list[str]:
    """Sentences with numbers and 95 % intervals: σ of the first coordinate at the end of the run, by filter.

    And the most optimistic filter.
    """
    tracked = [result for result in results if result.spec.tracking]
    if tracked:
        return clutter.answer(tracked, made)
    shown, others = panels.told(results)
    best = [_best(result, made["curves"]) for result in shown]
    wrong = _most_optimistic(results, made)
    seen = words.answer([result for result in results if result.spec.manoeuvring], made)
    return [*seen, *best, *([wrong] if wrong else []), *others]


def _best(result: CaseResult, curves) -> str:
    first = result.axes.components[0][0]
    rows = curves[(curves["case"] == result.name) & (curves["component"] == first)]
    last = rows[rows["k"] == rows["k"].max()]
    # By the exact values where all are known: filters of one accuracy are not to be told apart by their noise.
    order = last["exact_sigma"].round(9) if last["exact_sigma"].notna().all() else last["sigma"]
    last = last.loc[order.sort_values(kind="stable").index]
    low, high = last.iloc[0], last.iloc[-1]
    where = panels.plain(panels.swept(result))
    said = f"{low['filter']} {low['sigma']:.4g} {low['unit']} [{low['sigma_lo']:.4g}, {low['sigma_hi']:.4g}]"
    if len(last) > 1:
        worst = f"{high['sigma']:.4g} {high['unit']} [{high['sigma_lo']:.4g}, {high['sigma_hi']:.4g}]"
        said = f"least with {said}, largest with {high['filter']} {worst}"
    return f"{where + ': ' if where else ''}σ of the {NAMES[first].name} after {low['t_s']:g} s: {said}."


def _most_optimistic(results: Sequence[CaseResult], made: dict) -> str:
    """The worst case of a filter that believes itself more accurate than it is, its state complete."""
    table = made["believed"].merge(made["consistency"][["case", "filter", "k"]].drop_duplicates())
    worst = table.loc[table["ratio"].idxmax()]
    if worst["ratio_lo"] <= 1.05:
        return ""
    result = next(result for result in results if result.name == worst["case"])
    where = f" at {panels.plain(panels.swept(result))}" if result.swept else ""
    return (
        f"Most optimistic: {worst['filter']}{where}, whose true σ is "
        f"{worst['ratio']:.2f} [{worst['ratio_lo']:.2f}, {worst['ratio_hi']:.2f}] times the one it believes "
        f"({NAMES[worst['component']].name}, scan {worst['k']})."
    )
