"""Importance sampling of rare wrong folds: where they lie, and the mixture from which realisations are drawn there.

With its folds given a filter is linear: its whitened innovations ν over the scans are b + L z, z the unit normals of
the realisation. Another sequence of folds, m whole spans away, has the innovations ν + A m. As all sequences share the
covariance, it is the more probable one where

    |ν + A m|² < |ν|²,   which is   (Lᵀ A m)ᵀ z < −(|A m|²/2 + bᵀ A m):

a half-space of z with normal u at distance s from the origin, which has the probability Φ(−s). The right sequence is
not the best where z lies in any of these. It is dropped at an earlier scan where another one is more probable by the
factor 1/prune_below, which moves the half-space away by a known amount. So the mixture is shifted along the unit
vectors u by the distances s of the nearest half-spaces, with shares in proportion to Φ(−s). (Integer least squares and
its pull-in regions: Teunissen, Journal of Geodesy 73, 1999, 587.)

Folded Doppler: the plan of a case, and the sums of a block of realisations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.fields import PLAIN_SHARE
from radarsim.engine.results import Layout
from radarsim.errors import ConfigError
from radarsim.kernels.linear import plain
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.ambiguous_doppler.filters import FoldedAxes
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.noise import noise_key

# ---- rare ------------------------------------------------------------------------------------------------------------
MAX_DISTANCE = 8.0  # σ at which the search ends: once in 10¹⁵
SEARCH_STEP = 0.5  # σ by which the search grows
SEARCH_MARGIN = 1.5  # σ beyond the nearest half-space up to which others count: over 10⁻³ of its probability at five σ
MIN_PROBABILITY_RATIO = 1e-3  # to that of the nearest
MAX_HALF_SPACES, MAX_SEQUENCES = 1000, 300_000  # half-spaces of a mixture, and sequences tried to find them
ORDER_DIGITS = 9  # decimals of distances and units by which half-spaces are sorted


class NoRareFolds(ValueError):
    """No sequence of folds lies near the right one, or too many do."""


@dataclass(frozen=True)
class LinearInnovations:
    """Whitened innovations (K, 2) of range and velocity, as ν = b + L z + A m."""

    constant: np.ndarray  #: b (K, 2)
    normals: np.ndarray  #: L (K, 2, 2 + 2K)
    folds: np.ndarray  #: A (K, 2, K), of one span at each scan

    def until(self, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """b (2k,), L (2k, 2 + 2K) and A (2k, k) of the first k scans."""
        return (
            self.constant[:k].reshape(2 * k),
            self.normals[:k].reshape(2 * k, -1),
            self.folds[:k, :, :k].reshape(2 * k, k),
        )


class HalfSpaces(NamedTuple):
    """The half-spaces uᵀz > s of wrong folds: units u (M, 2 + 2K) and distances s (M,), the nearest first."""

    units: np.ndarray
    distance: np.ndarray


def linear_innovations(world: records.World, spec: Any, options: Any) -> LinearInnovations:
    """A filter's innovations as a linear function of the normals and of the spans by which folds are wrong."""
    (member,) = filters.members(options)
    scans = len(world.t)
    gains = filters.kalman_gains(member, spec.prior, world.sigma, spec.radar.scan_period_s, scans)
    column_count = 3 + 2 * scans  # columns: a constant, the normals, the folds
    estimate, innovations = np.zeros((3, column_count + scans)), np.zeros((scans, 2, column_count + scans))
    for k, t in enumerate(world.t):
        plot = np.zeros((2, column_count + scans))
        plot[:, 0] = world.truth[k, :2]
        plot[:, 1:3] = np.array([[t, t**2 / 2], [1.0, t]]) * world.spread
        plot[0, 3 + k] = world.sigma[0]
        plot[1, 3 + scans + k] = world.sigma[1]
        plot[1, column_count + k] = world.spans[k]
        if k == 0:
            estimate[0] = plot[0]  # the first range becomes the estimate: no information on the folds
        else:
            estimate = gains.F @ estimate
            e = plot[0] - estimate[0]
            innovations[k, 0] = e / math.sqrt(gains.range_variance[k])
            estimate = estimate + np.outer(gains.range[k], e)
        e = plot[1] - estimate[1]
        innovations[k, 1] = e / math.sqrt(gains.variance[k])
        estimate = estimate + np.outer(gains.velocity[k], e)
    return LinearInnovations(innovations[:, :, 0], innovations[:, :, 1:column_count], innovations[:, :, column_count:])


def sequence_half_spaces(
    innovations: tuple[np.ndarray, np.ndarray, np.ndarray], m: np.ndarray, depth: float
) -> HalfSpaces:
    """The half-spaces in which sequences m (M, k) are more probable than the right one by a factor exp(depth).

    innovations are b, L and A of k scans."""
    b, L, A = innovations
    shift = m @ A.T
    normal = -shift @ L
    length = np.linalg.norm(normal, axis=1)
    return HalfSpaces(normal / length[:, None], ((shift**2).sum(axis=1) / 2 + shift @ b + depth) / length)


