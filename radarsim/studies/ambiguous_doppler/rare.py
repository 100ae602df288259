"""Where rare wrong folds come from, and realisations drawn from there: importance sampling across the bisectors.

With the folds given a filter is linear: its whitened innovations ν over the scans are b + L z, z the unit normals of
the realisation. Another sequence of folds, m whole spans away, has the innovations ν + A m, and as all sequences share
the covariance it is the more probable where

    |ν + A m|² < |ν|²,   which is   (Lᵀ A m)ᵀ z < −(|A m|²/2 + bᵀ A m):

a half-space of z, so that it has the probability Φ(−s), with u its normal and s how far it is from the origin.
The right sequence is not the best where z lies in any of them, and is dropped at an earlier scan where one is more
probable by the factor 1/prune_below, which moves the half-space away by a known amount. So the unit vectors u and
distances s of the nearest half-spaces are the mixture's, and shares go with Φ(−s). (Integer least squares and its
pull-in regions: Teunissen, Journal of Geodesy 73, 1999, 587.)
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.rare import PLAIN_SHARE
from radarsim.studies.ambiguous_doppler import exact, filters, lattice
from radarsim.studies.ambiguous_doppler.kernels import rare as kernels
from radarsim.studies.ambiguous_doppler.kernels import records

FARTHEST = 8.0  # σ beyond which nothing is looked for: once in 10¹⁵
STEP = 0.5  # σ by which the search goes on
DEEPER = 1.5  # σ beyond the nearest up to which half-spaces are taken: over 10⁻³ of its probability at five σ
LEAST_CHANCE = 1e-3  # of the nearest's
MOST, MOST_LOOKED_AT = 1000, 300_000  # half-spaces of a mixture, and sequences looked at for them
DIGITS = 9  # of a distance, by which half-spaces are put in order


class NotFound(ValueError):
    """No sequence of folds is near the right one, or too many are."""


@dataclass(frozen=True)
class Linear:
    """Whitened innovations (K, 2) of range and velocity, as ν = b + L z + A m.

    constant b (K, 2); normals L (K, 2, 2 + 2K); folds A (K, 2, K), of one span at each scan.
    """

    constant: np.ndarray
    normals: np.ndarray
    folds: np.ndarray

    def until(self, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """b (2k,), L (2k, 2 + 2K) and A (2k, k) of the first k scans."""
        return (
            self.constant[:k].reshape(2 * k),
            self.normals[:k].reshape(2 * k, -1),
            self.folds[:k, :, :k].reshape(2 * k, k),
        )


class HalfSpaces(NamedTuple):
    """Where wrong folds lie: uᵀz > s, units u (M, 2 + 2K), distances s (M,), the nearest first."""

    units: np.ndarray
    distance: np.ndarray


def linear(world: records.World, spec: Any, one: Any) -> Linear:
    """How a filter's innovations follow from the normals and from folds that are not right."""
    (member,) = filters.members(one)
    scans = len(world.t)
    of = exact.gains(member, spec.prior, world.sigma, spec.radar.scan_period_s, scans)
    drawn = 3 + 2 * scans  # columns: a constant, the normals, the folds
    estimate, made = np.zeros((3, drawn + scans)), np.zeros((scans, 2, drawn + scans))
    for k, t in enumerate(world.t):
        plot = np.zeros((2, drawn + scans))
        plot[:, 0] = world.truth[k, :2]
        plot[:, 1:3] = np.array([[t, t**2 / 2], [1.0, t]]) * world.spread
        plot[0, 3 + k] = world.sigma[0]
        plot[1, 3 + scans + k] = world.sigma[1]
        plot[1, drawn + k] = world.spans[k]
        if k == 0:
            estimate[0] = plot[0]  # the first range is taken as it is, and tells nothing of the folds
        else:
            estimate = of.F @ estimate
            e = plot[0] - estimate[0]
            made[k, 0] = e / math.sqrt(of.range_variance[k])
            estimate = estimate + np.outer(of.range[k], e)
        e = plot[1] - estimate[1]
        made[k, 1] = e / math.sqrt(of.variance[k])
        estimate = estimate + np.outer(of.velocity[k], e)
    return Linear(made[:, :, 0], made[:, :, 1:drawn], made[:, :, drawn:])


def of_sequences(parts: tuple[np.ndarray, np.ndarray, np.ndarray], m: np.ndarray, depth: float) -> HalfSpaces:
    """The half-spaces in which sequences m (M, k) are more probable than the right one by a factor exp(depth).

    parts are b, L and A of k scans.
    """
    b, L, A = parts
    apart = m @ A.T
    normal = -apart @ L
    length = np.linalg.norm(normal, axis=1)
    return HalfSpaces(normal / length[:, None], ((apart**2).sum(axis=1) / 2 + apart @ b + depth) / length)


