"""How P3's claims find the cases that they mean, and what is measured of smoothing, from tables and sums."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np

from radarsim.papers.authoring import CaseResult, Estimate, MissingEvidence, ratio, shipped_spec
from radarsim.papers.authoring import Evidence as GeneralEvidence
from radarsim.physics.motion import transition
from radarsim.report import statistics
from radarsim.studies.sonar import closed_forms, least_squares
from radarsim.studies.sonar.tables import GAIN_COLUMNS, textbook

MAX_PLOTS = 100
Quantity = Literal["smoothed", "extrapolated", "acceleration"]
Letter = Literal["A", "B"]
Key = str | tuple[str, float]  # a case that claims mean, by name, or by name and a value
Find = Callable[..., CaseResult | None]  # of the results, and of the value where the key has one
CASE_FINDERS: dict[str, Find] = {}  # by name, None where it is not there; the parts' measures say how


class Evidence(GeneralEvidence):
    """Finds the cases of P3 by their keys."""

    def case(self, key: Key) -> CaseResult:
        """The case of a key; raises MissingEvidence."""
        name, *value = (key,) if isinstance(key, str) else key
        result = CASE_FINDERS[str(name)](self.results, *value)
        if result is None:
            raise MissingEvidence((key,))
        return result

    def filter(self, key: Key, kind: str, degree: int = 1, plots: int | None = None) -> str:
        """The name of a case's first filter of that kind, without process noise; raises MissingEvidence."""
        for _, f in self.members(self.case(key)):
            if (f.kind, f.degree) == (kind, degree) and f.plots == plots and not f.manoeuvre_variance:
                return f.name
        raise MissingEvidence((key, kind))

    def index(self, key: Key, name: str) -> int:
        """The index of a filter in the sums."""
        return self.case(key).axes.filters.index(name)


def _kinds(result: CaseResult) -> set[tuple[str, int]]:
    return {(f.kind, f.degree) for f in shipped_spec(result).filters}


def _is_textbook(result: CaseResult) -> bool:
    kinds = {("growing_memory", 1), ("growing_memory", 2), ("kalman", 1)}
    return kinds <= _kinds(result) and textbook(result)


def _is_fluctuating(result: CaseResult) -> bool:
    walks = bool(getattr(shipped_spec(result).target, "fluctuation_mps2", 0.0))
    return walks and ("growing_memory", 1) in _kinds(result) and len(result.axes.k) >= 40


def _is_turning(result: CaseResult) -> bool:
    return (
        shipped_spec(result).target.kind == "turning"
        and ("growing_memory", 1) in _kinds(result)
        and _has_equal_plots(result)
    )


def _has_gap(result: CaseResult) -> bool:
    sensor = shipped_spec(result).sensor
    return bool(sensor.missed_scans) and sensor.detection_probability == 1 and not sensor.further


def _has_several_sonars(result: CaseResult) -> bool:
    return bool(shipped_spec(result).sensor.further)


def _has_equal_plots(result: CaseResult) -> bool:
    """Equal intervals and weights, no miss, long enough."""
    sensor = shipped_spec(result).sensor
    return (
        not (sensor.missed_scans or sensor.further) and sensor.detection_probability == 1 and len(result.axes.k) >= 20
    )


def _first(matches: Callable[[CaseResult], bool]) -> Callable[[Sequence[CaseResult]], CaseResult | None]:
    """The first case in the polar frame that matches."""
    return lambda results: next(
        (result for result in results if shipped_spec(result).frame == "polar" and matches(result)), None
    )


def _correlated(results: Sequence[CaseResult], rho: float) -> CaseResult | None:
    """The case whose plots' errors are correlated to ρ, with both filters that know of it."""
    kinds = {("kalman_augmented", 1), ("kalman_differenced", 1)}

    def matches(result: CaseResult) -> bool:
        return (
            kinds <= _kinds(result)
            and shipped_spec(result).sensor.error_correlation == rho
            and _has_equal_plots(result)
        )

    return _first(matches)(results)


