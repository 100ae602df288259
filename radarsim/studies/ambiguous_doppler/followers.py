"""Filters over recorded plots, row by row at any times: one order with its hypotheses, and combinations of orders."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra
from radarsim.kernels.kalman_algebra import (
    NO_NOISE,
    TAKE,
    add_scaled,
    pack,
    pack_transition,
    predict_covariance,
    predict_state,
)
from radarsim.physics import targets
from radarsim.studies.ambiguous_doppler import exact_errors, filter_design, scenario
from radarsim.studies.ambiguous_doppler.fold_resolver import FoldResolver
from radarsim.studies.ambiguous_doppler.kernels import recorded_rows

MIN_PROBABILITY = 1e-150  # of an order: none is ruled out for good


class RowResult(NamedTuple):
    """A filter's result for one row; not-a-number where there is none.

    Estimate and σ (3,), residuals of range and velocity after the update (2,), and the squares of their innovations
    over their variances (2,)."""

    estimate: np.ndarray
    sigma: np.ndarray
    residual: np.ndarray
    nis: np.ndarray


NO_ESTIMATE = RowResult(*np.full((2, 3), np.nan), *np.full((2, 2), np.nan))


def make_follower(options: Any, spec: Any) -> "SingleFollower | InteractingFollower | CombiningFollower":
    """The follower of a filter's options; its `step(t, z, v, span)` returns a `RowResult`."""
    if options.combine is None:
        return single_follower(options, spec)
    return (InteractingFollower if options.combine == "likelihood" else CombiningFollower)(options, spec)


def single_follower(options: Any, spec: Any) -> "SingleFollower":
    """The follower of a filter of one order."""
    (member,) = filter_design.members(options)
    return SingleFollower(member, options, spec)


def prior_covariance(member: filter_design.Member, spec: Any) -> tuple[float, ...]:
    """The packed covariance before the first plot, without the range."""
    velocity, acceleration = filter_design.prior_variances(member.order, spec.prior)
    return 0.0, 0.0, 0.0, float(velocity), 0.0, float(acceleration)


@lru_cache(maxsize=64)
def packed_motion(
    order: int, variance: float, dt: float, period: float
) -> tuple[np.ndarray, tuple[float, ...], tuple[np.ndarray, ...]]:
    """The matrix F of a motion over dt, and F and Q packed; cached, as most intervals of a recording are the same."""
    F, Q = filter_design.model_over(order, variance, dt, period)
    return F, pack_transition(F), pack(Q)


def _likeliest(w: np.ndarray, options: Any) -> np.ndarray:
    """The indices of the hypotheses that are kept, the best first; w: logarithms of weights, the best one's 0."""
    indices = np.flatnonzero(np.exp(w) >= options.prune_below)
    return indices[np.argsort(-w[indices], kind="stable")[: options.hypotheses]]


