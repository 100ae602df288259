"""How P3's claims find the cases that they mean, and what is measured of smoothing, from tables and sums."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.papers import evidence
from radarsim.papers.evidence import MissingEvidence, ratio
from radarsim.physics import transition
from radarsim.report import statistics
from radarsim.report.statistics import Estimate
from radarsim.studies.sonar import exact
from radarsim.studies.sonar.tables import textbook

MOST_PLOTS = 100
What = Literal["smoothed", "extrapolated", "acceleration"]
Letter = Literal["A", "B"]
Key = str | tuple[str, float]  # a case that claims mean, by name, or by name and a value
Find = Callable[..., CaseResult | None]  # of the results, and of the value where the key has one
FOUND: dict[str, Find] = {}  # by name, None where it is not there; the parts' measures say how


class Evidence(evidence.Evidence):
    """Finds the cases of P3 by their keys."""

    def case(self, key: Key) -> CaseResult:
        """The case that a key means; raises Missing."""
        name, *value = (key,) if isinstance(key, str) else key
        found = FOUND[str(name)](self.results, *value)
        if found is None:
            raise MissingEvidence((key,))
        return found

    def filter(self, key: Key, kind: str, degree: int = 1, plots: int | None = None) -> str:
        """The name of a case's first filter of that kind, without process noise; raises Missing."""
        for _, f in self.members(self.case(key)):
            if (f.kind, f.degree) == (kind, degree) and f.plots == plots and not f.manoeuvre_variance:
                return f.name
        raise MissingEvidence((key, kind))

    def index(self, key: Key, name: str) -> int:
        """Place of a filter in the sums."""
        return self.case(key).axes.filters.index(name)


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


def _correlated(results: Sequence[CaseResult], rho: float) -> CaseResult | None:
    """The case whose plots' errors are correlated to ρ, with both filters that know of it."""
    kinds = {("kalman_augmented", 1), ("kalman_differenced", 1)}

    def matches(result: CaseResult) -> bool:
        return kinds <= _kinds(result) and result.spec.sensor.error_correlation == rho and _even(result)

    return _first(matches)(results)


FOUND.update(
    textbook=_first(_is_textbook),  # equal intervals and weights, white errors, no miss
    fluctuating=_first(_is_fluctuating),  # a course whose velocity walks at random
    turning=_first(_turns),  # a vessel on a straight course at a constant speed, then in a turn
    gap=_first(_has_gap),  # scans that never give a plot, the others always
    asynchronous=_first(_has_several_sonars),
    correlated=_correlated,
)


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


def exact_over_formula(seen: Evidence, key: Key, what: str, n: int) -> float:
    """What `over_formula` measures."""
    formula = {
        "smoothed": exact.sigma_smoothed(n),
        "extrapolated": exact.sigma_extrapolated(n) if n > 1 else np.inf,
        "acceleration": exact.sigma_acceleration(n, 1.0) if n > 2 else np.inf,
    }
    return float(_least_squares(what, n) / formula[what])


def _exact_gain(letter: str, n: int) -> float:
    """A_n or B_n."""
    return float(_covariance(n)[0, "AB".index(letter)])


def exact_gain_over_formula(seen: Evidence, key: Key, letter: str, n: int) -> float:
    """What `gain_over_formula` measures."""
    return float(_exact_gain(letter, n) / exact.gains_closed(np.array([n]))["AB".index(letter)][0])


def exact_gain_falls(seen: Evidence, key: Key, letter: str, early: int, late: int) -> float:
    """What `gain_falls` measures."""
    return _exact_gain(letter, late) / _exact_gain(letter, early)


def exact_enough(seen: Evidence, key: Key) -> float:
    """What `enough` measures."""
    return float(next(n for n in range(2, MOST_PLOTS) if _least_squares("extrapolated", n) <= 1))


def exact_bought(seen: Evidence, key: Key, more: int, few: int, what: What = "smoothed") -> float:
    """What `bought` measures."""
    return _least_squares(what, more) / _least_squares(what, few)