def nearest_folds(of: Linear) -> HalfSpaces:
    """Of a filter that takes the nearest fold, scan by scan, with all earlier folds right."""
    found = []
    for k in range(len(of.constant)):
        parts = of.constant[k, 1:], of.normals[k, 1:], of.folds[k, 1:, k : k + 1]
        found.append(of_sequences(parts, np.array([[1.0], [-1.0]]), 0.0))
    return HalfSpaces(np.concatenate([one.units for one in found]), np.concatenate([one.distance for one in found]))


def bases(of: Linear) -> list[np.ndarray]:
    """Reduced bases (k, k) of the folds of the first k scans, k from one on."""
    found: list[np.ndarray] = []
    for k in range(1, len(of.constant) + 1):
        longer = np.eye(k)
        if found:
            longer[: k - 1, : k - 1] = found[-1]
        found.append(lattice.reduced(of.until(k)[2], longer))
    return found


def sequences(of: Linear, known: Sequence[np.ndarray], depth: float, farthest: float) -> HalfSpaces:
    """All half-spaces up to a distance: of the sequences at the last scan, and of those that drop the right one before.

    known are the bases; depth is the logarithm of the factor by which a hypothesis must be more probable to have
    another dropped. Raises lattice.TooMany.
    """
    found = []
    for k, T in enumerate(known, 1):
        own = 0.0 if k == len(of.constant) else depth
        parts = of.until(k)
        # |Lᵀ A m| ≤ ‖L‖ |A m|, so that s ≤ farthest leaves |A m| no longer than the root of a quadratic.
        middle = float(np.linalg.norm(parts[1], 2) * farthest + np.linalg.norm(parts[0]))
        if own >= filters.BOTTOMLESS or middle**2 < 2 * own:
            continue
        radius = middle + math.sqrt(middle**2 - 2 * own)
        found.append(of_sequences(parts, lattice.within(parts[2], T, radius, MOST_LOOKED_AT), own))
    units, distance = np.concatenate([one.units for one in found]), np.concatenate([one.distance for one in found])
    return HalfSpaces(units[distance <= farthest], distance[distance <= farthest])


def half_spaces(of: Linear, one: Any) -> HalfSpaces:
    """Those of a filter that matter, at most MOST: near the nearest, and probable beside it. Raises NotFound.

    Hypotheses that are dropped because more than `hypotheses` are more probable have none.
    """
    if one.hypotheses == 1:
        return probable(nearest_folds(of))
    depth = -math.log(one.prune_below) if one.prune_below > 0 else filters.BOTTOMLESS
    known, found = bases(of), HalfSpaces(np.zeros((0, 1)), np.zeros(0))
    for farthest in np.arange(STEP, FARTHEST + DEEPER + STEP / 2, STEP):
        try:
            found = sequences(of, known, depth, float(farthest))
        except lattice.TooMany:
            if not len(found.distance):
                raise NotFound(
                    f"has over {MOST_LOOKED_AT:g} sequences of folds near the right one: none is rare"
                ) from None
            break
        if len(found.distance) and found.distance.min() <= farthest - DEEPER:
            break
    return probable(found)


def probable(found: HalfSpaces) -> HalfSpaces:
    """Those that matter beside the nearest, it first; equal ones in the order of their units."""
    chance = chances(found)
    if not len(chance) or found.distance.min() > FARTHEST:
        raise NotFound(f"has no wrong fold within {FARTHEST:g} σ: far rarer than 10⁻¹²")
    columns = np.round(np.column_stack([found.distance, found.units]), DIGITS)
    order = np.lexsort(columns.T[::-1])
    order = order[chance[order] >= LEAST_CHANCE * chance.max()][:MOST]
    return HalfSpaces(found.units[order], found.distance[order])


def chances(of: HalfSpaces) -> np.ndarray:
    """The probability (M,) of each, Φ(−s); their sum bounds that of a wrong fold from above."""
    return np.array([math.erfc(s / math.sqrt(2.0)) / 2 for s in of.distance])


def mixture(world: records.World, spec: Any, key: np.ndarray) -> kernels.Mixture:
    """The mixture for the wrong folds of a case's sought filter, with its share of plain realisations.

    key (2,) is that of its random numbers. Raises NotFound.
    """
    one = next(one for one in spec.filters if one.name == spec.rare.filter)
    found = half_spaces(linear(world, spec, one), one)
    plain, shares = PLAIN_SHARE, chances(found)
    cumulative = np.cumsum([plain, *((1.0 - plain) * shares / shares.sum())])
    cumulative[-1] = 1.0
    return kernels.Mixture(key, cumulative, np.maximum(found.distance, 0.0), np.ascontiguousarray(found.units))
