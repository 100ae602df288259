"""How P3's claims on smoothing are measured: the cases they mean, and the numbers taken from tables and sums."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.physics.motion import transition
from radarsim.report import statistics
from radarsim.report.claims import Missing, certain, ratio
from radarsim.report.claims.declared import Number
from radarsim.report.statistics import Estimate
from radarsim.studies.sonar import exact
from radarsim.studies.sonar.measures import CaseKey, Evidence, Measure
from radarsim.studies.sonar.smoothing.tables import textbook

MOST_PLOTS = 100


# ---- the cases ----------------------------------------------------------------------------------------------------
def _kinds(result: CaseResult) -> set[tuple[str, int]]:
    return {(f.kind, f.degree) for f in result.spec.filters}


def _is_textbook(result: CaseResult) -> bool:
    kinds = {("growing_memory", 1), ("growing_memory", 2), ("kalman", 1)}
    return kinds <= _kinds(result) and textbook(result)


def _is_fluctuating(result: CaseResult) -> bool:
    walks = bool(getattr(result.spec.target, "fluctuation_mps2", 0.0))
    return walks and ("growing_memory", 1) in _kinds(result) and len(result.axes.k) >= 40


def _turns(result: CaseResult) -> bool:
    return result.spec.target.kind == "turning" and ("growing_memory", 1) in _kinds(result) and _even(result)


def _has_gap(result: CaseResult) -> bool:
    sensor = result.spec.sensor
    return bool(sensor.missed_scans) and sensor.detection_probability == 1 and not sensor.further


def _has_several_sonars(result: CaseResult) -> bool:
    return bool(result.spec.sensor.further)


def _even(result: CaseResult) -> bool:
    """Equal intervals and weights, no miss, long enough."""
    sensor = result.spec.sensor
    return (
        not (sensor.missed_scans or sensor.further) and sensor.detection_probability == 1 and len(result.axes.k) >= 20
    )


def _first(matches: Callable[[CaseResult], bool]) -> Callable[[Sequence[CaseResult]], CaseResult | None]:
    """The first case in the polar frame that matches."""
    return lambda results: next((one for one in results if one.spec.frame == "polar" and matches(one)), None)


TEXTBOOK = CaseKey("equal intervals and weights, white errors, no miss", _first(_is_textbook))
FLUCTUATING = CaseKey("a course whose velocity walks at random", _first(_is_fluctuating))
TURNING = CaseKey("a vessel on a straight course at a constant speed, then in a turn", _first(_turns))
GAP = CaseKey("scans that never give a plot, the others always", _first(_has_gap))
ASYNCHRONOUS = CaseKey("several sonars", _first(_has_several_sonars))


def correlated(rho: float) -> CaseKey:
    """The case whose plots' errors are correlated to ρ, with both filters that know of it."""
    kinds = {("kalman_augmented", 1), ("kalman_differenced", 1)}

    def matches(result: CaseResult) -> bool:
        return kinds <= _kinds(result) and result.spec.sensor.error_correlation == rho and _even(result)

    return CaseKey(f"errors of neighbouring plots correlated to {rho:g}", _first(matches))


# ---- exact values: least squares on n plots of one scan apart and of one σ, in units of these ------------------------
@cache
def _covariance(n: int, size: int = 2) -> np.ndarray:
    """Covariance (size, size) of the state at the last of n plots, by a factorisation that knows no closed form."""
    return exact.generalised_least_squares(np.arange(n, dtype=float), np.eye(n), size)[1]


def _least_squares(what: str, n: int) -> float:
    """σ of what is smoothed, extrapolated by a scan, or of the acceleration."""
    if what == "acceleration":
        return float(np.sqrt(_covariance(n, 3)[2, 2]))
    F = transition(1.0 if what == "extrapolated" else 0.0, 2)
    return float(np.sqrt((F @ _covariance(n) @ F.T)[0, 0]))


def exact_over_formula(what: str, n: int) -> Number:
    """What `over_formula` measures."""
    formula = {
        "smoothed": exact.sigma_smoothed(n),
        "extrapolated": exact.sigma_extrapolated(n) if n > 1 else np.inf,
        "acceleration": exact.sigma_acceleration(n, 1.0) if n > 2 else np.inf,
    }
    return lambda seen: float(_least_squares(what, n) / formula[what])


def exact_gain(letter: str, n: int) -> float:
    """A_n or B_n."""
    return float(_covariance(n)[0, "AB".index(letter)])


def exact_gain_over_formula(letter: str, n: int) -> Number:
    """What `gain_over_formula` measures."""
    closed = exact.gains_closed(np.array([n]))["AB".index(letter)][0]
    return lambda seen: float(exact_gain(letter, n) / closed)


def exact_enough(seen: Evidence) -> float:
    """What `enough` measures."""
    return float(next(n for n in range(2, MOST_PLOTS) if _least_squares("extrapolated", n) <= 1))


