"""Filters over recorded plots, row by row at any times: one order with its hypotheses, and combinations of orders.

Plots of the study: those of one realisation, as a run draws them; its filters over recorded ones, and how likely
these are under a filter."""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from radarsim import physics
from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.errors import PlotFault
from radarsim.kernels import algebra
from radarsim.kernels.algebra import NO_NOISE, TAKE, add_scaled, pack, pack_transition, predicted, predicted_covariance
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.ambiguous_doppler.config import joint_span
from radarsim.studies.ambiguous_doppler.kernels import rows as kernels
from radarsim.studies.ambiguous_doppler.kernels import sums
from radarsim.studies.ambiguous_doppler.kernels.steps import chinese_remainder
from radarsim.studies.ambiguous_doppler.study import COMPONENTS, prepare
from radarsim.studies.interface import BIAS, Draw, Drawn, RecordedPlots, usual_interval_s

# ---- followers -------------------------------------------------------------------------------------------------------
LEAST = 1e-150  # probability of an order: none is ruled out for good
CERTAIN = 4.0  # standard deviations of the velocity's innovation that half a span must hold for the fold to be certain


class Row(NamedTuple):
    """What one row made of a filter: estimate and σ (3,), residuals of range and velocity after the update (2,), and
    the squares of their innovations over their variances (2,); not-a-number where there is none."""

    estimate: np.ndarray
    sigma: np.ndarray
    residual: np.ndarray
    nis: np.ndarray


NOTHING = Row(*np.full((2, 3), np.nan), *np.full((2, 2), np.nan))


def follower(options: Any, spec: Any) -> "Single | Interacting | Combined":
    """What follows a filter's options; it has `step(t, z, v, span)`, which gives a `Row`."""
    if options.combine is None:
        return single(options, spec)
    return (Interacting if options.combine == "likelihood" else Combined)(options, spec)


def single(options: Any, spec: Any) -> "Single":
    """Of a filter of one order."""
    (member,) = filters.members(options)
    return Single(member, options, spec)


def before_plots(one: filters.Member, spec: Any) -> tuple[float, ...]:
    """The packed covariance before the first plot; the range is not in it."""
    velocity, acceleration = filters.prior_variances(one.order, spec.prior)
    return 0.0, 0.0, 0.0, float(velocity), 0.0, float(acceleration)


@lru_cache(maxsize=64)
def _motion(order: int, variance: float, dt: float) -> tuple[np.ndarray, tuple[float, ...], tuple[np.ndarray, ...]]:
    """The matrix F of a motion over dt, and F and Q packed: most intervals of a recording are alike."""
    F, Q = filters.model(order, variance, dt)
    return F, pack_transition(F), pack(Q)


def _kept(w: np.ndarray, options: Any) -> np.ndarray:
    """Which hypotheses are kept, the best first, by the logarithms of their weights, the best one's 0."""
    kept = np.flatnonzero(np.exp(w) >= options.prune_below)
    return kept[np.argsort(-w[kept], kind="stable")[: options.hypotheses]]


