"""How P1's claims are measured: which case is which of the paper's radars, and the numbers taken from the tables.

Radars are keyed by their number, and found by their accuracies and period, whatever their names."""

import math
from collections.abc import Collection
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from radarsim.papers.authoring import (
    CaseResult,
    Curve,
    Estimate,
    MissingEvidence,
    common_times,
    difference,
    exact_number,
    ratio,
    shipped_spec,
    subtract,
)
from radarsim.papers.authoring import Evidence as GeneralEvidence
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.range_doppler import steady_state, tables

RADARS = {1: (25, 5, 10), 2: (250, 15, 10), 3: (250, 15, 5), 4: (50, 1, 10), 5: (50, 1, 5)}  # σ_r, σ_V, Δt
VARIANCE = 1e-3  # the paper's D_M, (m/s³)²
SPEED_MPS = 300.0  # the paper's example of an ambiguous Doppler frequency
DURATION_S = 140.0  # s: fifteen points at Δt = 10 s
R, RV = ("range",), ("range", "velocity")
COMPONENTS = {"r": "range", "Vr": "velocity", "ar": "acceleration"}
Key = int | tuple[int, float]  # a radar at D_M = 10⁻³, or a radar and its D_M


class Evidence(GeneralEvidence):
    """Finds the paper's radars, and its two filters, by their settings."""

    extremum = 1.0  # point of gain: what differs by less is no material difference, of two times either

    def case(self, key: Any) -> CaseResult:
        """key: the number of a radar (at D_M = 10⁻³), or (number, D_M)."""
        radar, variance = key if isinstance(key, tuple) else (key, VARIANCE)
        for result in self.results:
            if self._radar(result) == radar and math.isclose(variance, self._variance(result)):
                return result
        raise MissingEvidence(key)

    @staticmethod
    def _radar(result: CaseResult) -> int | None:
        """The number of the paper's radar that a case is."""
        radar = shipped_spec(result).radar
        settings = (radar.sigma_range_m, radar.sigma_velocity_mps, radar.scan_period_s)
        return next((number for number, row in RADARS.items() if all(map(math.isclose, settings, row))), None)

    @staticmethod
    def _variance(result: CaseResult) -> float:
        """The manoeuvre variance of the paper's two filters."""
        variance: float = shipped_spec(result).filters[0].manoeuvre_variance
        return variance

    def whole_sigma(self, key: Key, observes: tuple[str, ...], component: str) -> Curve:
        """σ(k) of the filter that observes these, to the end of the run."""
        return self.marked(self.curve(key, self.filter(key, observes), component), key)

    def sigma(self, key: Key, observes: tuple[str, ...], component: str) -> Curve:
        """σ(k) of the filter that observes these, over the paper's fifteen points."""
        return _as_long_as_the_papers(self.whole_sigma(key, observes, component))

    def filter(self, key: Key, observes: tuple[str, ...]) -> str:
        """The name of the filter that observes these."""
        return next(f.name for f in shipped_spec(self.case(key)).filters if f.observes == observes)

    def k_gain(self, radar: Key, component: str) -> Curve:
        """The relative gain K (eq. 17), from the scan at which the filter with velocity has filtered, k ≥ 2. At k = 1
        both filters give the same measured range, and no gain is spoken of."""
        gain = self.marked(self.gain(radar, self.filter(radar, RV), component), radar)
        return _as_long_as_the_papers(gain.since(2))

    def settling(self, key: Key, observes: tuple[str, ...], component: str = "r") -> Estimate:
        """Scan periods from the first plot to settling (5 % of the steady value, for good)."""
        sigma = self.whole_sigma(key, observes, component)
        sigma.last()  # missing where the run is too short to settle in
        axes, c = self.case(key).axes, list(COMPONENTS).index(component)
        f = axes.filters.index(self.filter(key, observes))
        variance = float(axes.manoeuvre_variance[f])
        _, steady = steady_state.steady_state(int(axes.observes[f]), variance, axes.sigma, axes.scan_period_s)
        when = tables.settling(Estimate(sigma.value, sigma.lo, sigma.hi), sigma.t, float(np.sqrt(steady[c, c])))
        return Estimate(*(part / axes.scan_period_s for part in when))

    def marked(self, series: Curve, key: Key) -> Curve:
        """A curve of a case, marked where its run ends before the paper's 140 s."""
        result = self.case(key)
        end = float(result.axes.t_s[-1])
        short = (
            f"{result.name} ends at {end:g} s, the paper's run at {DURATION_S:g} s" if end < DURATION_S - 1e-6 else ""
        )
        return replace(series, short=short)

    def variances(self, radar: int) -> list[float]:
        """The manoeuvre variances at hand for a radar; raises MissingEvidence where there are fewer than two."""
        variances = sorted({self._variance(result) for result in self.results if self._radar(result) == radar})
        if len(variances) < 2:
            raise MissingEvidence(radar)
        return variances


