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
    """Where wrong folds lie: uᵀz > s, units u (M, 2 + 2K), distances s (M,), the nearest first."""

    units: np.ndarray
    distance: np.ndarray


def linear(world: records.World, spec: Any, one: Any) -> Linear:
    """How a filter's innovations follow from the normals and from folds that are not right."""
    (member,) = filters.members(one)
    scans = len(world.t)
    of = filters.gains(member, spec.prior, world.sigma, spec.radar.scan_period_s, scans)
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

    parts are b, L and A of k scans."""
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
        found.append(filters.reduced(of.until(k)[2], longer))
    return found


def sequences(of: Linear, known: Sequence[np.ndarray], depth: float, farthest: float) -> HalfSpaces:
    """All half-spaces up to a distance: of the sequences at the last scan, and of those that drop the right one before.

    known are the bases; depth is the logarithm of the factor by which a hypothesis must be more probable to have
    another dropped. Raises lattice.TooMany."""
    found = []
    for k, T in enumerate(known, 1):
        own = 0.0 if k == len(of.constant) else depth
        parts = of.until(k)
        # |Lᵀ A m| ≤ ‖L‖ |A m|, so that s ≤ farthest leaves |A m| no longer than the root of a quadratic.
        middle = float(np.linalg.norm(parts[1], 2) * farthest + np.linalg.norm(parts[0]))
        if own >= filters.BOTTOMLESS or middle**2 < 2 * own:
            continue
        radius = middle + math.sqrt(middle**2 - 2 * own)
        found.append(of_sequences(parts, filters.within(parts[2], T, radius, MOST_LOOKED_AT), own))
    units, distance = np.concatenate([one.units for one in found]), np.concatenate([one.distance for one in found])
    return HalfSpaces(units[distance <= farthest], distance[distance <= farthest])


def half_spaces(of: Linear, one: Any) -> HalfSpaces:
    """Those of a filter that matter, at most MOST: near the nearest, and probable beside it. Raises NotFound.
    Hypotheses that are dropped because more than `hypotheses` are more probable have none."""
    if one.hypotheses == 1:
        return probable(nearest_folds(of))
    depth = -math.log(one.prune_below) if one.prune_below > 0 else filters.BOTTOMLESS
    known, found = bases(of), HalfSpaces(np.zeros((0, 1)), np.zeros(0))
    for farthest in np.arange(STEP, FARTHEST + DEEPER + STEP / 2, STEP):
        try:
            found = sequences(of, known, depth, float(farthest))
        except filters.TooMany:
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


def mixture_for(world: records.World, spec: Any, key: np.ndarray) -> sums.Mixture:
    """The mixture for the wrong folds of a case's sought filter, with its share of plain realisations.

    key (2,) is that of its random numbers. Raises NotFound."""
    one = next(one for one in spec.filters if one.name == spec.rare.filter)
    found = half_spaces(linear(world, spec, one), one)
    plain, shares = PLAIN_SHARE, chances(found)
    cumulative = np.cumsum([plain, *((1.0 - plain) * shares / shares.sum())])
    cumulative[-1] = 1.0
    return sums.Mixture(key, cumulative, np.maximum(found.distance, 0.0), np.ascontiguousarray(found.units))


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
    solves, rates = any(one.doppler == "remainder" for one in spec.filters), len(radar.spans_mps)
    observed = records.World(
        keys=plain([noise_key(case, what) for what in ("plots", "detections", "target")], 3, 2, dtype=np.uint64),
        truth=plain(filters.truth(spec.target, t, case.name), spec.scans, 3),
        t=t,
        spread=filters.spread(spec.target),
        sigma=np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        spans=np.resize(np.array(radar.spans_mps), spec.scans),
        rate_index=np.resize(np.arange(len(radar.spans_mps)), spec.scans),
        joint_spans=plain(radar.joint_spans_mps if solves else 0.0, rates, rates),
        detection_probability=float(radar.detection_probability),
    )
    banks = filters.banks(spec, lambda one: shares(spec, one, observed))
    shapes, labels, mixture = dict(records.shapes(len(spec.filters), spec.scans)), axes(spec, observed, banks), None
    if spec.rare is not None:
        shapes |= {"events": (len(spec.filters), spec.scans, sums.EVENTS, 4), "drawn": (3,)}
        try:
            mixture = mixture_for(observed, spec, noise_key(case, "rare"))
        except NotFound as error:
            raise ConfigError(f"{case.name}: rare: {spec.rare.filter} {error}") from None
    return Plan(Layout(**shapes), labels, observed, banks, mixture)


def shares(spec: Any, one: Any, observed: records.World) -> np.ndarray:
    """What a filter that combines its members needs, (K, MEMBERS, 3): shares, or half widths of intervals."""
    members = filters.members(one)
    of = [filters.gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans) for member in members]
    drawn = filters.drawn_motions(observed.t)
    made = np.zeros((spec.scans, records.MAX_MEMBERS, 3))
    if one.combine == "intersection":
        bias, noise = filters.errors(of, drawn, observed.sigma)
        made[:, : len(members)] = filters.widths(bias, noise, members, spec.prior)
    elif one.combine == "expected_error":
        manoeuvres = filters.expected_motions(one.manoeuvres, observed.t)
        motions = np.concatenate([drawn[:1], manoeuvres])
        weight = np.array([spec.prior.sigma_velocity_mps**2, *np.full(len(manoeuvres), 1 / len(manoeuvres))])
        E = filters.joint(*filters.errors(of, motions, observed.sigma), weight)
        made[:, : len(members)] = filters.best_shares(E, np.array([member.components for member in members]))
    return made


def axes(spec: Any, observed: records.World, banks: records.Banks) -> FoldedAxes:
    """Labels and exact values; none where plots are missed, as each realisation then has gains of its own."""
    shape = (len(spec.filters), spec.scans, 3)
    known = {
        name: np.full(shape, np.nan) for name in ("sigma", "bias", "oracle_sigma", "best_order", "best_combination")
    }
    right = np.full(shape[:2], np.nan)
    available = np.broadcast_to(np.array([filters.components(one) for one in spec.filters])[:, None], shape)
    if observed.detection_probability == 1:
        for f, one in enumerate(spec.filters):
            found = exact_values(spec, one, observed, banks.shares[banks.bank[f]])
            for name, values in found.items():
                known[name][f] = np.where(available[f], values, np.nan)
            if one.doppler == "remainder":
                joint = np.concatenate([[0.0], observed.joint_spans[observed.rate_index[1:], observed.rate_index[:-1]]])
                velocities = observed.truth[:, 1]
                right[f] = filters.remainders_right(
                    velocities, observed.spread, observed.t, observed.sigma[1], observed.spans, joint
                )
            elif one.hypotheses == 1 and one.combine is None and follows_the_model(spec, one):
                (member,) = filters.members(one)
                of = filters.gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans)
                right[f] = filters.all_right(of, observed.spans)
    return FoldedAxes(
        filters=tuple(one.name for one in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=observed.t,
        available=available,
        baseline=banks.baseline,
        exact_sigma=known["sigma"],
        exact_bias=known["bias"],
        spans=observed.spans,
        folded=np.array([one.folds for one in spec.filters]),
        remembers=records.keeps_several(banks)[banks.bank],
        combines=np.array([one.combine is not None for one in spec.filters]),
        exact_right=right,
        oracle_sigma=known["oracle_sigma"],
        best_order=known["best_order"],
        best_combination=known["best_combination"],
    )


def exact_values(spec: Any, one: Any, observed: records.World, held: np.ndarray) -> dict[str, np.ndarray]:
    """What is known of a filter without sampling, each (K, 3), by the name in `axes`; held (K, MEMBERS, 3) its shares.

    σ and bias of a linear filter, with all folds right (oracle_sigma) of one that folds. Of one that combines its
    members, with all folds right: the least error of a single one, and of a linear combination, at each scan."""
    members = filters.members(one)
    of = [filters.gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans) for member in members]
    motions = np.concatenate([observed.truth[None], filters.drawn_motions(observed.t)])
    bias, noise = filters.errors(of, motions, observed.sigma)
    E = filters.joint(bias, noise, np.array([1.0, *observed.spread**2]))
    known = np.array([member.components for member in members])
    single = np.sqrt(np.where(known, np.einsum("kxii->kix", E), np.inf).min(axis=1))
    found = {}
    if one.combine:
        best = filters.best_shares(E, known)
        found = {"best_order": single, "best_combination": np.sqrt(np.einsum("kix,kxij,kjx->kx", best, E, best))}
    own = held[:, : len(members)] if one.combine == "expected_error" else np.ones((spec.scans, 1, 3))
    if one.combine in (None, "expected_error"):
        sigma = np.sqrt(np.einsum("kix,kxij,kjx->kx", own, E, own))
        if one.folds:
            return found | {"oracle_sigma": sigma}
        return found | {"sigma": sigma, "bias": np.einsum("kix,ikx->kx", own, bias[0])}
    return found


def follows_the_model(spec: Any, one: Any) -> bool:
    """Whether truth and filter agree: a polynomial drawn from the very prior, and no manoeuvre allowed for."""
    target, prior = spec.target, spec.prior
    return (
        target.kind == "random_polynomial"
        and (one.orders, one.variances) == ((2,), (0,))
        and target.sigma_velocity_mps == prior.sigma_velocity_mps
        and target.sigma_acceleration_mps2 == prior.sigma_acceleration_mps2
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout; with `rare` the common ones count plain realisations."""
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