def exact_bounded(seen: Evidence, key: Key) -> float:
    """What `bounded` measures, by the exact σ of both."""
    return seen.exactly().gain(key, seen.filter(key, "window", 1, 10), "r").last().value


def _read(row: Mapping[str, Any], name: str, over: float = 1.0) -> Estimate:
    """A number of a table with its interval, over another."""
    return Estimate(*(row[key] / over for key in (name, f"{name}_lo", f"{name}_hi")))


def _last(seen: Evidence, key: Key, kind: str, component: str = "r") -> Estimate:
    """σ of the filter of a kind at the last scan."""
    return seen.curve(key, seen.filter(key, kind), component).last()


def over_formula(seen: Evidence, key: Key, what: What, n: int) -> Estimate:
    """σ of growing memory after n plots over the paper's formula, of the range."""
    degree = 2 if what == "acceleration" else 1
    row = seen.row("plots", case=seen.case(key).name, component="r", what=what, plots=n, degree=degree)
    return _read(row, "ratio", row["formula"])


def bought(seen: Evidence, key: Key, more: int, few: int, what: What = "smoothed") -> Estimate:
    """Smoothed or extrapolated σ of growing memory after more plots over that after few; of the same realisations,
    taken as independent."""
    name = seen.case(key).name
    rows = [seen.row("plots", case=name, component="r", what=what, plots=n, degree=1) for n in (more, few)]
    return ratio(_read(rows[0], "ratio"), _read(rows[1], "ratio"))


def as_printed(seen: Evidence, key: Key) -> Estimate:
    """σ of the range at the end, of the Kalman filter without manoeuvre variance over that of growing memory."""
    return ratio(_last(seen, key, "kalman"), _last(seen, key, "growing_memory"))


def with_manoeuvres(seen: Evidence, key: Key) -> Estimate:
    """The same of the Kalman filter with manoeuvre variance."""
    members = seen.members(seen.case(key))
    own = next((f.name for _, f in members if f.kind == "kalman" and f.manoeuvre_variance), None)
    if own is None:
        raise MissingEvidence("no Kalman filter with manoeuvre variance")
    return ratio(seen.curve(key, own, "r").last(), _last(seen, key, "growing_memory"))


def ignored(seen: Evidence, key: Key) -> Estimate:
    """σ of the range at the end, of the Kalman filter that takes errors as independent over the augmented one's."""
    return ratio(_last(seen, key, "kalman"), _last(seen, key, "kalman_augmented"))


def over_jointly(seen: Evidence, key: Key, component: str, n: int) -> Estimate:
    """σ of range or bearing after n plots, each filtered alone, over least squares on both at once."""
    sensor, c = seen.case(key).spec.sensor, "rb".index(component)
    sigma = np.repeat([sensor.sigma_range_m, sensor.sigma_bearing_rad], n)
    lines = np.kron(np.eye(2), np.column_stack([np.ones(n), np.arange(1 - n, 1)])) / sigma[:, None]
    joint = np.sqrt(np.linalg.inv(lines.T @ lines)[2 * c, 2 * c])
    own = seen.curve(key, seen.filter(key, "growing_memory"), component).at(n)
    return Estimate(*(float(part / joint) for part in own))


def on_a_straight_course(seen: Evidence, key: Key, component: str) -> Estimate:
    """σ of range or bearing of growing memory at the end of a straight leg over that on a linear trajectory."""
    end = seen.case(key).spec.target.turns[0].start_s
    curves = [seen.curve(one, seen.filter(one, "growing_memory"), component) for one in (key, "textbook")]
    straight, linear = (one.where(one.t <= end).last() for one in curves)
    return ratio(straight, linear)


def enough(seen: Evidence, key: Key) -> Estimate:
    """Fewest plots from which the extrapolated σ is no more than a plot's; the ends take σ at those of its interval."""
    name = seen.case(key).name
    rows = seen.tables["plots"]
    rows = rows[(rows["case"] == name) & (rows["component"] == "r") & (rows["degree"] == 1)]
    rows = rows[rows["what"] == "extrapolated"].sort_values("plots")
    found = [rows.loc[rows[one] <= 1, "plots"] for one in ("ratio", "ratio_lo", "ratio_hi")]
    return Estimate(*(float(f.iloc[0]) if len(f) else np.inf for f in found))