CASE_FINDERS.update(
    textbook=_first(_is_textbook),  # equal intervals and weights, white errors, no miss
    fluctuating=_first(_is_fluctuating),  # a course whose velocity walks at random
    turning=_first(_is_turning),  # a vessel on a straight course at a constant speed, then in a turn
    gap=_first(_has_gap),  # scans that never give a plot, the others always
    asynchronous=_first(_has_several_sonars),
    correlated=_correlated,
)


@cache
def _covariance(n: int, size: int = 2) -> np.ndarray:
    """Covariance (size, size) of the state at the last of n plots, by a factorisation that knows no closed form."""
    return least_squares.generalised_least_squares(np.arange(n, dtype=float), np.eye(n), size)[1]


def _least_squares(quantity: str, n: int) -> float:
    """σ of the smoothed range, of the range extrapolated by a scan, or of the acceleration."""
    if quantity == "acceleration":
        return float(np.sqrt(_covariance(n, 3)[2, 2]))
    F = transition(1.0 if quantity == "extrapolated" else 0.0, 2)
    return float(np.sqrt((F @ _covariance(n) @ F.T)[0, 0]))


def exact_over_formula(evidence: Evidence, key: Key, quantity: str, n: int) -> float:
    """What `over_formula` measures."""
    formula = {
        "smoothed": closed_forms.sigma_smoothed(n),
        "extrapolated": closed_forms.sigma_extrapolated(n) if n > 1 else np.inf,
        "acceleration": closed_forms.sigma_acceleration(n, 1.0) if n > 2 else np.inf,
    }
    return float(_least_squares(quantity, n) / formula[quantity])


def _exact_gain(letter: str, n: int) -> float:
    """A_n or B_n."""
    return float(_covariance(n)[0, "AB".index(letter)])


def exact_gain_over_formula(evidence: Evidence, key: Key, letter: str, n: int) -> float:
    """What `gain_over_formula` measures."""
    return float(_exact_gain(letter, n) / closed_forms.gains_closed(np.array([n]))["AB".index(letter)][0])


def exact_gain_falls(evidence: Evidence, key: Key, letter: str, early: int, late: int) -> float:
    """What `gain_falls` measures."""
    return _exact_gain(letter, late) / _exact_gain(letter, early)


def exact_fewest_plots(evidence: Evidence, key: Key) -> float:
    """What `fewest_plots` measures."""
    return float(next(n for n in range(2, MAX_PLOTS) if _least_squares("extrapolated", n) <= 1))


def exact_more_over_few_plots(
    evidence: Evidence, key: Key, more: int, few: int, quantity: Quantity = "smoothed"
) -> float:
    """What `more_over_few_plots` measures."""
    return _least_squares(quantity, more) / _least_squares(quantity, few)


def exact_window_gain(evidence: Evidence, key: Key) -> float:
    """What `window_gain` measures, by the exact σ of both."""
    return evidence.exactly().gain(key, evidence.filter(key, "window", 1, 10), "r").last().value


def _estimate(row: Mapping[str, Any], name: str, divisor: float = 1.0) -> Estimate:
    """A number of a table with its interval, over a divisor."""
    return Estimate(*(row[key] / divisor for key in (name, f"{name}_lo", f"{name}_hi")))


def _last(evidence: Evidence, key: Key, kind: str, component: str = "r") -> Estimate:
    """σ of the filter of a kind at the last scan."""
    return evidence.curve(key, evidence.filter(key, kind), component).last()


def over_formula(evidence: Evidence, key: Key, quantity: Quantity, n: int) -> Estimate:
    """σ of growing memory after n plots over the paper's formula, of the range."""
    degree = 2 if quantity == "acceleration" else 1
    row = evidence.row("plots", case=evidence.case(key).name, component="r", quantity=quantity, plots=n, degree=degree)
    return _estimate(row, "ratio", row["formula"])