Pick = Literal["largest", "smallest", "first", "last", "when_largest", "scan_of_largest"] | int  # or the scan itself


def _as_long_as_the_papers(series: Curve) -> Curve:
    return series.where(series.t <= DURATION_S + 1e-6)


def _picked(series: Curve, pick: Pick) -> Estimate:
    if pick == "scan_of_largest":
        return series.when_largest("k")
    estimate: Estimate = series.at_scan(pick) if isinstance(pick, int) else getattr(series, pick)()
    return estimate


def gain(
    evidence: Evidence, radar: int, component: str, pick: Pick, since: int = 2, upto: int | None = None
) -> Estimate:
    """A point of a radar's gain over the scans from `since` to `upto`, %."""
    gains = evidence.k_gain(radar, component).since(since)
    return _picked(gains if upto is None else gains.upto(upto), pick)


def extreme_gain(
    evidence: Evidence, *radars: int, extreme: Literal["smallest", "largest"], component: str, pick: Pick
) -> Estimate:
    """The least or the largest of these radars' gains, %."""
    gains = [gain(evidence, radar, component, pick) for radar in radars]
    return min(gains) if extreme == "smallest" else max(gains)


def gain_above(
    evidence: Evidence, *radars: int, component: str, high: int, extreme: Literal["smallest", "largest"], pick: Pick
) -> Estimate:
    """Gain of the first `high` radars, the least or the largest of them, less the largest of the others, points."""
    upper = extreme_gain(evidence, *radars[:high], extreme=extreme, component=component, pick=pick)
    return difference(upper, extreme_gain(evidence, *radars[high:], extreme="largest", component=component, pick=pick))


def lead_at_scans(evidence: Evidence, radar: int, component: str, scans: Collection[int]) -> Estimate:
    """The least gain of a radar at these scans less its largest at any other, points."""
    gains = evidence.k_gain(radar, component)
    is_given_scan = np.isin(gains.k, list(scans))
    return difference(gains.where(is_given_scan).smallest(), gains.where(~is_given_scan).largest())


def smallest_gain_rise(evidence: Evidence, slow: int, fast: int) -> Estimate:
    """The least difference of range gains, fast − slow, at common times."""
    return subtract(*common_times(evidence.k_gain(fast, "r"), evidence.k_gain(slow, "r"))).smallest()


def time_between_extrema(evidence: Evidence, slow: int, fast: int) -> Estimate:
    """Time from one radar's largest range gain to the other's, s; each is all times within a point of the largest.

    Or within as much as the evidence takes for one: 0 for the largest value alone."""
    return gap_in_time(*(_extremum(evidence.k_gain(radar, "r"), evidence.extremum) for radar in (fast, slow)))