def nearest_fold_half_spaces(innovations: LinearInnovations) -> HalfSpaces:
    """The half-spaces of a filter that takes the nearest fold, scan by scan, with all earlier folds right."""
    by_scan = []
    for k in range(len(innovations.constant)):
        scan_innovations = innovations.constant[k, 1:], innovations.normals[k, 1:], innovations.folds[k, 1:, k : k + 1]
        by_scan.append(sequence_half_spaces(scan_innovations, np.array([[1.0], [-1.0]]), 0.0))
    return concatenated(by_scan)


def concatenated(by_scan: Sequence[HalfSpaces]) -> HalfSpaces:
    """The half-spaces of several scans."""
    return HalfSpaces(*(np.concatenate(arrays) for arrays in zip(*by_scan, strict=True)))


def reduced_bases(innovations: LinearInnovations) -> list[np.ndarray]:
    """Reduced bases (k, k) of the folds of the first k scans, for k = 1, 2, …"""
    reduced: list[np.ndarray] = []
    for k in range(1, len(innovations.constant) + 1):
        start = np.eye(k)
        if reduced:
            start[: k - 1, : k - 1] = reduced[-1]
        reduced.append(filters.reduce_basis(innovations.until(k)[2], start))
    return reduced


def half_spaces_within(
    innovations: LinearInnovations, bases: Sequence[np.ndarray], depth: float, max_distance: float
) -> HalfSpaces:
    """All half-spaces up to a distance: of sequences at the last scan, and of those by which the right one is dropped.

    bases: see `reduced_bases`; depth: logarithm of the factor by which a hypothesis must be more probable for another
    to be dropped. Raises TooManyVectors."""
    by_scan = []
    for k, basis in enumerate(bases, 1):
        required_depth = 0.0 if k == len(innovations.constant) else depth
        first_scans = innovations.until(k)
        # |Lᵀ A m| ≤ ‖L‖ |A m|, so that s ≤ max_distance leaves |A m| no longer than the root of a quadratic.
        reach = float(np.linalg.norm(first_scans[1], 2) * max_distance + np.linalg.norm(first_scans[0]))
        if required_depth >= filters.UNLIMITED_DEPTH or reach**2 < 2 * required_depth:
            continue
        radius = reach + math.sqrt(reach**2 - 2 * required_depth)
        sequences = filters.lattice_vectors(first_scans[2], basis, radius, MAX_SEQUENCES)
        by_scan.append(sequence_half_spaces(first_scans, sequences, required_depth))
    units, distance = concatenated(by_scan)
    return HalfSpaces(units[distance <= max_distance], distance[distance <= max_distance])


def find_half_spaces(innovations: LinearInnovations, options: Any) -> HalfSpaces:
    """The half-spaces of a filter that matter: close to the nearest, and probable compared with it.

    None is for hypotheses that are dropped because more than `hypotheses` are more probable. Raises NoRareFolds."""
    if options.hypotheses == 1:
        return keep_probable(nearest_fold_half_spaces(innovations))
    depth = -math.log(options.prune_below) if options.prune_below > 0 else filters.UNLIMITED_DEPTH
    bases, spaces = reduced_bases(innovations), HalfSpaces(np.zeros((0, 1)), np.zeros(0))
    for max_distance in np.arange(SEARCH_STEP, MAX_DISTANCE + SEARCH_MARGIN + SEARCH_STEP / 2, SEARCH_STEP):
        try:
            spaces = half_spaces_within(innovations, bases, depth, float(max_distance))
        except filters.TooManyVectors:
            if not len(spaces.distance):
                raise NoRareFolds(
                    f"has over {MAX_SEQUENCES:g} sequences of folds near the right one: none is rare"
                ) from None
            break
        if len(spaces.distance) and spaces.distance.min() <= max_distance - SEARCH_MARGIN:
            break
    return keep_probable(spaces)


def keep_probable(spaces: HalfSpaces) -> HalfSpaces:
    """The half-spaces that are probable compared with the nearest, which is first; ties are sorted by their units."""
    probability = probabilities(spaces)
    if not len(probability) or spaces.distance.min() > MAX_DISTANCE:
        raise NoRareFolds(f"has no wrong fold within {MAX_DISTANCE:g} σ: far rarer than 10⁻¹²")
    columns = np.round(np.column_stack([spaces.distance, spaces.units]), ORDER_DIGITS)
    order = np.lexsort(columns.T[::-1])
    order = order[probability[order] >= MIN_PROBABILITY_RATIO * probability.max()][:MAX_HALF_SPACES]
    return HalfSpaces(spaces.units[order], spaces.distance[order])