def more_over_few_plots(evidence: Evidence, key: Key, more: int, few: int, quantity: Quantity = "smoothed") -> Estimate:
    """Smoothed or extrapolated σ of growing memory after more plots over that after few; of the same realisations,
    taken as independent."""
    name = evidence.case(key).name
    rows = [evidence.row("plots", case=name, component="r", quantity=quantity, plots=n, degree=1) for n in (more, few)]
    return ratio(_estimate(rows[0], "ratio"), _estimate(rows[1], "ratio"))


def kalman_over_growing_memory(evidence: Evidence, key: Key) -> Estimate:
    """σ of the range at the end, of the Kalman filter without manoeuvre variance over that of growing memory."""
    return ratio(_last(evidence, key, "kalman"), _last(evidence, key, "growing_memory"))


def manoeuvring_kalman_over_growing_memory(evidence: Evidence, key: Key) -> Estimate:
    """The same of the Kalman filter with manoeuvre variance."""
    members = evidence.members(evidence.case(key))
    filter_name = next((f.name for _, f in members if f.kind == "kalman" and f.manoeuvre_variance), None)
    if filter_name is None:
        raise MissingEvidence("no Kalman filter with manoeuvre variance")
    return ratio(evidence.curve(key, filter_name, "r").last(), _last(evidence, key, "growing_memory"))


def kalman_over_augmented(evidence: Evidence, key: Key) -> Estimate:
    """σ of the range at the end, of the Kalman filter that takes errors as independent over the augmented one's."""
    return ratio(_last(evidence, key, "kalman"), _last(evidence, key, "kalman_augmented"))


def over_joint_estimate(evidence: Evidence, key: Key, component: str, n: int) -> Estimate:
    """σ of range or bearing after n plots, each filtered alone, over least squares on both at once."""
    sensor, c = evidence.case(key).spec.sensor, "rb".index(component)
    sigma = np.repeat([sensor.sigma_range_m, sensor.sigma_bearing_rad], n)
    lines = np.kron(np.eye(2), np.column_stack([np.ones(n), np.arange(1 - n, 1)])) / sigma[:, None]
    joint = np.sqrt(np.linalg.inv(lines.T @ lines)[2 * c, 2 * c])
    sigma_alone = evidence.curve(key, evidence.filter(key, "growing_memory"), component).at_scan(n)
    return Estimate(*(float(end / joint) for end in sigma_alone))


def straight_over_linear(evidence: Evidence, key: Key, component: str) -> Estimate:
    """σ of range or bearing of growing memory at the end of a straight leg over that on a linear trajectory."""
    end = evidence.case(key).spec.target.turns[0].start_s
    curves = [
        evidence.curve(case_key, evidence.filter(case_key, "growing_memory"), component)
        for case_key in (key, "textbook")
    ]
    straight, linear = (case_key.where(case_key.t <= end).last() for case_key in curves)
    return ratio(straight, linear)


def fewest_plots(evidence: Evidence, key: Key) -> Estimate:
    """Fewest plots from which the extrapolated σ is no more than a plot's; the ends take σ at those of its interval."""
    name = evidence.case(key).name
    rows = evidence.tables["plots"]
    rows = rows[(rows["case"] == name) & (rows["component"] == "r") & (rows["degree"] == 1)]
    rows = rows[rows["quantity"] == "extrapolated"].sort_values("plots")
    fulfilling = [rows.loc[rows[column] <= 1, "plots"] for column in ("ratio", "ratio_lo", "ratio_hi")]
    return Estimate(*(float(f.iloc[0]) if len(f) else np.inf for f in fulfilling))


def gain_over_formula(evidence: Evidence, key: Key, letter: Letter, n: int) -> Estimate:
    """A_n or B_n as measured, over its closed form."""
    row = _gain_row(evidence, key, n)
    return _estimate(row, GAIN_COLUMNS[letter], row[f"{GAIN_COLUMNS[letter]}_formula"])


