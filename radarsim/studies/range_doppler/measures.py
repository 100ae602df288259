"""How P1's claims are measured: which case is which of the paper's radars, and the numbers taken from the tables.

Radars are keyed by their number; a case counts as the paper's radar when its accuracies, period, filters and manoeuvre
variance are the paper's, whatever its name.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.report import claims
from radarsim.report.claims import Part, Range, Series, certain, common_times, minus, ratio
from radarsim.report.statistics import Estimate, difference
from radarsim.studies.range_doppler import exact, tables

RADARS = {1: (25, 5, 10), 2: (250, 15, 10), 3: (250, 15, 5), 4: (50, 1, 10), 5: (50, 1, 5)}  # σ_r, σ_V, Δt
VARIANCE = 1e-3  # the paper's D_M, (m/s³)²
SPEED_MPS = 300.0  # the paper's example of an ambiguous Doppler frequency
DURATION = 140.0  # s: fifteen points at Δt = 10 s
R, RV = ("range",), ("range", "velocity")
COMPONENTS = {"r": "range", "Vr": "velocity", "ar": "acceleration"}
Key = int | tuple[int, float]  # a radar at D_M = 10⁻³, or a radar and its D_M


class Evidence(claims.Evidence):
    """Finds the paper's radars, and its two filters, by what they are."""

    extremum = 1.0  # point of gain: what differs by less is no material difference, of two times either

    def case(self, key: Any) -> CaseResult:
        """key: the number of a radar (at D_M = 10⁻³), or (number, D_M)."""
        radar, variance = key if isinstance(key, tuple) else (key, VARIANCE)
        for result in self.results:
            if self._radar(result) == radar and math.isclose(variance, self._variance(result)):
                return result
        raise claims.Missing(key)

    @staticmethod
    def _radar(result: CaseResult) -> int | None:
        """The number of the paper's radar that a case is; None for any other, or another target."""
        radar, target = result.spec.radar, result.spec.target
        own = (radar.sigma_range_m, radar.sigma_velocity_mps, radar.scan_period_s)
        fits = target.kind == "polynomial" and not any(target.coefficients[3:]) and radar.as_the_papers
        found = [number for number, row in RADARS.items() if all(map(math.isclose, own, row))]
        return found[0] if found and fits else None

    @staticmethod
    def _variance(result: CaseResult) -> float:
        """The manoeuvre variance of the paper's two filters; not-a-number where they are not these two."""
        filters = result.spec.filters
        plain = all(f.initial_scans == (3 if f.observes == R else 2) for f in filters)
        plain &= all(f.process_noise == "random_jerk" and isinstance(f.manoeuvre_variance, float) for f in filters)
        alike = len({f.manoeuvre_variance for f in filters}) == 1 if plain else False
        if [f.observes for f in filters] != [R, RV] or not (plain and alike) or result.axes.baseline != 0:
            return float("nan")
        return filters[0].manoeuvre_variance

    def whole_sigma(self, key: Key, observes: tuple[str, ...], component: str) -> Series:
        """σ(k) of the filter that observes these, to the end of the run."""
        return self.marked(self.curve(key, self.filter(key, observes), component), key)

    def sigma(self, key: Key, observes: tuple[str, ...], component: str) -> Series:
        """σ(k) of the filter that observes these, over the paper's fifteen points."""
        return _as_long_as_the_papers(self.whole_sigma(key, observes, component))

    def filter(self, key: Key, observes: tuple[str, ...]) -> str:
        """The name of the filter that observes these."""
        return next(f.name for f in self.case(key).spec.filters if f.observes == observes)

    def k_gain(self, radar: Key, component: str) -> Series:
        """The relative gain K (eq. 17), from the scan at which the filter with velocity has filtered, k ≥ 2.

        At k = 1 both filters give the same measured range, and no gain is spoken of.
        """
        gain = self.marked(self.gain(radar, self.filter(radar, RV), component), radar)
        return _as_long_as_the_papers(gain.since(2))

    def settling(self, key: Key, observes: tuple[str, ...], component: str = "r") -> Estimate:
        """Scan periods from the first plot to settling (5 % of the steady value, for good)."""
        sigma = self.whole_sigma(key, observes, component)
        sigma.last()  # missing where the run is too short to settle in
        axes, c = self.case(key).axes, list(COMPONENTS).index(component)
        f = axes.filters.index(self.filter(key, observes))
        variance = float(axes.manoeuvre_variance[f])
        _, steady = exact.steady_state(int(axes.observes[f]), variance, axes.sigma, axes.scan_period_s)
        when = tables.settling(Estimate(sigma.value, sigma.lo, sigma.hi), sigma.t, float(np.sqrt(steady[c, c])))
        return Estimate(*(part / axes.scan_period_s for part in when))

    def marked(self, series: Series, key: Key) -> Series:
        """A curve of a case, marked where its run ends before the paper's 140 s."""
        result = self.case(key)
        end = float(result.axes.t_s[-1])
        short = f"{result.name} ends at {end:g} s, the paper's run at {DURATION:g} s" if end < DURATION - 1e-6 else ""
        return replace(series, short=short)

    def variances(self, radar: int) -> list[float]:
        """The manoeuvre variances at hand for a radar; raises Missing where there are fewer than two."""
        every = {self._variance(result) for result in self.results if self._radar(result) == radar}
        found = sorted(v for v in every if not np.isnan(v))
        if len(found) < 2:
            raise claims.Missing(radar)
        return found