def probabilities(spaces: HalfSpaces) -> np.ndarray:
    """The probability Φ(−s) of each half-space (M,); the sum is an upper bound of that of a wrong fold."""
    return np.array([math.erfc(s / math.sqrt(2.0)) / 2 for s in spaces.distance])


def wrong_fold_mixture(world: records.World, spec: Any, key: np.ndarray) -> sums.Mixture:
    """The mixture for the wrong folds of the filter at which a case aims, with its share of plain realisations.

    key (2,) is that of its random numbers. Raises NoRareFolds."""
    options = next(options for options in spec.filters if options.name == spec.rare.filter)
    spaces = find_half_spaces(linear_innovations(world, spec, options), options)
    plain_share, probability = PLAIN_SHARE, probabilities(spaces)
    cumulative = np.cumsum([plain_share, *((1.0 - plain_share) * probability / probability.sum())])
    cumulative[-1] = 1.0
    return sums.Mixture(key, cumulative, np.maximum(spaces.distance, 0.0), np.ascontiguousarray(spaces.units))


# ---- study -----------------------------------------------------------------------------------------------------------
COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 512  # 64 groups of eight; some 5 ms with six filters and 15 scans


@dataclass(frozen=True)
class Plan:
    """All that a block needs; see `kernels.records` for the arrays."""

    layout: Layout
    axes: FoldedAxes
    world: records.World
    banks: records.Banks
    mixture: sums.Mixture | None = None
    block: int = BLOCK
    gaussian: bool = False  # a wrong fold is no Gaussian error


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    spec, radar = case.spec, case.spec.radar
    t = np.arange(spec.scans) * radar.scan_period_s
    solves, rates = any(options.doppler == "remainder" for options in spec.filters), len(radar.spans_mps)
    observed = records.World(
        keys=plain([noise_key(case, stream) for stream in ("plots", "detections", "target")], 3, 2, dtype=np.uint64),
        truth=plain(filters.truth(spec.target, t, case.name), spec.scans, 3),
        t=t,
        spread=filters.random_motion_sigma(spec.target),
        sigma=np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        spans=np.resize(np.array(radar.spans_mps), spec.scans),
        rate_index=np.resize(np.arange(len(radar.spans_mps)), spec.scans),
        joint_spans=plain(radar.joint_spans_mps if solves else 0.0, rates, rates),
        detection_probability=float(radar.detection_probability),
    )
    banks = filters.banks(spec, lambda options: combination_numbers(spec, options, observed))
    shapes, labels, mixture = dict(records.shapes(len(spec.filters), spec.scans)), axes(spec, observed, banks), None
    if spec.rare is not None:
        shapes |= {"events": (len(spec.filters), spec.scans, sums.EVENTS, 4), "drawn": (3,)}
        try:
            mixture = wrong_fold_mixture(observed, spec, noise_key(case, "rare"))
        except NoRareFolds as error:
            raise ConfigError(f"{case.name}: rare: {spec.rare.filter} {error}") from None
    return Plan(Layout(**shapes), labels, observed, banks, mixture)


def member_gains(spec: Any, member: filters.Member, observed: records.World) -> filters.Gains:
    """The gains of a member of a filter over the scans of a case."""
    return filters.kalman_gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans)


def combination_numbers(spec: Any, options: Any, observed: records.World) -> np.ndarray:
    """The numbers (K, MAX_MEMBERS, 3) by which a filter combines its members: shares, or half widths of intervals."""
    members = filters.members(options)
    gains = [member_gains(spec, member, observed) for member in members]
    motions = filters.unit_motions(observed.t)
    numbers = np.zeros((spec.scans, records.MAX_MEMBERS, 3))
    if options.combine == "intersection":
        bias, noise = filters.linear_errors(gains, motions, observed.sigma)
        numbers[:, : len(members)] = filters.interval_widths(bias, noise, members, spec.prior)
    elif options.combine == "expected_error":
        manoeuvres = filters.manoeuvre_motions(options.manoeuvres, observed.t)
        motions = np.concatenate([motions[:1], manoeuvres])
        weight = np.array([spec.prior.sigma_velocity_mps**2, *np.full(len(manoeuvres), 1 / len(manoeuvres))])
        moments = filters.joint_moments(*filters.linear_errors(gains, motions, observed.sigma), weight)
        numbers[:, : len(members)] = filters.best_shares(moments, np.array([member.components for member in members]))
    return numbers