def _extremum(gain: Curve, within: float) -> tuple[Estimate, Estimate]:
    """First and last time at which a gain is so near its largest; with intervals, at which it may be."""
    top = gain.largest()
    sure = gain.t[gain.value >= top.value - within]
    likely = gain.t[gain.hi >= top.lo - within]
    return Estimate(sure[0], likely[0], sure[0]), Estimate(sure[-1], sure[-1], likely[-1])


def gap_in_time(span_a: tuple[Estimate, Estimate], span_b: tuple[Estimate, Estimate]) -> Estimate:
    """The gap between two spans of time, 0 where they meet; at least, that of the widest they may be."""
    gap = max(span_a[0].value - span_b[1].value, span_b[0].value - span_a[1].value, 0.0)
    least_gap = max(span_a[0].lo - span_b[1].hi, span_b[0].lo - span_a[1].hi, 0.0)
    return Estimate(float(gap), float(least_gap), float(gap))


def largest_gap(evidence: Evidence, slow: int, fast: int, component: str) -> Estimate:
    """How far two radars' gains lie apart at most, in % of the larger curve's height, over common times."""
    a, b = common_times(evidence.k_gain(fast, component), evidence.k_gain(slow, component))
    gap = subtract(a, b)
    sign = np.sign(gap.value)
    ends = np.where(sign < 0, -gap.hi, gap.lo), np.where(sign < 0, -gap.lo, gap.hi)
    size = Curve(gap.k, gap.t, abs(gap.value), *ends, short=gap.short)
    height = max(a.largest().value, b.largest().value)
    if height <= 0:
        raise MissingEvidence("there is no gain")
    return Estimate(*(100 * max(part, 0.0) / height for part in size.largest()))


def likeness(evidence: Evidence, radar: int, component_a: str, component_b: str) -> Estimate:
    """Correlation over the scans of two components' gains of a radar; half-widths of all points add in squares."""
    a, b = common_times(evidence.k_gain(radar, component_a), evidence.k_gain(radar, component_b))
    a.last()
    value = float(np.corrcoef(a.value, b.value)[0, 1])
    steps = np.diag((a.hi - a.lo) / 2), np.diag((b.hi - b.lo) / 2)
    with np.errstate(invalid="ignore"):  # of one realisation they are infinite
        moved = [np.corrcoef(a.value + step, b.value)[0, 1] for step in steps[0]]
        moved += [np.corrcoef(a.value, b.value + step)[0, 1] for step in steps[1]]
    half = float(np.sqrt(np.sum((np.array(moved) - value) ** 2)))
    return Estimate(value, value - half, value + half)


def gain_by_variance(evidence: Evidence, radar: int) -> Estimate:
    """Final range gain at the greatest D_M at hand less that at the least, points; without its sign."""
    keys = [(radar, evidence.variances(radar)[end]) for end in (0, -1)]
    gains = [evidence.marked(evidence.gain(key, evidence.filter(key, RV), "r"), key) for key in keys]
    change = difference(*(_as_long_as_the_papers(curve).last() for curve in gains))
    return change if change.value >= 0 else Estimate(-change.value, -change.hi, -change.lo)


def ineffective_from(evidence: Evidence, radar: int, stated_s: float) -> Estimate:
    """The first time at which the acceleration gain is gone (zero or a loss); missing where the run is over before
    that time."""
    gains = evidence.k_gain(radar, "ar")
    gains.last()
    if gains.t[-1] < stated_s and gains.value.min() > 0:
        raise MissingEvidence(f"the run of RLS {radar} ends at {gains.t[-1]:g} s, before {stated_s:g} s")
    times_without_gain = [gains.t[part <= 0] for part in (gains.value, gains.lo, gains.hi)]
    return Estimate(*(float(times[0]) if times.size else np.inf for times in times_without_gain))


def loss_scans(evidence: Evidence, radar: int) -> Estimate:
    """Scans at which a radar loses in acceleration; the interval counts the sure ones, and the possible ones."""
    gains = evidence.k_gain(radar, "ar")
    gains.last()
    return Estimate(*(float(np.sum(part < 0)) for part in (gains.value, gains.hi, gains.lo)))