# ---- the numbers --------------------------------------------------------------------------------------------------
def over_formula(what: str, n: int) -> Measure:
    """σ of growing memory after n plots over the paper's formula, of the range."""

    def measure(seen: Evidence) -> Estimate:
        degree = 2 if what == "acceleration" else 1
        row = seen.row("plots", case=seen.case(TEXTBOOK).name, component="r", what=what, plots=n, degree=degree)
        return Estimate(*(row[key] / row["formula"] for key in ("ratio", "ratio_lo", "ratio_hi")))

    return measure


def bought(more: int, few: int, what: str = "smoothed") -> Measure:
    """Smoothed or extrapolated σ of growing memory after more plots over that after few; of the same realisations,
    taken as independent.
    """

    def measure(seen: Evidence) -> Estimate:
        name = seen.case(TEXTBOOK).name
        found = []
        for n in (more, few):
            row = seen.row("plots", case=name, component="r", what=what, plots=n, degree=1)
            found.append(Estimate(*(row[key] for key in ("ratio", "ratio_lo", "ratio_hi"))))
        return ratio(found[0], found[1])

    return measure


def exact_bought(more: int, few: int, what: str = "smoothed") -> Number:
    """What `bought` measures."""
    return lambda seen: _least_squares(what, more) / _least_squares(what, few)


def as_printed(seen: Evidence) -> Estimate:
    """σ of the range at the end, of the Kalman filter without manoeuvre variance over that of growing memory."""
    return _over_growing_memory(seen, seen.filter(FLUCTUATING, "kalman"))


def with_manoeuvres(seen: Evidence) -> Estimate:
    """The same of the Kalman filter with manoeuvre variance."""
    case = seen.case(FLUCTUATING)
    own = next((f.name for _, f in seen.members(case) if f.kind == "kalman" and f.manoeuvre_variance), None)
    if own is None:
        raise Missing("no Kalman filter with manoeuvre variance")
    return _over_growing_memory(seen, own)


def _over_growing_memory(seen: Evidence, own: str) -> Estimate:
    other = seen.filter(FLUCTUATING, "growing_memory")
    return ratio(seen.curve(FLUCTUATING, own, "r").last(), seen.curve(FLUCTUATING, other, "r").last())


def over_jointly(component: str, n: int) -> Measure:
    """σ of range or bearing after n plots, each filtered alone, over least squares on both at once."""

    def measure(seen: Evidence) -> Estimate:
        sensor, c = seen.case(TEXTBOOK).spec.sensor, "rb".index(component)
        sigma = np.repeat([sensor.sigma_range_m, sensor.sigma_bearing_rad], n)
        lines = np.kron(np.eye(2), np.column_stack([np.ones(n), np.arange(1 - n, 1)])) / sigma[:, None]
        joint = np.sqrt(np.linalg.inv(lines.T @ lines)[2 * c, 2 * c])
        own = seen.curve(TEXTBOOK, seen.filter(TEXTBOOK, "growing_memory"), component).at(n)
        return Estimate(*(float(part / joint) for part in own))

    return measure


def on_a_straight_course(component: str) -> Measure:
    """σ of range or bearing of growing memory at the end of a straight leg over that on a linear trajectory."""

    def measure(seen: Evidence) -> Estimate:
        end = seen.case(TURNING).spec.target.turns[0].start_s
        straight, linear = (
            seen.curve(key, seen.filter(key, "growing_memory"), component) for key in (TURNING, TEXTBOOK)
        )
        return ratio(straight.where(straight.t <= end).last(), linear.where(linear.t <= end).last())

    return measure


def enough(seen: Evidence) -> Estimate:
    """Fewest plots from which the extrapolated σ is no more than a plot's; the ends take σ at those of its interval."""
    name = seen.case(TEXTBOOK).name
    rows = seen.tables["plots"]
    rows = rows[(rows["case"] == name) & (rows["component"] == "r") & (rows["degree"] == 1)]
    rows = rows[rows["what"] == "extrapolated"].sort_values("plots")
    found = [rows.loc[rows[key] <= 1, "plots"] for key in ("ratio", "ratio_lo", "ratio_hi")]
    return Estimate(*(float(f.iloc[0]) if len(f) else np.inf for f in found))


def gain_over_formula(letter: str, n: int) -> Measure:
    """A_n or B_n as measured, over its closed form."""

    def measure(seen: Evidence) -> Estimate:
        row = _gain_row(seen, n)
        return Estimate(*(row[key] / row[f"{letter}_formula"] for key in (letter, f"{letter}_lo", f"{letter}_hi")))

    return measure


def gain_falls(letter: str, early: int, late: int) -> Measure:
    """A gain at one number of plots over that at another."""

    def measure(seen: Evidence) -> Estimate:
        a, b = (
            Estimate(*(row[key] for key in (letter, f"{letter}_lo", f"{letter}_hi")))
            for row in (_gain_row(seen, late), _gain_row(seen, early))
        )
        return ratio(a, b)

    return measure