def axes(spec: Any, observed: records.World, banks: records.Banks) -> FoldedAxes:
    """Labels and exact values; these are unknown if plots are missed, as each realisation then has its own gains."""
    shape = (len(spec.filters), spec.scans, 3)
    exact = {
        name: np.full(shape, np.nan) for name in ("sigma", "bias", "oracle_sigma", "best_order", "best_combination")
    }
    exact_right = np.full(shape[:2], np.nan)
    available = np.broadcast_to(np.array([filters.components(options) for options in spec.filters])[:, None], shape)
    if observed.detection_probability == 1:
        for f, options in enumerate(spec.filters):
            values_of_filter = exact_values(spec, options, observed, banks.shares[banks.bank[f]])
            for name, values in values_of_filter.items():
                exact[name][f] = np.where(available[f], values, np.nan)
            exact_right[f] = right_fold_probability(spec, options, observed)
    return FoldedAxes(
        filters=tuple(options.name for options in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=observed.t,
        available=available,
        baseline=banks.baseline,
        exact_sigma=exact["sigma"],
        exact_bias=exact["bias"],
        spans=observed.spans,
        folded=np.array([options.folds for options in spec.filters]),
        remembers=records.keeps_several(banks)[banks.bank],
        combines=np.array([options.combine is not None for options in spec.filters]),
        exact_right=exact_right,
        oracle_sigma=exact["oracle_sigma"],
        best_order=exact["best_order"],
        best_combination=exact["best_combination"],
    )


def right_fold_probability(spec: Any, options: Any, observed: records.World) -> np.ndarray:
    """The exact probability (K,) that a filter's folds are right; not-a-number where it is unknown."""
    if options.doppler == "remainder":
        joint_spans = np.concatenate([[0.0], observed.joint_spans[observed.rate_index[1:], observed.rate_index[:-1]]])
        velocities = observed.truth[:, 1]
        return filters.remainder_probability(
            velocities, observed.spread, observed.t, observed.sigma[1], observed.spans, joint_spans
        )
    if options.hypotheses == 1 and options.combine is None and matches_truth(spec, options):
        (member,) = filters.members(options)
        return filters.nearest_fold_probability(member_gains(spec, member, observed), observed.spans)
    return np.full(spec.scans, np.nan)


def exact_values(spec: Any, options: Any, observed: records.World, shares: np.ndarray) -> dict[str, np.ndarray]:
    """A filter's exact values (K, 3) by their name in `axes`; shares (K, MAX_MEMBERS, 3) as in its bank.

    For a linear filter σ and bias; for one that unfolds σ with all folds right (oracle_sigma). For one that combines
    its members, with all folds right: the smallest σ of a member, and of a linear combination, at each scan."""
    members = filters.members(options)
    gains = [member_gains(spec, member, observed) for member in members]
    motions = np.concatenate([observed.truth[None], filters.unit_motions(observed.t)])
    bias, noise = filters.linear_errors(gains, motions, observed.sigma)
    E = filters.joint_moments(bias, noise, np.array([1.0, *observed.spread**2]))
    estimated = np.array([member.components for member in members])
    best_order = np.sqrt(np.where(estimated, np.einsum("kxii->kix", E), np.inf).min(axis=1))
    exact = {}
    if options.combine:
        best_weights = filters.best_shares(E, estimated)
        exact = {
            "best_order": best_order,
            "best_combination": np.sqrt(np.einsum("kix,kxij,kjx->kx", best_weights, E, best_weights)),
        }
    weights = shares[:, : len(members)] if options.combine == "expected_error" else np.ones((spec.scans, 1, 3))
    if options.combine in (None, "expected_error"):
        sigma = np.sqrt(np.einsum("kix,kxij,kjx->kx", weights, E, weights))
        if options.folds:
            return exact | {"oracle_sigma": sigma}
        return exact | {"sigma": sigma, "bias": np.einsum("kix,ikx->kx", weights, bias[0])}
    return exact


def matches_truth(spec: Any, options: Any) -> bool:
    """Whether the filter's model is the truth: a random polynomial with the filter's prior, and no manoeuvre noise."""
    target, prior = spec.target, spec.prior
    return (
        target.kind == "random_polynomial"
        and (options.orders, options.variances) == ((2,), (0,))
        and target.sigma_velocity_mps == prior.sigma_velocity_mps
        and target.sigma_acceleration_mps2 == prior.sigma_acceleration_mps2
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout; with `rare` the usual ones hold plain realisations only."""
    values = np.zeros(plan.layout.size)
    arrays = plan.layout.unpack(values)
    common = records.Sums(**{name: arrays[name] for name in records.Sums._fields})
    if plan.mixture is None:
        sums.simulate_block(plan.world, plan.banks, common, first, count)
    else:
        losses = sums.Losses(arrays["events"], arrays["drawn"])
        sums.simulate_weighted_block(plan.world, plan.banks, plan.mixture, common, losses, first, count)
    return values


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of plain realisations; not-a-number where a filter has not started."""
    return sums.simulate_errors(plan.world, plan.banks, first, count)