def gain_after_loss(evidence: Evidence, radar: int) -> Estimate:
    """The largest acceleration gain of a radar after its first scan with a loss."""
    gains = evidence.k_gain(radar, "ar")
    lost = np.flatnonzero(gains.value < 0)
    return gains.where(slice(int(lost[0]) + 1 if lost.size else len(gains.k) - 1, None)).largest()


def fall_from_peak(evidence: Evidence, radar: int) -> Estimate:
    """The largest range gain less the last one."""
    return difference(gain(evidence, radar, "r", "largest"), gain(evidence, radar, "r", "last"))


def velocity_gain_rise(evidence: Evidence, radar: int) -> Estimate:
    """The largest rise of the velocity gain over an earlier scan's."""
    gains = evidence.k_gain(radar, "Vr")
    gains.last()
    return max(difference(gains.point(j), gains.where(slice(0, j)).smallest()) for j in range(1, len(gains.k)))


def velocity_gain_fall(evidence: Evidence, radar: int) -> Estimate:
    """The velocity gain at the end less that at its first scan."""
    return difference(gain(evidence, radar, "Vr", "last"), gain(evidence, radar, "Vr", "first"))


def sigma_of(
    evidence: Evidence, radar: int, *others: int, observes: tuple[str, ...], component: str, pick: Pick
) -> Estimate:
    """A point of σ(k) of the first of these radars."""
    return _picked(evidence.sigma(radar, observes, component), pick)


def sigma_change(
    evidence: Evidence, slow: int, fast: int, observes: tuple[str, ...], component: str, pick: Pick
) -> Estimate:
    """σ fast − σ slow of two radars, first or last of each."""
    return difference(*(_picked(evidence.sigma(radar, observes, component), pick) for radar in (fast, slow)))


def largest_rise(evidence: Evidence, radar: int, observes: tuple[str, ...], component: str, since: int) -> Estimate:
    """The largest rise of σ over an earlier scan's from scan `since` on, in % of that; 0 where it never rises."""
    sigma = evidence.sigma(radar, observes, component).since(since)
    sigma.last()
    worst = max(ratio(sigma.point(j), sigma.where(slice(0, j)).smallest(), 100) for j in range(1, len(sigma.k)))
    return Estimate(*(max(part - 100, 0.0) for part in worst))


def final_share(evidence: Evidence, radar: int) -> Estimate:
    """Δσ_r at the end in % of its largest value."""
    differences = range_difference(evidence, radar)
    return ratio(differences.last(), differences.largest(), 100)


def range_difference(evidence: Evidence, radar: int) -> Curve:
    """Δσ_r(k) = σ_r(r) − σ_r(r,V_r), from k = 2.

    Taken as independent: the common noise makes the two errors alike, so the interval is too wide, never too narrow."""
    return subtract(evidence.sigma(radar, R, "r").since(2), evidence.sigma(radar, RV, "r").since(2))


def final_to_fourth(evidence: Evidence, radar: int, observes: tuple[str, ...]) -> Estimate:
    """σ of range at the end in % of that at the 4th scan."""
    sigma = evidence.sigma(radar, observes, "r")
    return ratio(sigma.last(), sigma.at_scan(4), scale=100)


def by_variance(
    evidence: Evidence, radar: int, quantity: Literal["final_range", "settling"], observes: tuple[str, ...]
) -> Estimate:
    """Final σ of the range, or its settling in scan periods, at the least D_M at hand less that at the greatest."""
    keys = [(radar, evidence.variances(radar)[end]) for end in (0, -1)]
    if quantity == "final_range":
        return difference(*(evidence.whole_sigma(key, observes, "r").last() for key in keys))
    small, large = (evidence.settling(key, observes) for key in keys)
    if not np.isfinite(small.value):  # not settled within the run: later than its end
        low = min(small.lo, float(evidence.case(keys[0]).axes.k[-1] - 1))
        return Estimate(np.inf, low - large.hi, np.inf)
    return difference(small, large)