def exact_gain_falls(letter: str, early: int, late: int) -> Number:
    """What `gain_falls` measures."""
    return lambda seen: exact_gain(letter, late) / exact_gain(letter, early)


def _gain_row(seen: Evidence, n: int) -> Mapping[str, Any]:
    name = seen.filter(TEXTBOOK, "growing_memory")
    return seen.row("smoothing_gains", case=seen.case(TEXTBOOK).name, filter=name, component="r", plots=n)


def alike(seen: Evidence) -> Estimate:
    """Largest relative difference in σ of growing memory and Kalman filter, range and radial velocity."""
    return _difference(seen, TEXTBOOK, "growing_memory", "kalman")


def two_ways(rho: float) -> Measure:
    """Largest relative difference in σ of the augmented and the differenced filter."""
    return lambda seen: _difference(seen, correlated(rho), "kalman_augmented", "kalman_differenced")


def _difference(seen: Evidence, key: CaseKey, one: str, other: str) -> Estimate:
    largest = 0.0
    for component in ("r", "vr"):
        a, b = (seen.curve(key, seen.filter(key, kind), component).value for kind in (one, other))
        largest = max(largest, float(np.max(np.abs(a / b - 1))))
    return certain(largest)


def ignored(rho: float) -> Measure:
    """σ of the range at the end, of the Kalman filter that takes errors as independent over the augmented one's."""

    def measure(seen: Evidence) -> Estimate:
        key = correlated(rho)
        naive, own = (seen.curve(key, seen.filter(key, kind), "r").last() for kind in ("kalman", "kalman_augmented"))
        return ratio(naive, own)

    return measure


def printed_sum(n: int) -> Measure:
    """g after n plots of equal weight and interval by the print's formula for any interval, over its closed form."""
    g = 0.0
    for f in range(2, n + 1):  # f is the number of plots, the new one with them
        g += f
    return lambda seen: certain(g / (n * (n - 1) / 2))


def at_a_miss(kind: str) -> Measure:
    """σ of the range at the first missed scan over σ extrapolated to it from the scan before: of the same
    realisations.
    """

    def measure(seen: Evidence) -> Estimate:
        case, f = seen.case(GAP), seen.index(GAP, seen.filter(GAP, kind))
        k = case.spec.sensor.missed_scans[0] - 1
        here, before = case.sums["error"][f, k, 0, 1], case.sums["ahead"][f, k - 1, 0, 1]
        return certain(np.sqrt(here / before))

    return measure


def over_optimal(key: CaseKey, kind: str, component: str) -> Measure:
    """σ of the last scan over that of generalised least squares on the same plots."""

    def measure(seen: Evidence) -> Estimate:
        case = seen.case(key)
        axes, c = case.axes, [name for name, _ in case.axes.coordinates].index(component)
        best = exact.optimal_sigma(axes.t_s, axes.sigma_of_plots[:, c], float(axes.rho[c]), axes.scan_period_s, 2)
        last = seen.curve(key, seen.filter(key, kind), component).last()
        return Estimate(*(float(part / best[0]) for part in last))

    return measure


def rises(seen: Evidence) -> Estimate:
    """σ of the range of growing memory at the end over its least, on the fluctuating course; taken as independent."""
    curve = seen.curve(FLUCTUATING, seen.filter(FLUCTUATING, "growing_memory"), "r")
    return ratio(curve.last(), curve.least())


def bounded(seen: Evidence) -> Estimate:
    """Paired gain in σ of the range of a window of ten plots against growing memory, at the end."""
    case = seen.case(FLUCTUATING)
    f, base = (
        seen.index(FLUCTUATING, seen.filter(FLUCTUATING, *of)) for of in (("window", 1, 10), ("growing_memory",))
    )
    if base != case.axes.baseline:
        raise Missing("gains against growing memory")
    own, other = case.sums["error"][f, -1, 0], case.sums["error"][base, -1, 0]
    return statistics.gain(own[1], own[3], other[1], other[3], case.sums["paired"][f, -1, 0], case.count)


def exact_bounded(seen: Evidence) -> float:
    """What `bounded` measures, by the exact σ of both."""
    return seen.exactly().gain(FLUCTUATING, seen.filter(FLUCTUATING, "window", 1, 10), "r").last().value


def kept(algorithm: str) -> Measure:
    """Numbers that an algorithm keeps from plot to plot."""
    return lambda seen: certain(seen.row("operations", algorithm=algorithm)["numbers_kept"])


def cost(algorithm: str, other: str) -> Measure:
    """Operations of one algorithm over those of another."""

    def measure(seen: Evidence) -> Estimate:
        one, two = (seen.row("operations", algorithm=name)["operations"] for name in (algorithm, other))
        return certain(one / two)

    return measure