def _merge_innovations(e: np.ndarray, S: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean and variance (n,) of innovations e (n, folds) by likelihood, and the logarithm of its sum; S (n,)."""
    log_likelihoods = -(e**2) / (2 * S[..., None])
    greatest = log_likelihoods.max(axis=-1)
    probability = np.exp(log_likelihoods - greatest[..., None])
    likelihood_sum = probability.sum(axis=-1)
    probability /= likelihood_sum[..., None]
    mean = (probability * e).sum(axis=-1)
    return mean, (probability * (e - mean[..., None]) ** 2).sum(axis=-1), greatest + np.log(likelihood_sum)


class SingleFollower:
    """A filter of one order: states (3, n) of its hypotheses, logarithms of weights (n,), their packed covariance.

    `right_covariance` is that with right folds (`P` is wider if folds are merged); `right_step` is the filter's latest
    scan with right folds, None before the first range."""

    def __init__(self, member: filter_design.Member, options: Any, spec: Any):
        self.member, self.options, self.radar = member, options, spec.radar
        self.folds = FoldResolver(spec.radar)
        self.variances = spec.radar.sigma_range_m**2, spec.radar.sigma_velocity_mps**2
        self.x, self.w = np.zeros((3, 1)), np.zeros(1)
        self.P, self.right_covariance = np.array(prior_covariance(member, spec)), prior_covariance(member, spec)
        self.estimated = np.array(member.components)
        self.last_t = np.nan
        self.has_row = self.has_range = False
        self.right_step: exact_errors.Step | None = None
        self.nis = np.full(2, np.nan)  # of the last row, for range and velocity

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> RowResult:
        """Take one row and return the result; not-a-number before the first range."""
        self.folds.begin_row(t, span)
        self.nis = np.full(2, np.nan)
        F, gains, had_range = np.eye(3), [np.zeros(3), np.zeros(3)], self.has_range
        if self.has_row:
            order, period = self.member.order, self.radar.scan_period_s
            F, f, q = packed_motion(order, self.member.manoeuvre_variance, t - self.last_t, period)
            self.x = np.array(predict_state(self.x, f))
            self.P = np.array(predict_covariance(self.P, f, q))
            self.right_covariance = predict_covariance(self.right_covariance, f, q)
        self.has_row, self.last_t = True, t
        if not np.isnan(z):
            gains[0] = self._take_range(z)
        if self.member.doppler == "remainder" and not np.isnan(v):
            v = self.folds.remainder(v)
        if self.has_range and not np.isnan(v) and self.member.doppler != "none":
            gains[1] = self._take_velocity(v)
        if not self.has_range:
            return NO_ESTIMATE
        self.right_step = exact_errors.Step(F if had_range else np.eye(3), *gains)
        p = np.exp(self.w - self.w.max())
        p /= p.sum()
        mean = self.x[:, np.argmax(self.w)] if self.options.estimate == "best" else self.x @ p
        variance = np.array([self.P[0], self.P[3], self.P[5]]) + (self.x - mean[:, None]) ** 2 @ p
        estimate, sigma = np.where(self.estimated, mean, np.nan), np.where(self.estimated, np.sqrt(variance), np.nan)
        residual = np.array([z, v]) - estimate[:2]
        if self.member.doppler == "folded":
            residual[1] = self.folds.nearest_innovation(residual[1])
        return RowResult(estimate, sigma, residual, self.nis)

    def _take_range(self, z: float) -> np.ndarray:
        """Take a range; returns the gains with right folds.

        The innovation tested is the mean over all hypotheses, with a variance that includes their spread."""
        R = self.variances[0]
        if not self.has_range:  # the first range becomes the estimate
            self.x[0] = z
            self.P, self.right_covariance = (
                np.array((R, 0.0, 0.0, *self.P[3:])),
                (R, 0.0, 0.0, *self.right_covariance[3:]),
            )
            self.has_range = True
            return np.array([1.0, 0.0, 0.0])
        p, e = np.exp(self.w - self.w.max()), z - self.x[0]
        mean = p @ e / p.sum()
        self.nis[0] = mean**2 / (self.P[0] + R + p @ (e - mean) ** 2 / p.sum())
        recorded_rows.take_range(self.x, self.w, self.P, R, z)
        self.right_covariance, gain, _ = TAKE[0](self.right_covariance, R, 1.0)
        return np.array(gain)

    def _take_velocity(self, v: float) -> np.ndarray:
        """Take a velocity, folded or not; returns the gains with right folds.

        The innovation tested is that of the most probable hypothesis, where its fold is certain."""
        R, S = self.variances[1], float(self.P[3] + self.variances[1])
        e, max_fold = v - self.x[1, np.argmax(self.w)], -1
        if self.member.doppler == "folded":
            e, max_fold = self.folds.nearest_innovation(e), self.folds.nearby_count(S, len(self.w))
        if self.member.doppler != "folded" or self.folds.is_certain(S):
            self.nis[1] = e**2 / S
        max_fold = max_fold if self.options.hypotheses != 1 else min(max_fold, 0)
        arguments = v, self.folds.span, max_fold, *list_limits(self.options)
        self.x, self.w, *_ = recorded_rows.take_velocity(self.x, self.w, self.P, R, *arguments, np.zeros(4), 0.0)
        self.right_covariance, gain, _ = TAKE[1](self.right_covariance, R, 1.0)
        return np.array(gain)


def list_limits(options: Any) -> tuple[bool, int, float]:
    """The hypotheses that a filter keeps: merge, max_count and min_ratio of `take_velocity`."""
    return options.merge == "each_scan", options.hypotheses or 1, options.prune_below or 0.0


class InteractingFollower:
    """Orders combined by likelihood, with hypotheses on the folds or without.

    For n hypotheses: states (3, n, M), covariances (6, n, M) and probabilities (n, M) of M orders, and logarithms of
    weights (n,). Over a gap the orders are mixed once for each scan that it would have had. The velocity's innovation
    is that of the most probable hypothesis, with mean and variance over its orders."""

    def __init__(self, options: Any, spec: Any):
        self.members, self.options, self.radar = filter_design.members(options), options, spec.radar
        self.folds = FoldResolver(spec.radar)
        count = len(self.members)
        self.variances = spec.radar.sigma_range_m**2, spec.radar.sigma_velocity_mps**2
        self.x, self.w = np.zeros((3, 1, count)), np.zeros(1)
        self.P = np.array([prior_covariance(member, spec) for member in self.members]).T[:, None]
        self.mu = np.full((1, count), 1 / count)
        self.estimated = np.any([member.components for member in self.members], axis=0)
        self.last_t = np.nan
        self.has_range = False

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> RowResult:
        """As `SingleFollower.step`."""
        self.folds.begin_row(t, span)
        self.nis = np.full(2, np.nan)
        self._mix(1 if np.isnan(self.last_t) else max(1, round((t - self.last_t) / self.radar.scan_period_s)))
        if not np.isnan(self.last_t):
            times = t - self.last_t, self.radar.scan_period_s
            models = [
                filter_design.model_over(member.order, member.manoeuvre_variance, *times) for member in self.members
            ]
            F, Q = (np.array(matrices) for matrices in zip(*models, strict=True))
            f = pack_transition(F)
            self.x, self.P = np.array(predict_state(self.x, f)), np.array(predict_covariance(self.P, f, pack(Q)))
        self.last_t = t
        if not np.isnan(z):
            self._take_range(z)
        if self.has_range and not np.isnan(v) and self.options.doppler != "none":
            self._take_velocity(v)
        if not self.has_range:
            return NO_ESTIMATE
        p = np.exp(self.w - self.w.max())
        p = p[:, None] * self.mu / p.sum()
        best = np.argmax(self.w)
        of_best = self.options.estimate == "best"
        mean = self.x[:, best] @ self.mu[best] if of_best else np.einsum("ni,xni->x", p, self.x)
        spread = self.P[[0, 3, 5]] + (self.x - mean[:, None, None]) ** 2
        estimate = np.where(self.estimated, mean, np.nan)
        sigma = np.where(self.estimated, np.sqrt(np.einsum("ni,xni->x", p, spread)), np.nan)
        residual = np.array([z, v]) - estimate[:2]
        if self.options.doppler == "folded":
            residual[1] = self.folds.nearest_innovation(residual[1])
        return RowResult(estimate, sigma, residual, self.nis)

    def _mix(self, scans: int) -> None:
        """Mix the orders by their transitions over that many scans."""
        count = len(self.members)
        factor = self.options.stay_probability - (1 - self.options.stay_probability) / (count - 1)
        transition = (1 - factor**scans) / count + np.eye(count) * factor**scans
        mixed_mu = self.mu @ transition
        share = transition * self.mu[:, :, None] / mixed_mu[:, None, :]  # (n, from, to)
        x = np.einsum("nji,xnj->xni", share, self.x)
        difference = self.x[:, :, :, None] - x[:, :, None]  # (3, n, from, to)
        self.P = np.array(kalman_algebra.add_spread(NO_NOISE, share, self.P[:, :, :, None], difference)).sum(axis=2)
        self.x, self.mu = x, mixed_mu

    def _take_range(self, z: float) -> None:
        if not self.has_range:
            self.x[0], self.P[0], self.P[1:3], self.has_range = z, self.variances[0], 0.0, True
            return
        e = z - self.x[0]
        P, gain, S = TAKE[0](self.P, self.variances[0], 1.0)
        self._test_innovation(0, e, S)
        self.x, self.P = np.array(add_scaled(self.x, e, gain)), np.array(P)
        self._weigh(np.log(np.maximum(self.mu, MIN_PROBABILITY)) - e**2 / (2 * S) - np.log(S) / 2)

    def _test_innovation(self, quantity: int, e: np.ndarray, S: np.ndarray) -> None:
        """Set `nis` from the innovations e (n, M) of range (0) or velocity (1), of variances S, before the update.

        The mean is over all hypotheses for a range, over the orders of the most probable one for a velocity."""
        p = np.exp(self.w - self.w.max()) if quantity == 0 else np.arange(len(self.w)) == np.argmax(self.w)
        p = (p / p.sum())[:, None] * self.mu
        mean = np.sum(p * e)
        variance = np.sum(p * (S + (e - mean) ** 2))
        if quantity == 1 and self.options.doppler == "folded":
            if not self.folds.is_certain(float(variance)):
                return
            mean = self.folds.nearest_innovation(mean)
        self.nis[quantity] = mean**2 / variance

    def _weigh(self, logs: np.ndarray) -> None:
        """Set probabilities of orders and weights of hypotheses from the logarithms (n, M) of their products."""
        greatest = logs.max(axis=1, keepdims=True)
        self.mu = np.exp(logs - greatest)
        self.w = self.w + greatest[:, 0] + np.log(self.mu.sum(axis=1))
        self.w -= self.w.max()
        self.mu /= self.mu.sum(axis=1, keepdims=True)

    def _take_velocity(self, v: float) -> None:
        P, gain, S = TAKE[1](self.P, self.variances[1], 1.0)
        e, logs = v - self.x[1], np.log(np.maximum(self.mu, MIN_PROBABILITY)) - np.log(S) / 2
        self._test_innovation(1, e, S)
        self.P = np.array(P)
        if self.options.doppler == "unfolded":
            self.x = np.array(add_scaled(self.x, e, gain))
            self._weigh(logs - e**2 / (2 * S))
        elif self.options.merge == "each_scan":
            mean, variance, log_sum = _merge_innovations(self.folds.innovations(e, S), S)
            self.x = np.array(add_scaled(self.x, mean, gain))
            self.P = np.array(kalman_algebra.add_outer(P, variance, gain))
            self._weigh(logs + log_sum)
        else:
            self._branch(v, np.array(gain), S, logs)

    def _branch(self, v: float, gain: np.ndarray, S: np.ndarray, logs: np.ndarray) -> None:
        """Branch every hypothesis over the folds that any of its orders leaves possible, and keep the likeliest."""
        mean = np.einsum("ni,ni->n", self.mu, self.x[1])
        reach = np.max(np.sqrt(S) + np.abs(self.x[1] - mean[:, None]) / recorded_rows.FARTHEST) ** 2
        u = mean[:, None] + self.folds.innovations(v - mean, reach)
        e = u[:, :, None] - self.x[1][:, None]  # (n, folds, M)
        log_weights = logs[:, None] - e**2 / (2 * S[:, None])
        greatest = log_weights.max(axis=2, keepdims=True)
        w = self.w[:, None] + greatest[:, :, 0] + np.log(np.exp(log_weights - greatest).sum(axis=2))
        kept_branches = _likeliest(w.ravel() - w.max(), self.options)
        parents, fold_index = np.unravel_index(kept_branches, w.shape)
        self.x, self.P = (
            np.array(add_scaled(self.x[:, parents], e[parents, fold_index], gain[:, parents])),
            self.P[:, parents],
        )
        self.w = self.w[parents]
        self._weigh(log_weights[parents, fold_index])


class CombiningFollower:
    """Orders combined by their expected error, or by intersecting intervals, with the joint errors of the members.

    The errors are those with right folds, by the recursion of `exact_errors.advance_errors` with the gains of each row.
    A manoeuvre may begin at any of the latest `scans` rows. A combination predicts nothing, and has no innovations."""

    def __init__(self, options: Any, spec: Any):
        self.options, self.spec = options, spec
        self.members = filter_design.members(options)
        self.singles = [SingleFollower(member, options, spec) for member in self.members]
        self.estimated = np.array([member.components for member in self.members])
        self.sigma = np.array([spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps])
        count = len(self.members)
        self.bias, self.noise = np.zeros((2, count, 3)), np.zeros((3 * count, 3 * count))
        self.previous_motions = np.zeros((2, 3))
        self.onsets: list[float] = []
        self.first_t = np.nan

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> RowResult:
        """As `SingleFollower.step`."""
        self.first_t = t if np.isnan(self.first_t) else self.first_t
        estimates = np.array([single.step(t, z, v, span).estimate for single in self.singles])
        motions = self._motions(t)
        steps = [single.right_step for single in self.singles if single.right_step is not None]
        if not steps:
            return NO_ESTIMATE
        self.bias, self.noise = exact_errors.advance_errors(
            self.bias, self.noise, self.previous_motions, motions, steps, self.sigma
        )
        self.previous_motions = motions
        count = len(self.members)
        bias, noise = self.bias[:, :, None], self.noise.reshape(1, count, 3, count, 3)
        estimates = np.where(self.estimated, estimates, 0.0)
        if self.options.combine == "intersection":
            width = exact_errors.interval_widths(bias, noise, self.members, self.spec.prior)[0]
            chosen = [_smoothest(estimates[:, c], width[:, c]) for c in range(3)]
            mean = np.array([estimates[i, c] for c, i in enumerate(chosen)])
            sigma = np.array([width[i, c] for c, i in enumerate(chosen)]) / exact_errors.INTERVAL_SIGMAS
        else:
            weight = np.full(len(bias) - 1, 1 / self.spec.scans)
            weight[0] = self.spec.prior.sigma_velocity_mps**2
            moments = exact_errors.joint_moments(np.delete(bias, 1, axis=0), noise, weight)
            share = exact_errors.best_shares(moments, self.estimated)[0]
            mean = np.einsum("ix,ix->x", share, estimates)
            sigma = np.sqrt(np.einsum("ix,xij,jx->x", share, moments[0], share))
        estimated = self.estimated.any(axis=0)
        estimate, residual = np.where(estimated, mean, np.nan), np.array([z, v]) - np.where(estimated, mean, np.nan)[:2]
        if self.options.doppler == "folded":
            residual[1] = self.singles[0].folds.nearest_innovation(residual[1])
        return RowResult(estimate, np.where(estimated, sigma, np.nan), residual, np.full(2, np.nan))

    def _motions(self, t: float) -> np.ndarray:
        """The motions (M, 3) at a row: those of a unit velocity and a unit acceleration, and the manoeuvres."""
        unit_motions = scenario.unit_motions(np.array([t - self.first_t]))[:, 0]
        if self.options.combine != "expected_error":
            return unit_motions
        if len(self.onsets) == self.spec.scans:
            self.onsets.pop(0)
            self.bias, self.previous_motions = (
                np.delete(self.bias, 2, axis=0),
                np.delete(self.previous_motions, 2, axis=0),
            )
        self.onsets.append(t)
        self.bias = np.concatenate([self.bias, np.zeros((1, *self.bias.shape[1:]))])
        self.previous_motions = np.concatenate([self.previous_motions, np.zeros((1, 3))])
        manoeuvres = self.options.manoeuvres
        size, length = manoeuvres.acceleration_mps2, manoeuvres.duration_s
        manoeuvre_motions = [
            targets.acceleration_pulse((0.0,), size, onset, length, np.array([t]))[0] for onset in self.onsets
        ]
        return np.concatenate([unit_motions, manoeuvre_motions])


def _smoothest(estimates: np.ndarray, widths: np.ndarray) -> int:
    """The smoothest of estimates (I,) whose interval meets those of all rougher ones; half widths (I,), 0: absent."""
    smoothest, low, high = 0, -np.inf, np.inf
    for i in np.argsort(-widths, kind="stable"):
        low, high = max(low, estimates[i] - widths[i]), min(high, estimates[i] + widths[i])
        if widths[i] == 0 or low > high:
            break
        smoothest = int(i)
    return smoothest