Measure = Callable[[Evidence], Estimate]
Comparison = Callable[[Evidence, int, int], Estimate]  # of a slow and a fast radar
Number = Callable[[Evidence], float]


def _as_long_as_the_papers(series: Series) -> Series:
    return series.where(series.t <= DURATION + 1e-6)


def gain_part(radar: int, component: str, pick: str, what: str, expected: Range, first: int = 2) -> Part:
    """A part on one radar's gain: largest, least, first or last of it from scan `first` on."""
    return Part(
        (radar,),
        f"{what} {COMPONENTS[component]} gain",
        "%",
        lambda seen: getattr(seen.k_gain(radar, component).since(first), pick)(),
        expected,
    )


def faster_part(
    slow: int, fast: int, what: str, unit: str, measure: Comparison, expected: Range, scale: Number | None = None
) -> Part:
    """A part that compares two radars differing only in their period: measure(evidence, slow, fast)."""
    return Part((slow, fast), what, unit, lambda seen: measure(seen, slow, fast), expected, scale)


def gain_raised(seen: Evidence, slow: int, fast: int) -> Estimate:
    """The least difference of range gains, fast − slow, at common times."""
    return minus(*common_times(seen.k_gain(fast, "r"), seen.k_gain(slow, "r"))).least()


def extrema_apart(seen: Evidence, slow: int, fast: int) -> Estimate:
    """Time from one radar's largest range gain to the other's, s; each is all times within a point of the largest.

    Or within as much as the evidence takes for one: 0 for the largest value alone.
    """
    return apart_in_time(*(_extremum(seen.k_gain(radar, "r"), seen.extremum) for radar in (fast, slow)))


def _extremum(gain: Series, within: float) -> tuple[Estimate, Estimate]:
    """First and last time at which a gain is so near its largest; with intervals, at which it may be."""
    top = gain.largest()
    sure = gain.t[gain.value >= top.value - within]
    likely = gain.t[gain.hi >= top.lo - within]
    return Estimate(sure[0], likely[0], sure[0]), Estimate(sure[-1], sure[-1], likely[-1])


def apart_in_time(one: tuple[Estimate, Estimate], other: tuple[Estimate, Estimate]) -> Estimate:
    """The gap between two spans of time, 0 where they meet; at least, that of the widest they may be."""
    gap = max(one[0].value - other[1].value, other[0].value - one[1].value, 0.0)
    least = max(one[0].lo - other[1].hi, other[0].lo - one[1].hi, 0.0)
    return Estimate(float(gap), float(least), float(gap))


def apart(component: str) -> Comparison:
    """How far two radars' gains lie apart at most, in % of the larger curve's height, over common times."""

    def measure(seen: Evidence, slow: int, fast: int) -> Estimate:
        a, b = common_times(seen.k_gain(fast, component), seen.k_gain(slow, component))
        gap = minus(a, b)
        sign = np.sign(gap.value)
        ends = np.where(sign < 0, -gap.hi, gap.lo), np.where(sign < 0, -gap.lo, gap.hi)
        size = Series(gap.k, gap.t, abs(gap.value), *ends, short=gap.short)
        height = max(a.largest().value, b.largest().value)
        if height <= 0:
            raise claims.Missing("there is no gain")
        worst = size.largest()
        return Estimate(*(100 * max(part, 0.0) / height for part in worst))

    return measure


def sigma_change(observes: tuple[str, ...], component: str, pick: str) -> Comparison:
    """σ fast − σ slow of two radars, first or last of each."""

    def measure(seen: Evidence, slow: int, fast: int) -> Estimate:
        a, b = (getattr(seen.sigma(radar, observes, component), pick)() for radar in (fast, slow))
        return difference(a, b)

    return measure


def sigma_of(radar: int, observes: tuple[str, ...], component: str, pick: str) -> Number:
    """σ of a radar, first or last, as what a margin is a share of."""
    return lambda seen: getattr(seen.sigma(radar, observes, component), pick)().value