def gain_over_formula(seen: Evidence, key: Key, letter: Letter, n: int) -> Estimate:
    """A_n or B_n as measured, over its closed form."""
    row = _gain_row(seen, key, n)
    return _read(row, letter, row[f"{letter}_formula"])


def gain_falls(seen: Evidence, key: Key, letter: Letter, early: int, late: int) -> Estimate:
    """A gain at one number of plots over that at another."""
    return ratio(_read(_gain_row(seen, key, late), letter), _read(_gain_row(seen, key, early), letter))


def _gain_row(seen: Evidence, key: Key, n: int) -> Mapping[str, Any]:
    name = seen.filter(key, "growing_memory")
    return seen.row("smoothing_gains", case=seen.case(key).name, filter=name, component="r", plots=n)


def sigma_apart(seen: Evidence, key: Key, one: str, other: str) -> float:
    """Largest relative difference in σ of the filters of two kinds, range and radial velocity."""
    largest = 0.0
    for component in ("r", "vr"):
        a, b = (seen.curve(key, seen.filter(key, kind), component).value for kind in (one, other))
        largest = max(largest, float(np.max(np.abs(a / b - 1))))
    return largest


def printed_sum(seen: Evidence, key: Key, n: int) -> float:
    """g after n plots of equal weight and interval by the print's formula for any interval, over its closed form."""
    return sum(range(2, n + 1)) / (n * (n - 1) / 2)  # f is the number of plots, the new one with them


def at_a_miss(seen: Evidence, key: Key, kind: str) -> float:
    """σ of the range at the first missed scan over σ extrapolated to it from the scan before: of the same
    realisations."""
    case, f = seen.case(key), seen.index(key, seen.filter(key, kind))
    k = case.spec.sensor.missed_scans[0] - 1
    here, before = case.sums["error"][f, k, 0, 1], case.sums["ahead"][f, k - 1, 0, 1]
    return float(np.sqrt(here / before))


def over_optimal(seen: Evidence, key: Key, kind: str, component: str) -> Estimate:
    """σ of the last scan over that of generalised least squares on the same plots."""
    axes = seen.case(key).axes
    c = [name for name, _ in axes.coordinates].index(component)
    best = exact.optimal_sigma(axes.t_s, axes.sigma_of_plots[:, c], float(axes.rho[c]), axes.scan_period_s, 2)
    return Estimate(*(float(part / best[0]) for part in _last(seen, key, kind, component)))


def rises(seen: Evidence, key: Key) -> Estimate:
    """σ of the range of growing memory at the end over its least; taken as independent."""
    curve = seen.curve(key, seen.filter(key, "growing_memory"), "r")
    return ratio(curve.last(), curve.least())


def bounded(seen: Evidence, key: Key) -> Estimate:
    """Paired gain in σ of the range of a window of ten plots against growing memory, at the end."""
    case = seen.case(key)
    f, base = (seen.index(key, seen.filter(key, *of)) for of in (("window", 1, 10), ("growing_memory",)))
    if base != case.axes.baseline:
        raise MissingEvidence("gains against growing memory")
    own, other = case.sums["error"][f, -1, 0], case.sums["error"][base, -1, 0]
    return statistics.gain(own[1], own[3], other[1], other[3], case.sums["paired"][f, -1, 0], case.count)


def kept(seen: Evidence, key: Key, algorithm: str) -> float:
    """Numbers that an algorithm keeps from plot to plot."""
    return float(seen.row("operations", algorithm=algorithm)["numbers_kept"])


def cost(seen: Evidence, key: Key, algorithm: str, other: str) -> float:
    """Operations of one algorithm over those of another."""
    one, two = (seen.row("operations", algorithm=name)["operations"] for name in (algorithm, other))
    return float(one / two)
