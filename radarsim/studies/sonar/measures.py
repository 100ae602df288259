"""How P3's claims are measured: which case is which, by what it is, and the numbers taken from tables and sums."""

from collections.abc import Callable

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import claims, statistics
from radarsim.report.claims import Missing, certain, ratio
from radarsim.report.statistics import Estimate
from radarsim.studies.sonar import exact
from radarsim.studies.sonar.manoeuvre import measures as manoeuvres
from radarsim.studies.sonar.tables import textbook


class Evidence(claims.Evidence):
    """Finds the cases of P3 by what they are.

    Keys: "textbook" (equal intervals and weights, white errors, no miss, growing memory of degree 1 and 2),
    "fluctuating", "gap" (scans that never give a plot, the others always), "asynchronous" (several sonars), ("rho",
    ρ), and those of `sonar_manoeuvre_measures`.
    """

    def case(self, key) -> CaseResult:
        if key in (manoeuvres.WEAK, manoeuvres.STRONG, manoeuvres.EQUAL):
            return manoeuvres.case(self.results, key)
        for result in self.results:
            if result.spec.frame == "polar" and self._is(result, key):
                return result
        raise Missing(key)

    @staticmethod
    def _is(result: CaseResult, key) -> bool:
        sensor, target = result.spec.sensor, result.spec.target
        walks = bool(getattr(target, "fluctuation_mps2", 0.0))
        kinds = {(f.kind, f.degree) for f in result.spec.filters}
        if key == "textbook":
            return textbook(result) and {("growing_memory", 1), ("growing_memory", 2), ("kalman", 1)} <= kinds
        if key == "fluctuating":
            return walks and ("growing_memory", 1) in kinds and len(result.axes.k) >= 40
        if key == "gap":
            return bool(sensor.missed_scans) and sensor.detection_probability == 1 and not sensor.further
        if key == "asynchronous":
            return bool(sensor.further)
        both = {("kalman_augmented", 1), ("kalman_differenced", 1)} <= kinds
        return both and sensor.error_correlation == key[1] and textbook_but_for_correlation(result)

    def filter(self, key, kind: str, degree: int = 1, plots: int | None = None) -> str:
        """The name of a case's first filter of that kind, without process noise; raises Missing."""
        for _, f in self.members(self.case(key)):
            if (f.kind, f.degree) == (kind, degree) and f.plots == plots and not f.manoeuvre_variance:
                return f.name
        raise Missing((key, kind))

    def index(self, key, name: str) -> int:
        """Place of a filter in the sums."""
        return self.case(key).axes.filters.index(name)


def textbook_but_for_correlation(result: CaseResult) -> bool:
    """Equal intervals and weights, no miss, long enough."""
    sensor = result.spec.sensor
    return (
        not (sensor.missed_scans or sensor.further) and sensor.detection_probability == 1 and len(result.axes.k) >= 20
    )


Measure = Callable[[Evidence], Estimate]


def over_formula(what: str, n: int) -> Measure:
    """σ of growing memory after n plots over the paper's formula, of the range."""

    def measure(seen: Evidence) -> Estimate:
        degree = 2 if what == "acceleration" else 1
        row = seen.row("plots", case=seen.case("textbook").name, component="r", what=what, plots=n, degree=degree)
        return Estimate(*(row[key] / row["formula"] for key in ("ratio", "ratio_lo", "ratio_hi")))

    return measure


def enough(seen: Evidence) -> Estimate:
    """Fewest plots from which the extrapolated σ is no more than a plot's; the ends take σ at those of its interval."""
    name = seen.case("textbook").name
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


def _gain_row(seen: Evidence, n: int):
    name = seen.filter("textbook", "growing_memory")
    return seen.row("smoothing_gains", case=seen.case("textbook").name, filter=name, component="r", plots=n)


def alike(seen: Evidence) -> Estimate:
    """Largest relative difference in σ of growing memory and Kalman filter, range and radial velocity."""
    return _difference(seen, "textbook", "growing_memory", "kalman")


def two_ways(rho: float) -> Measure:
    """Largest relative difference in σ of the augmented and the differenced filter."""
    return lambda seen: _difference(seen, ("rho", rho), "kalman_augmented", "kalman_differenced")


def _difference(seen: Evidence, key, one: str, other: str) -> Estimate:
    largest = 0.0
    for component in ("r", "vr"):
        a, b = (seen.curve(key, seen.filter(key, kind), component).value for kind in (one, other))
        largest = max(largest, float(np.max(np.abs(a / b - 1))))
    return certain(largest)


def at_a_miss(kind: str) -> Measure:
    """σ of the range at the first missed scan over σ extrapolated to it from the scan before: of the same
    realisations.
    """

    def measure(seen: Evidence) -> Estimate:
        case, f = seen.case("gap"), seen.index("gap", seen.filter("gap", kind))
        k = case.spec.sensor.missed_scans[0] - 1
        here, before = case.sums["error"][f, k, 0, 1], case.sums["ahead"][f, k - 1, 0, 1]
        return certain(np.sqrt(here / before))

    return measure


def over_optimal(key, kind: str, component: str) -> Measure:
    """σ of the last scan over that of generalised least squares on the same plots."""

    def measure(seen: Evidence) -> Estimate:
        case = seen.case(key)
        extra, c = case.axes.extra, [name for name, _ in case.axes.extra["coordinates"]].index(component)
        best = exact.optimal_sigma(
            case.axes.t_s, extra["sigma_of_plots"][:, c], float(extra["rho"][c]), extra["scan_period_s"], 2
        )
        last = seen.curve(key, seen.filter(key, kind), component).last()
        return Estimate(*(float(part / best[0]) for part in last))

    return measure


def rises(seen: Evidence) -> Estimate:
    """σ of the range of growing memory at the end over its least, on the fluctuating course; taken as independent."""
    curve = seen.curve("fluctuating", seen.filter("fluctuating", "growing_memory"), "r")
    return ratio(curve.last(), curve.least())


def bounded(seen: Evidence) -> Estimate:
    """Paired gain in σ of the range of a window of ten plots against growing memory, at the end."""
    case = seen.case("fluctuating")
    f, base = (
        seen.index("fluctuating", seen.filter("fluctuating", *of)) for of in (("window", 1, 10), ("growing_memory",))
    )
    if base != case.axes.baseline:
        raise Missing("gains against growing memory")
    own, other = case.sums["error"][f, -1, 0], case.sums["error"][base, -1, 0]
    return statistics.gain(own[1], own[3], other[1], other[3], case.sums["paired"][f, -1, 0], case.count)


def kept(algorithm: str) -> Measure:
    """Numbers that an algorithm keeps from plot to plot."""
    return lambda seen: certain(seen.row("operations", algorithm=algorithm)["numbers_kept"])


def cost(algorithm: str, other: str) -> Measure:
    """Operations of one algorithm over those of another."""

    def measure(seen: Evidence) -> Estimate:
        one, two = (seen.row("operations", algorithm=name)["operations"] for name in (algorithm, other))
        return certain(one / two)

    return measure