def gain_falls(evidence: Evidence, key: Key, letter: Letter, early: int, late: int) -> Estimate:
    """A gain at one number of plots over that at another."""
    late_gain, early_gain = (_estimate(_gain_row(evidence, key, n), GAIN_COLUMNS[letter]) for n in (late, early))
    return ratio(late_gain, early_gain)


def _gain_row(evidence: Evidence, key: Key, n: int) -> Mapping[str, Any]:
    name = evidence.filter(key, "growing_memory")
    return evidence.row("smoothing_gains", case=evidence.case(key).name, filter=name, component="r", plots=n)


def largest_sigma_difference(evidence: Evidence, key: Key, kind_a: str, kind_b: str) -> float:
    """Largest relative difference in σ of the filters of two kinds, range and radial velocity."""
    largest = 0.0
    for component in ("r", "vr"):
        a, b = (evidence.curve(key, evidence.filter(key, kind), component).value for kind in (kind_a, kind_b))
        largest = max(largest, float(np.max(np.abs(a / b - 1))))
    return largest


def printed_sum(evidence: Evidence, key: Key, n: int) -> float:
    """g after n plots of equal weight and interval by the print's formula for any interval, over its closed form."""
    return sum(range(2, n + 1)) / (n * (n - 1) / 2)  # f is the number of plots, the new one with them


def miss_over_extrapolated(evidence: Evidence, key: Key, kind: str) -> float:
    """σ of the range at the first missed scan over σ extrapolated to it from the scan before: of the same
    realisations."""
    case, f = evidence.case(key), evidence.index(key, evidence.filter(key, kind))
    k = case.spec.sensor.missed_scans[0] - 1
    variance_at_miss, variance_extrapolated = case.sums["error"][f, k, 0, 1], case.sums["ahead"][f, k - 1, 0, 1]
    return float(np.sqrt(variance_at_miss / variance_extrapolated))


def over_optimal(evidence: Evidence, key: Key, kind: str, component: str) -> Estimate:
    """σ of the last scan over that of generalised least squares on the same plots."""
    axes = evidence.case(key).axes
    c = [name for name, _ in axes.coordinates].index(component)
    best = least_squares.optimal_sigma(axes.t_s, axes.sigma_of_plots[:, c], float(axes.rho[c]), axes.scan_period_s, 2)
    return Estimate(*(float(part / best[0]) for part in _last(evidence, key, kind, component)))


def last_over_least(evidence: Evidence, key: Key) -> Estimate:
    """σ of the range of growing memory at the end over its least; taken as independent."""
    curve = evidence.curve(key, evidence.filter(key, "growing_memory"), "r")
    return ratio(curve.last(), curve.smallest())


def window_gain(evidence: Evidence, key: Key) -> Estimate:
    """Paired gain in σ of the range of a window of ten plots against growing memory, at the end."""
    case = evidence.case(key)
    f, base = (
        evidence.index(key, evidence.filter(key, *filter_key))
        for filter_key in (("window", 1, 10), ("growing_memory",))
    )
    if base != case.axes.baseline:
        raise MissingEvidence("gains over growing memory")
    moments, base_moments = case.sums["error"][f, -1, 0], case.sums["error"][base, -1, 0]
    return statistics.gain(
        moments[1], moments[3], base_moments[1], base_moments[3], case.sums["paired"][f, -1, 0], case.count
    )


def numbers_kept(evidence: Evidence, key: Key, algorithm: str) -> float:
    """Numbers that an algorithm keeps from plot to plot."""
    return float(evidence.row("operations", algorithm=algorithm)["numbers_kept"])


def operations_ratio(evidence: Evidence, key: Key, algorithm: str, base: str) -> float:
    """Operations of one algorithm over those of another."""
    operations, base_operations = (
        evidence.row("operations", algorithm=name)["operations"] for name in (algorithm, base)
    )
    return float(operations / base_operations)