def _merged(e: np.ndarray, S: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean and variance (n,) of innovations e (n, folds) by their likelihoods, S (n,); logarithms of these summed."""
    like = -(e**2) / (2 * S[..., None])
    most = like.max(axis=-1)
    p = np.exp(like - most[..., None])
    total = p.sum(axis=-1)
    p /= total[..., None]
    mean = (p * e).sum(axis=-1)
    return mean, (p * (e - mean[..., None]) ** 2).sum(axis=-1), most + np.log(total)


class Folds:
    """What a velocity may have been before it was folded: by the span of its row, or by those of two rows."""

    def __init__(self, radar: Any):
        self.radar = radar
        self.span = np.nan  # of this row
        self.before: tuple[float, float] | None = None  # the velocity of the last plot, and its span

    def begin(self, t: float, span: float) -> None:
        """Begin a row, whose span stands beside it or follows from its time."""
        spans = self.radar.spans_mps
        self.span = spans[round(t / self.radar.scan_period_s) % len(spans)] if np.isnan(span) else span

    def folded(self, e: np.ndarray) -> np.ndarray:
        """Innovations with the nearest folds."""
        return e - self.span * np.rint(e / self.span)

    def near(self, S: np.ndarray | float, count: int) -> int:
        """How many folds to either side of the nearest may matter, of `count` innovations of variances S (...). Raises
        PlotFault where these are too many, or the variances are only rounding errors."""
        most = float(np.max(S))
        if not most > 0:
            raise PlotFault("velocity_mps: a filter's numbers are lost in rounding: split the file here")
        if 2 * kernels.FARTHEST * math.sqrt(most) / self.span * count > kernels.MAX_SEQUENCES:
            sigma, few = f"its σ before, {math.sqrt(most):g} m/s", f"{kernels.MAX_SEQUENCES:g} sequences"
            raise PlotFault(f"velocity_mps: {sigma}, leaves more than {few} of folds by {self.span:g} m/s")
        return kernels.nearby_folds(most, self.span)

    def innovations(self, e: np.ndarray, S: np.ndarray) -> np.ndarray:
        """Innovations e + n D (..., folds) of the folds that matter; e (...) as measured, S (...) variances."""
        farthest = self.near(S, e.size)
        return self.folded(e)[..., None] + self.span * np.arange(-farthest, farthest + 1)

    def certain(self, S: float) -> bool:
        """Whether an innovation of that variance leaves but one fold."""
        return 2 * CERTAIN * np.sqrt(S) <= self.span

    def remainder(self, v: float) -> float:
        """The velocity by the Chinese remainder of this row and the last with a plot; not-a-number: there is none."""
        v = math.remainder(v, self.span)
        before, self.before = self.before, (v, self.span)
        joint = joint_span(self.span, before[1]) if before else 0.0
        if before is None or joint == 0:
            return np.nan
        return chinese_remainder(v, self.span, *before, joint)


class Single:
    """One filter: states (3, n) of its hypotheses, logarithms of their weights (n,), the common covariance, packed.
    `sure` is the covariance of right folds, which only merging widens; `last_step` what the filter does at the last row
    with such, None before the first range."""

    def __init__(self, member: filters.Member, options: Any, spec: Any):
        self.member, self.options, self.radar = member, options, spec.radar
        self.folds = Folds(spec.radar)
        self.variances = spec.radar.sigma_range_m**2, spec.radar.sigma_velocity_mps**2
        self.x, self.w = np.zeros((3, 1)), np.zeros(1)
        self.P, self.sure = np.array(before_plots(member, spec)), before_plots(member, spec)
        self.known = np.array(member.components)
        self.last = np.nan
        self.began = self.started = False
        self.last_step: filters.Step | None = None
        self.nis = np.full(2, np.nan)  # of the last row, for range and velocity

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> Row:
        """The estimate after one row; not-a-number before the first range."""
        self.folds.begin(t, span)
        self.nis = np.full(2, np.nan)
        F, gains, known = np.eye(3), [np.zeros(3), np.zeros(3)], self.started
        if self.began:
            F, f, q = _motion(self.member.order, self.member.manoeuvre_variance, t - self.last)
            self.x = np.array(predicted(self.x, f))
            self.P = np.array(predicted_covariance(self.P, f, q))
            self.sure = predicted_covariance(self.sure, f, q)
        self.began, self.last = True, t
        if not np.isnan(z):
            gains[0] = self._take_range(z)
        if self.member.doppler == "remainder" and not np.isnan(v):
            v = self.folds.remainder(v)
        if self.started and not np.isnan(v) and self.member.doppler != "none":
            gains[1] = self._take_velocity(v)
        if not self.started:
            return NOTHING
        self.last_step = filters.Step(F if known else np.eye(3), *gains)
        p = np.exp(self.w - self.w.max())
        p /= p.sum()
        mean = self.x[:, np.argmax(self.w)] if self.options.estimate == "best" else self.x @ p
        variance = np.array([self.P[0], self.P[3], self.P[5]]) + (self.x - mean[:, None]) ** 2 @ p
        estimate, sigma = np.where(self.known, mean, np.nan), np.where(self.known, np.sqrt(variance), np.nan)
        residual = np.array([z, v]) - estimate[:2]
        if self.member.doppler == "folded":
            residual[1] = self.folds.folded(residual[1])
        return Row(estimate, sigma, residual, self.nis)

    def _take_range(self, z: float) -> np.ndarray:
        """Take a range; gives the gains of right folds. Tested is the mean over all hypotheses, by a variance that has
        their spread."""
        R = self.variances[0]
        if not self.started:  # before the first range none is known
            self.x[0] = z
            self.P, self.sure = np.array((R, 0.0, 0.0, *self.P[3:])), (R, 0.0, 0.0, *self.sure[3:])
            self.started = True
            return np.array([1.0, 0.0, 0.0])
        p, e = np.exp(self.w - self.w.max()), z - self.x[0]
        mean = p @ e / p.sum()
        self.nis[0] = mean**2 / (self.P[0] + R + p @ (e - mean) ** 2 / p.sum())
        kernels.take_range(self.x, self.w, self.P, R, z)
        self.sure, gain, _ = TAKE[0](self.sure, R, 1.0)
        return np.array(gain)

    def _take_velocity(self, v: float) -> np.ndarray:
        """Take a velocity, folded or not; gives the gains of right folds. Tested is the most probable hypothesis, where
        its fold is certain."""
        R, S = self.variances[1], float(self.P[3] + self.variances[1])
        e, far = v - self.x[1, np.argmax(self.w)], -1
        if self.member.doppler == "folded":
            e, far = self.folds.folded(e), self.folds.near(S, len(self.w))
        if self.member.doppler != "folded" or self.folds.certain(S):
            self.nis[1] = e**2 / S
        given = v, self.folds.span, far if self.options.hypotheses != 1 else min(far, 0), *keeping(self.options)
        self.x, self.w, _ = kernels.take_velocity(self.x, self.w, self.P, R, *given)
        self.sure, gain, _ = TAKE[1](self.sure, R, 1.0)
        return np.array(gain)


def keeping(options: Any) -> tuple[bool, int, float]:
    """Which hypotheses a filter's options keep: merge, most and least of `take_velocity`."""
    return options.merge == "each_scan", options.hypotheses or 1, options.prune_below or 0.0


class Interacting:
    """Orders combined by likelihood, with a memory of folds or without.

    Of n hypotheses the states (3, n, M), covariances (6, n, M) and probabilities (n, M) of M orders, and logarithms
    of weights (n,). Over a gap the orders pass into each other as often as there were scans. Innovations are those of
    the most probable hypothesis, mean and variance over its orders."""

    def __init__(self, options: Any, spec: Any):
        self.members, self.options, self.radar = filters.members(options), options, spec.radar
        self.folds = Folds(spec.radar)
        many = len(self.members)
        self.variances = spec.radar.sigma_range_m**2, spec.radar.sigma_velocity_mps**2
        self.x, self.w = np.zeros((3, 1, many)), np.zeros(1)
        self.P = np.array([before_plots(one, spec) for one in self.members]).T[:, None]
        self.mu = np.full((1, many), 1 / many)
        self.known = np.any([one.components for one in self.members], axis=0)
        self.last = np.nan
        self.started = False

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> Row:
        """As `Single.step`."""
        self.folds.begin(t, span)
        self.nis = np.full(2, np.nan)
        self._mix(1 if np.isnan(self.last) else max(1, round((t - self.last) / self.radar.scan_period_s)))
        if not np.isnan(self.last):
            models = [filters.model(one.order, one.manoeuvre_variance, t - self.last) for one in self.members]
            F, Q = (np.array(part) for part in zip(*models, strict=True))
            f = pack_transition(F)
            self.x, self.P = np.array(predicted(self.x, f)), np.array(predicted_covariance(self.P, f, pack(Q)))
        self.last = t
        if not np.isnan(z):
            self._take_range(z)
        if self.started and not np.isnan(v) and self.options.doppler != "none":
            self._take_velocity(v)
        if not self.started:
            return NOTHING
        p = np.exp(self.w - self.w.max())
        p = p[:, None] * self.mu / p.sum()
        best = np.argmax(self.w)
        of_best = self.options.estimate == "best"
        mean = self.x[:, best] @ self.mu[best] if of_best else np.einsum("ni,xni->x", p, self.x)
        spread = self.P[[0, 3, 5]] + (self.x - mean[:, None, None]) ** 2
        estimate = np.where(self.known, mean, np.nan)
        sigma = np.where(self.known, np.sqrt(np.einsum("ni,xni->x", p, spread)), np.nan)
        residual = np.array([z, v]) - estimate[:2]
        if self.options.doppler == "folded":
            residual[1] = self.folds.folded(residual[1])
        return Row(estimate, sigma, residual, self.nis)

    def _mix(self, scans: int) -> None:
        """Let the orders pass into each other over so many scans."""
        many = len(self.members)
        once = self.options.stay_probability - (1 - self.options.stay_probability) / (many - 1)
        passes = (1 - once**scans) / many + np.eye(many) * once**scans
        before = self.mu @ passes
        share = passes * self.mu[:, :, None] / before[:, None, :]  # (n, from, to)
        x = np.einsum("nji,xnj->xni", share, self.x)
        apart = self.x[:, :, :, None] - x[:, :, None]  # (3, n, from, to)
        self.P = np.array(algebra.add_spread(NO_NOISE, share, self.P[:, :, :, None], apart)).sum(axis=2)
        self.x, self.mu = x, before

    def _take_range(self, z: float) -> None:
        if not self.started:
            self.x[0], self.P[0], self.P[1:3], self.started = z, self.variances[0], 0.0, True
            return
        e = z - self.x[0]
        P, gain, S = TAKE[0](self.P, self.variances[0], 1.0)
        self._judge(0, e, S)
        self.x, self.P = np.array(add_scaled(self.x, e, gain)), np.array(P)
        self._weigh(np.log(np.maximum(self.mu, LEAST)) - e**2 / (2 * S) - np.log(S) / 2)

    def _judge(self, number: int, e: np.ndarray, S: np.ndarray) -> None:
        """Note the innovations (n, M) of a number and their variances before they are taken in: of a range over all
        hypotheses, of a velocity over the orders of the most probable one."""
        p = np.exp(self.w - self.w.max()) if number == 0 else np.arange(len(self.w)) == np.argmax(self.w)
        p = (p / p.sum())[:, None] * self.mu
        mean = np.sum(p * e)
        variance = np.sum(p * (S + (e - mean) ** 2))
        if number == 1 and self.options.doppler == "folded":
            if not self.folds.certain(float(variance)):
                return
            mean = self.folds.folded(mean)
        self.nis[number] = mean**2 / variance

    def _weigh(self, logs: np.ndarray) -> None:
        """Probabilities of orders and weights of hypotheses from logarithms (n, M) of both together."""
        most = logs.max(axis=1, keepdims=True)
        self.mu = np.exp(logs - most)
        self.w = self.w + most[:, 0] + np.log(self.mu.sum(axis=1))
        self.w -= self.w.max()
        self.mu /= self.mu.sum(axis=1, keepdims=True)

    def _take_velocity(self, v: float) -> None:
        P, gain, S = TAKE[1](self.P, self.variances[1], 1.0)
        e, logs = v - self.x[1], np.log(np.maximum(self.mu, LEAST)) - np.log(S) / 2
        self._judge(1, e, S)
        self.P = np.array(P)
        if self.options.doppler == "unfolded":
            self.x = np.array(add_scaled(self.x, e, gain))
            self._weigh(logs - e**2 / (2 * S))
        elif self.options.merge == "each_scan":
            mean, variance, log_sum = _merged(self.folds.innovations(e, S), S)
            self.x = np.array(add_scaled(self.x, mean, gain))
            self.P = np.array(algebra.add_outer(P, variance, gain))
            self._weigh(logs + log_sum)
        else:
            self._branch(v, np.array(gain), S, logs)

    def _branch(self, v: float, gain: np.ndarray, S: np.ndarray, logs: np.ndarray) -> None:
        """Every hypothesis with every fold near any of its orders; those kept that weigh enough."""
        mean = np.einsum("ni,ni->n", self.mu, self.x[1])
        reach = np.max(np.sqrt(S) + np.abs(self.x[1] - mean[:, None]) / kernels.FARTHEST) ** 2
        u = mean[:, None] + self.folds.innovations(v - mean, reach)
        e = u[:, :, None] - self.x[1][:, None]  # (n, folds, M)
        both = logs[:, None] - e**2 / (2 * S[:, None])
        w = self.w[:, None] + both.max(axis=2) + np.log(np.exp(both - both.max(axis=2, keepdims=True)).sum(axis=2))
        kept = _kept(w.ravel() - w.max(), self.options)
        of, n = np.unravel_index(kept, w.shape)
        self.x, self.P = np.array(add_scaled(self.x[:, of], e[of, n], gain[:, of])), self.P[:, of]
        self.w = self.w[of]
        self._weigh(both[of, n])


class Combined:
    """Orders combined by their expected error, or by intersecting intervals: the members, and their joint errors. The
    errors are those of right folds, by the recursion of `exact`, with the gains that each row had. A manoeuvre may
    begin at each of the last `scans` rows. A combination predicts nothing, so that there are no innovations."""

    def __init__(self, options: Any, spec: Any):
        self.options, self.spec = options, spec
        self.members = filters.members(options)
        self.singles = [Single(member, options, spec) for member in self.members]
        self.known = np.array([member.components for member in self.members])
        self.sigma = np.array([spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps])
        many = len(self.members)
        self.bias, self.noise = np.zeros((2, many, 3)), np.zeros((3 * many, 3 * many))
        self.before = np.zeros((2, 3))
        self.onsets: list[float] = []
        self.first = np.nan

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> Row:
        """As `Single.step`."""
        self.first = t if np.isnan(self.first) else self.first
        estimates = np.array([one.step(t, z, v, span).estimate for one in self.singles])
        now = self._motions(t)
        steps = [one.last_step for one in self.singles if one.last_step is not None]
        if not steps:
            return NOTHING
        self.bias, self.noise = filters.advanced(self.bias, self.noise, self.before, now, steps, self.sigma)
        self.before = now
        many = len(self.members)
        bias, noise = self.bias[:, :, None], self.noise.reshape(1, many, 3, many, 3)
        estimates = np.where(self.known, estimates, 0.0)
        if self.options.combine == "intersection":
            width = filters.widths(bias, noise, self.members, self.spec.prior)[0]
            chosen = [_smoothest(estimates[:, c], width[:, c]) for c in range(3)]
            mean = np.array([estimates[i, c] for c, i in enumerate(chosen)])
            sigma = np.array([width[i, c] for c, i in enumerate(chosen)]) / filters.INTERVAL_SIGMAS
        else:
            weight = np.full(len(bias) - 1, 1 / self.spec.scans)
            weight[0] = self.spec.prior.sigma_velocity_mps**2
            E = filters.joint(np.delete(bias, 1, axis=0), noise, weight)
            share = filters.best_shares(E, self.known)[0]
            mean = np.einsum("ix,ix->x", share, estimates)
            sigma = np.sqrt(np.einsum("ix,xij,jx->x", share, E[0], share))
        known = self.known.any(axis=0)
        estimate, residual = np.where(known, mean, np.nan), np.array([z, v]) - np.where(known, mean, np.nan)[:2]
        if self.options.doppler == "folded":
            residual[1] = self.singles[0].folds.folded(residual[1])
        return Row(estimate, np.where(known, sigma, np.nan), residual, np.full(2, np.nan))

    def _motions(self, t: float) -> np.ndarray:
        """What each motion is at a row (M, 3): a drawn velocity and acceleration of one, and the manoeuvres."""
        drawn = filters.drawn_motions(np.array([t - self.first]))[:, 0]
        if self.options.combine != "expected_error":
            return drawn
        if len(self.onsets) == self.spec.scans:
            self.onsets.pop(0)
            self.bias, self.before = np.delete(self.bias, 2, axis=0), np.delete(self.before, 2, axis=0)
        self.onsets.append(t)
        self.bias = np.concatenate([self.bias, np.zeros((1, *self.bias.shape[1:]))])
        self.before = np.concatenate([self.before, np.zeros((1, 3))])
        of = self.options.manoeuvres
        size, length = of.acceleration_mps2, of.duration_s
        flown = [physics.acceleration_pulse((0.0,), size, onset, length, np.array([t]))[0] for onset in self.onsets]
        return np.concatenate([drawn, flown])


def _smoothest(estimates: np.ndarray, widths: np.ndarray) -> int:
    """The smoothest of estimates (I,) whose interval meets those of all rougher; widths (I,) half, 0: not there."""
    chosen, low, high = 0, -np.inf, np.inf
    for i in np.argsort(-widths, kind="stable"):
        low, high = max(low, estimates[i] - widths[i]), min(high, estimates[i] + widths[i])
        if widths[i] == 0 or low > high:
            break
        chosen = int(i)
    return chosen


# ---- track -----------------------------------------------------------------------------------------------------------
COLUMNS = ("t_s", "range_m", "velocity_mps")
SPAN = "span_mps"  # a further column: what each velocity is ambiguous by, where the file says so
MEASURED = (("range_m", "m"), ("velocity_mps", "m/s"))
LEAST_SIGMA, LEAST_MANOEUVRE = 1e-4, 1e-6  # of the stated values, which count as zero


def drawing(case: Case) -> Draw:
    """The plots of realisations of a case, velocity folded."""
    plan = prepare(case)

    def draw(first: int, count: int) -> Drawn:
        plots, truth = sums.simulate_plots(plan.world, first, count)
        columns = {name: plots[..., i] for i, (name, _) in enumerate(MEASURED)}
        return Drawn(plan.axes.t_s, columns, COMPONENTS, truth, first=first)

    return draw


class Tracker:
    """The filters of a case over recorded plots at any times, chunk by chunk in flat memory.

    A recorded velocity counts as folded. A filter that says `unfolded` has no estimate: it needs the true folds, which
    a recording lacks; only where no filter unfolds does it take the velocity as it stands. The span is the one
    beside the velocity in its row, else the config's; with several repetition rates the scan of a row follows from its
    time. Innovations of the velocity are tested where the fold is certain."""

    most_rows: int | None = None
    several: bool = False

    def __init__(self, case: Case):
        own = serving(case.spec)
        self.names = tuple(one.name for one in own)
        self.filters = [follower(one, case.spec) for one in own]
        self.errors = np.array([case.spec.radar.sigma_range_m, case.spec.radar.sigma_velocity_mps])
        # A number that was taken in has drawn the estimate to itself; of another the errors add.
        self.drawn = np.array([[-1.0, 1.0 if one.doppler == "none" else -1.0] for one in own])

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing. Raises PlotFault for a
        row that leaves too many folds, or is beyond a filter's digits."""
        rows = rows_of(columns)
        made = [stepped(one, rows) for one in self.filters]
        gathered = {name: np.array([[getattr(row, name) for row in own] for own in made]) for name in Row._fields}
        spread = self.errors**2 + self.drawn[:, None] * gathered["sigma"][..., :2] ** 2
        finite = np.isfinite(gathered["residual"])
        return Track(
            filters=self.names,
            components=COMPONENTS,
            t_s=columns["t_s"],
            measured=MEASURED,
            tested=tuple((name, 1) for name, _ in MEASURED),
            residual_sigma=np.where(finite, np.sqrt(np.maximum(spread, 0.0)), np.nan),
            **gathered,
        )


def serving(spec: Any) -> list[Any]:
    """The filters that a recording of folded velocities serves: not those that need the true folds."""
    folded = any(one.doppler in ("folded", "remainder") for one in spec.filters)
    return [one for one in spec.filters if one.doppler != "unfolded" or not folded]


def stepped(one: Any, rows: Sequence[tuple[float, ...]]) -> list[Row]:
    """What rows made of a filter, one after the other; raises PlotFault with the row."""
    made: list[Row] = []
    try:
        with np.errstate(invalid="ignore"):  # a variance lost in rounding: not-a-number, which whoever follows refuses
            for row in rows:
                made.append(one.step(*row))
    except PlotFault as fault:
        fault.row = len(made)
        raise
    return made


def rows_of(columns: Mapping[str, np.ndarray]) -> list[tuple[float, ...]]:
    """The rows of recorded plots: time, range, velocity and its span, not-a-number where a value is missing."""
    spans = columns.get(SPAN, np.full(len(columns["t_s"]), np.nan))
    return list(zip(*(columns[name].tolist() for name in COLUMNS), spans.tolist(), strict=True))


class PlotLikelihood:
    """How likely tracks are under a filter: the density that all its hypotheses give each range and velocity, folded
    as it is. The state before the first plot is as the prior says."""

    explains: tuple[str, ...] = (BIAS,)

    def __init__(self, case: Case, options: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Any = case.spec
        self.options, self.filter, self.tracks = options, options.name, len(tracks)
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        radar, number = case.spec.radar, list(case.spec.filters).index(options)
        self.observes = 1 if options.doppler == "none" else 2
        stated = {"radar.sigma_range_m": radar.sigma_range_m, "radar.sigma_velocity_mps": radar.sigma_velocity_mps}
        stated = dict(list(stated.items())[: self.observes])
        stated[f"filters.{number}.manoeuvre_variance"] = options.variances[0]
        self.keys, self.stated = tuple(stated), np.array(list(stated.values()), dtype=float)
        moved = (radar.sigma_velocity_mps / radar.scan_period_s ** options.orders[0]) ** 2  # by a σ in a scan
        self.least = np.array([LEAST_SIGMA] * self.observes + [LEAST_MANOEUVRE]) * np.append(
            self.stated[: self.observes], self.stated[-1] or moved
        )
        if self.observes == 1:
            self.explains = ()
        (self.member,) = filters.members(options)
        self.problems = [self._problem(columns) for columns in tracks]

    def _problem(self, columns: Mapping[str, np.ndarray]) -> "_Problem":
        """A track for the kernel."""
        dt = np.diff(columns["t_s"], prepend=columns["t_s"][0])
        steps, of = np.unique(dt, return_inverse=True)
        motions = [_motion(self.member.order, 1.0, step) for step in steps.tolist()]
        f, q = (np.array([motion[i] for motion in motions], dtype=float)[of] for i in (1, 2))
        rows = np.array(rows_of(columns))
        folds = Folds(self.spec.radar)
        for row in rows:
            folds.begin(row[0], row[3])
            row[3] = folds.span
        return _Problem(f, q, rows[:, 1:])

    def _scores(self, values: np.ndarray, bias: float) -> np.ndarray:
        """Sums (2,) over all tracks for range and velocity; minus infinity where a filter cannot take a row."""
        sigma = np.ones(2)
        sigma[: self.observes] = values[: self.observes]
        reach = (1 if self.options.hypotheses == 1 else 2) if self.member.doppler == "folded" else 0
        prior, total = np.array(before_plots(self.member, self.spec)), np.zeros(2)
        for one in self.problems:
            score = np.empty((len(one.rows), 2))
            rows = self._velocities(one.rows, bias * sigma[1])
            there = np.isfinite(rows[:, :2])
            given = np.where(np.isfinite(rows), rows, 0.0), there, prior, sigma**2, float(values[-1])
            if not kernels.log_likelihood(one.F, one.Q, *given, reach, *keeping(self.options), score):
                return np.full(2, -np.inf)
            total += score.sum(axis=0)
        return total

    def _velocities(self, rows: np.ndarray, offset: float) -> np.ndarray:
        """The rows (n, 3) with velocities as the filter takes them, less an offset."""
        moved = rows.copy()
        moved[:, 1] -= offset
        if self.member.doppler == "none":
            moved[:, 1] = np.nan
        if self.member.doppler == "remainder":
            folds = Folds(self.spec.radar)
            for i in np.flatnonzero(np.isfinite(moved[:, 1])):
                folds.span = moved[i, 2]
                moved[i, 1] = folds.remainder(moved[i, 1])
        return moved

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; outliers are not allowed for; bias: of the velocity, in its σ."""
        return float(self._scores(values, bias).sum())

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The sums of range and velocity."""
        return {
            name: float(part)
            for (name, _), part in zip(MEASURED[: self.observes], self._scores(values, 0.0), strict=False)
        }


class _Problem(NamedTuple):
    """A track for the kernel: motions F (n, 5) and Q (n, 6) to each row, of unit variance, and rows (n, 3) of range,
    velocity and its span."""

    F: np.ndarray
    Q: np.ndarray
    rows: np.ndarray


class Recorded(RecordedPlots):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    rows_asked = 300
    from_any_origin = True
    drawing, tracker = staticmethod(drawing), staticmethod(Tracker)

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        return ((*COLUMNS, SPAN), COLUMNS)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        return {"range_m": ("radar.sigma_range_m",), "velocity_mps": ("radar.sigma_velocity_mps",)}

    def scan_period_s(self, spec: Any) -> float:
        return spec.radar.scan_period_s

    def unfolds(self, one: Any = None) -> bool:
        return one is None or one.doppler == "folded"

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood | None:
        known = [one for one in serving(case.spec) if one.combine is None]
        if filter_name is None:  # of what a recording has, velocities that fold, that which keeps most hypotheses
            known = [one for one in known if one.doppler == "folded"] or known
            known.sort(key=lambda one: (one.merge == "never", one.hypotheses or 0, one.estimate == "mean"))
        else:
            known = [one for one in known if one.name == filter_name]
        return PlotLikelihood(case, known[-1], tracks) if known else None