def largest_rise(radar: int, observes: tuple[str, ...], component: str, since: int) -> Measure:
    """The largest rise of σ over an earlier scan's from scan `since` on, in % of that; 0 where it never rises."""

    def measure(seen: Evidence) -> Estimate:
        sigma = seen.sigma(radar, observes, component).since(since)
        sigma.last()
        rises = [ratio(sigma.point(j), sigma.where(slice(0, j)).least(), 100) for j in range(1, len(sigma.k))]
        worst = max(rises)
        return Estimate(*(max(part - 100, 0.0) for part in worst))

    return measure


def likeness(radar: int, one: str, other: str) -> Measure:
    """Correlation over the scans of two components' gains of a radar; half-widths of all points add in squares."""

    def measure(seen: Evidence) -> Estimate:
        a, b = common_times(seen.k_gain(radar, one), seen.k_gain(radar, other))
        a.last()
        value = float(np.corrcoef(a.value, b.value)[0, 1])
        steps = np.diag((a.hi - a.lo) / 2), np.diag((b.hi - b.lo) / 2)
        with np.errstate(invalid="ignore"):  # of one realisation they are infinite
            moved = [np.corrcoef(a.value + step, b.value)[0, 1] for step in steps[0]]
            moved += [np.corrcoef(a.value, b.value + step)[0, 1] for step in steps[1]]
        half = float(np.sqrt(np.sum((np.array(moved) - value) ** 2)))
        return Estimate(value, value - half, value + half)

    return measure


def gain_by_variance(radar: int) -> Measure:
    """Final range gain at the greatest D_M at hand less that at the least, points; without its sign."""

    def measure(seen: Evidence) -> Estimate:
        found = seen.variances(radar)
        ends = [_as_long_as_the_papers(_gain_at(seen, (radar, v))).last() for v in (found[0], found[-1])]
        of = difference(*ends)
        return of if of.value >= 0 else Estimate(-of.value, -of.hi, -of.lo)

    return measure


def _gain_at(seen: Evidence, key: tuple[int, float]) -> Series:
    return seen.marked(seen.gain(key, seen.filter(key, RV), "r"), key)


def ineffective_from(radar: int, asked_s: float) -> Measure:
    """The first time at which the acceleration gain is gone (zero or a loss); missing where the run is over before
    the time that is asked about.
    """

    def measure(seen: Evidence) -> Estimate:
        gain = seen.k_gain(radar, "ar")
        gain.last()
        if gain.t[-1] < asked_s and gain.value.min() > 0:
            raise claims.Missing(f"the run of RLS {radar} ends at {gain.t[-1]:g} s, before {asked_s:g} s")
        times = []
        for part in (gain.value, gain.lo, gain.hi):
            gone = np.flatnonzero(part <= 0)
            times.append(float(gain.t[gone[0]]) if gone.size else np.inf)
        return Estimate(times[0], times[1], times[2])

    return measure


def least_minus_largest(
    component: str, high: tuple[int, ...], low: tuple[int, ...], pick: str, strict: bool
) -> Measure:
    """Gain of radars `high` less the largest of radars `low`: the least of high (strict), or its largest."""

    def measure(seen: Evidence) -> Estimate:
        upper = [getattr(seen.k_gain(radar, component), pick)() for radar in high]
        lower = [getattr(seen.k_gain(radar, component), pick)() for radar in low]
        return difference((min if strict else max)(upper), max(lower))

    return measure


def final_share(seen: Evidence) -> Estimate:
    """Δσ_r at the end in % of its largest value, RLS 2."""
    apart = range_difference(seen)
    return ratio(apart.last(), apart.largest(), 100)


def range_difference(seen: Evidence) -> Series:
    """Δσ_r(k) = σ_r(r) − σ_r(r,V_r) of RLS 2, from k = 2.

    Taken as independent: the common noise makes the two errors alike, so the interval is too wide, never too narrow.
    """
    return minus(seen.sigma(2, R, "r").since(2), seen.sigma(2, RV, "r").since(2))


def final_to_fourth(observes: tuple[str, ...]) -> Measure:
    """σ of range of RLS 2 at the end in % of that at the 4th scan."""

    def measure(seen: Evidence) -> Estimate:
        sigma = seen.sigma(2, observes, "r")
        return ratio(sigma.last(), sigma.at(4), scale=100)

    return measure


def largest_early(radar: int) -> Measure:
    """The largest acceleration gain up to the fifth scan."""
    return lambda seen: seen.k_gain(radar, "ar").upto(5).largest()


def first_velocity(radar: int) -> Measure:
    """σ of the velocity at the first scan, with velocity."""
    return lambda seen: seen.sigma(radar, RV, "Vr").at(1)


