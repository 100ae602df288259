"""Importance sampling of rare wrong folds: where they lie, and the mixture from which realisations are drawn there.

With its folds given, a filter is linear: its whitened innovations ν over the scans are b + L z, z the unit normals of
the realisation. Another sequence of folds, m whole spans away, has the innovations ν + A m. As all sequences share the
covariance, it is more probable than the right one where

    |ν + A m|² < |ν|²,   which is   (Lᵀ A m)ᵀ z < −(|A m|²/2 + bᵀ A m):

a half-space of z with normal u at distance s from the origin, which has the probability Φ(−s). The right sequence is
not the best where z lies in any of these. It is dropped at an earlier scan where another one is more probable by the
factor 1/prune_below, which moves the half-space away by a known amount. So the mixture is shifted along the unit
vectors u by the distances s of the nearest half-spaces, with shares in proportion to Φ(−s). (Integer least squares and
its pull-in regions: Teunissen, Journal of Geodesy 73, 1999, 587.)"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.rare_event_keys import PLAIN_SHARE
from radarsim.studies.ambiguous_doppler import exact_errors, filter_design, lattice
from radarsim.studies.ambiguous_doppler.kernels import layout, weighted_sums

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


def linear_innovations(world: layout.World, spec: Any, options: Any) -> LinearInnovations:
    """A filter's innovations as a linear function of the normals and of the spans by which folds are wrong."""
    (member,) = filter_design.members(options)
    scans = len(world.t)
    gains = exact_errors.kalman_gains(member, spec.prior, world.sigma, spec.radar.scan_period_s, scans)
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
        reduced.append(lattice.reduce_basis(innovations.until(k)[2], start))
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
        if required_depth >= filter_design.UNLIMITED_DEPTH or reach**2 < 2 * required_depth:
            continue
        radius = reach + math.sqrt(reach**2 - 2 * required_depth)
        sequences = lattice.lattice_vectors(first_scans[2], basis, radius, MAX_SEQUENCES)
        by_scan.append(sequence_half_spaces(first_scans, sequences, required_depth))
    units, distance = concatenated(by_scan)
    return HalfSpaces(units[distance <= max_distance], distance[distance <= max_distance])


def find_half_spaces(innovations: LinearInnovations, options: Any) -> HalfSpaces:
    """The half-spaces of a filter that matter: close to the nearest, and probable compared with it.

    None is for hypotheses that are dropped because more than `hypotheses` are more probable. Raises NoRareFolds."""
    if options.hypotheses == 1:
        return keep_probable(nearest_fold_half_spaces(innovations))
    depth = -math.log(options.prune_below) if options.prune_below > 0 else filter_design.UNLIMITED_DEPTH
    bases, spaces = reduced_bases(innovations), HalfSpaces(np.zeros((0, 1)), np.zeros(0))
    for max_distance in np.arange(SEARCH_STEP, MAX_DISTANCE + SEARCH_MARGIN + SEARCH_STEP / 2, SEARCH_STEP):
        try:
            spaces = half_spaces_within(innovations, bases, depth, float(max_distance))
        except lattice.TooManyVectors:
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


def wrong_fold_mixture(world: layout.World, spec: Any, key: np.ndarray) -> weighted_sums.Mixture:
    """The mixture for the wrong folds of the filter at which a case aims, with its share of plain realisations.

    key (2,) is that of its random numbers. Raises NoRareFolds."""
    options = next(options for options in spec.filters if options.name == spec.rare.filter)
    spaces = find_half_spaces(linear_innovations(world, spec, options), options)
    plain_share, probability = PLAIN_SHARE, probabilities(spaces)
    cumulative = np.cumsum([plain_share, *((1.0 - plain_share) * probability / probability.sum())])
    cumulative[-1] = 1.0
    return weighted_sums.Mixture(key, cumulative, np.maximum(spaces.distance, 0.0), np.ascontiguousarray(spaces.units))