def velocity_lead(evidence: Evidence, radar: int, unit: Literal["scans", "s"]) -> Estimate:
    """How much earlier the filter with velocity has a velocity: in scans, or in seconds."""
    a, b = (evidence.sigma(radar, observes, "Vr") for observes in (R, RV))
    return exact_number(a.k[0] - b.k[0] if unit == "scans" else a.t[0] - b.t[0])


def doppler(evidence: Evidence, radar: int) -> Estimate:
    """Doppler frequency of the paper's 300 m/s in repetition rates."""
    axes = evidence.case(radar).axes
    return exact_number(2 * SPEED_MPS / axes.wavelength_m / axes.repetition_rate_hz)


def c_theta(evidence: Evidence, radar: int) -> Estimate:
    """C_θ (11) of a radar: algebra."""
    return exact_number(evidence.case(radar).axes.C_theta)


def closed_forms(evidence: Evidence, radar: int) -> Estimate:
    """The largest relative difference of (8) and (12), as printed, from the matrices of (5) and (9). Of covariances
    R̄_k drawn at random; an element of (8) counts against the root of the two variances it is between."""
    axes = evidence.case(radar).axes
    dt, theta = axes.scan_period_s, axes.C_theta
    C_M = VARIANCE / RADARS[radar][0] ** 2
    B, Q = transition(dt), manoeuvre_covariance(C_M, dt)
    H, noise = np.eye(2, 3), np.diag([1.0, 1 / (dt**2 * theta)])
    rng, faults = np.random.default_rng(1), []
    for root in rng.normal(size=(50, 3, 3)) / np.array([1, dt, dt**2])[:, None]:
        forecast = B @ (root @ root.T) @ B.T + Q
        spreads = np.sqrt(np.diag(forecast))
        faults.append(np.abs(_forecast(root @ root.T, dt, C_M) - forecast) / np.outer(spreads, spreads))
        gains = forecast @ H.T @ np.linalg.inv(H @ forecast @ H.T + noise)
        faults.append(np.abs(_gains(forecast, noise[1, 1]) / gains - 1))
    return exact_number(max(float(fault.max()) for fault in faults))


def _forecast(R: np.ndarray, dt: float, C_M: float) -> np.ndarray:
    """R̄₀ (3, 3) by (8) from R̄ = [[b, c, e], [c, d, f], [e, f, g]]."""
    (b, c, e), (_, d, f), (_, _, g) = R
    b3 = b + 2 * dt * c + dt**2 * (e + d) + dt**3 * f + dt**4 * g / 4 + dt**6 * C_M / 36
    c3 = c + dt * (e + d) + 1.5 * dt**2 * f + 0.5 * dt**3 * g + dt**5 * C_M / 12
    e3 = e + dt * f + 0.5 * dt**2 * g + dt**4 * C_M / 6
    d3 = d + 2 * dt * f + dt**2 * g + 0.25 * dt**4 * C_M
    f3 = f + dt * g + 0.5 * dt**3 * C_M
    return np.array([[b3, c3, e3], [c3, d3, f3], [e3, f3, g + dt**2 * C_M]])


def _gains(R: np.ndarray, velocity_variance: float) -> np.ndarray:
    """K (3, 2) by (12) from R̄₀ and D_fVr / D_fr."""
    (b, c, e), (_, d, f), _ = R
    b_sum, d_sum = b + 1, d + velocity_variance
    rows = [
        [b * d_sum - c**2, c * (b_sum - b)],
        [c * (d_sum - d), d * b_sum - c**2],
        [e * d_sum - f * c, f * b_sum - e * c],
    ]
    return np.array(rows) / (b_sum * d_sum - c**2)