def settling(radar: int) -> Measure:
    """The same of one radar, range only."""
    return lambda seen: seen.settling(radar, R)


def last_range(observes: tuple[str, ...]) -> Callable[[Evidence, Key], Estimate]:
    """σ of the range of the filter that observes these at the end of the run."""
    return lambda seen, key: seen.whole_sigma(key, observes, "r").last()


def settling_of(observes: tuple[str, ...]) -> Callable[[Evidence, Key], Estimate]:
    """Scan periods in which σ of the range of the filter that observes these settles."""
    return lambda seen, key: seen.settling(key, observes)


def by_variance(radar: int, measure: Callable[[Evidence, Key], Estimate]) -> Measure:
    """measure(evidence, key) at the least D_M at hand less that at the greatest."""

    def compared(seen: Evidence) -> Estimate:
        found = seen.variances(radar)
        small, large = (measure(seen, (radar, v)) for v in (found[0], found[-1]))
        if not np.isfinite(small.value):  # not settled within the run: later than its end
            end = float(seen.case((radar, found[0])).axes.k[-1] - 1)
            low = min(small.lo, end)
            return Estimate(np.inf, low - large.hi, np.inf)
        return difference(small, large)

    return compared


def loss_scans(seen: Evidence) -> Estimate:
    """Scans at which RLS 2 loses in acceleration; the interval counts the sure ones, and the possible ones."""
    gain = seen.k_gain(2, "ar")
    gain.last()
    return Estimate(*(float(np.sum(part < 0)) for part in (gain.value, gain.hi, gain.lo)))


def after_loss(seen: Evidence) -> Estimate:
    """The largest acceleration gain of RLS 2 after its first scan with a loss."""
    gain = seen.k_gain(2, "ar")
    lost = np.flatnonzero(gain.value < 0)
    return gain.where(slice(int(lost[0]) + 1 if lost.size else len(gain.k) - 1, None)).largest()


def above_all_others(radar: int, component: str, scans: Collection[int]) -> Measure:
    """The least gain of a radar at these scans less its largest at any other, points."""

    def measure(seen: Evidence) -> Estimate:
        gain = seen.k_gain(radar, component)
        own = np.isin(gain.k, list(scans))
        return difference(gain.where(own).least(), gain.where(~own).largest())

    return measure


def lowest_end(radars: Collection[int], component: str) -> Measure:
    """The least of these radars' final gains, %."""
    return lambda seen: min(seen.k_gain(radar, component).last() for radar in radars)


def after_peak(radar: int) -> Measure:
    """The largest range gain less the last one."""
    return lambda seen: difference((gain := seen.k_gain(radar, "r")).largest(), gain.last())


def rise(radar: int) -> Measure:
    """The largest rise of the velocity gain over an earlier scan's."""

    def measure(seen: Evidence) -> Estimate:
        gain = seen.k_gain(radar, "Vr")
        gain.last()
        later = [difference(gain.point(j), gain.where(slice(0, j)).least()) for j in range(1, len(gain.k))]
        return max(later)

    return measure


def fall(radar: int) -> Measure:
    """The velocity gain at the end less that at its first scan."""

    def measure(seen: Evidence) -> Estimate:
        gain = seen.k_gain(radar, "Vr")
        return difference(gain.last(), gain.first())

    return measure


def earlier(radar: int, unit: str) -> Measure:
    """How much earlier the filter with velocity has a velocity: in scans, or in seconds."""

    def measure(seen: Evidence) -> Estimate:
        a, b = (seen.sigma(radar, observes, "Vr") for observes in (R, RV))
        return certain(float(a.k[0] - b.k[0]) if unit == "scans" else float(a.t[0] - b.t[0]))

    return measure


def doppler(radar: int) -> Measure:
    """Doppler frequency of the paper's 300 m/s in repetition rates."""

    def measure(seen: Evidence) -> Estimate:
        axes = seen.case(radar).axes
        return certain(2 * SPEED_MPS / axes.wavelength_m / axes.repetition_rate_hz)

    return measure


def c_theta(radar: int) -> Measure:
    """C_θ (11) of a radar: algebra."""
    return lambda seen: certain(seen.case(radar).axes.C_theta)


def closed_forms(radar: int) -> Measure:
    """The largest relative difference of (8) and (12), as printed, from the matrices of (5) and (9).

    Of covariances R̄_k drawn at random; an element of (8) counts against the root of the two variances it is between.
    """

    def measure(seen: Evidence) -> Estimate:
        axes = seen.case(radar).axes
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
        return certain(max(float(fault.max()) for fault in faults))

    return measure


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
