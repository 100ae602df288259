"""Labels of the study's sums, and the exact values that go with them.

Short vectors of a lattice: which sequences of folds lie near the right one.

A basis is first made short and nearly orthogonal (Lenstra, Lenstra & Lovász, Mathematische Annalen 261, 1982, 515),
then all vectors within a radius are listed, coordinate by coordinate (Fincke & Pohst, Mathematics of Computation 44,
1985, 463).

What is observed, without the plots' noise: a mean motion, and the motions that a realisation adds to it.

From a filter's options to the arrays that the kernels read: designs, which give gains, and banks, which unfold.

What is known without sampling: errors of the filters that fold nothing, and how often the nearest fold is right."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from radarsim import physics
from radarsim.engine.results import Axes
from radarsim.kernels.algebra import pack, pack_transition, predicted_covariance, take_rate, take_value, unpack
from radarsim.kernels.linear import plain
from radarsim.physics import manoeuvre_covariance, transition
from radarsim.studies import radial
from radarsim.studies.ambiguous_doppler.kernels import records


# ---- axes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class FoldedAxes(Axes):
    """Labels of the sums, F filters over K scans, components r, Vr, ar; not-a-number where a value is not known."""

    spans: np.ndarray  #: (K,) of velocity, m/s
    folded: np.ndarray  #: (F,) whether a filter unfolds
    remembers: np.ndarray  #: (F,) whether it keeps several hypotheses
    combines: np.ndarray  #: (F,) whether it combines orders
    exact_right: np.ndarray  #: (F, K) probability that all folds are right
    oracle_sigma: np.ndarray  #: (F, K, 3) exact σ of the same filter with unfolded velocity
    best_order: np.ndarray  #: (F, K, 3) exact σ of the best member at each scan, for those who know the truth
    best_combination: np.ndarray  #: (F, K, 3) that of the best linear combination of the members


# ---- lattice ---------------------------------------------------------------------------------------------------------
ORTHOGONAL = 0.75  # Lovász' condition: how much shorter a vector must become by an exchange


class TooMany(ValueError):
    """There are more vectors than the limit."""


def reduced(A: np.ndarray, T: np.ndarray) -> np.ndarray:
    """A basis (n, n) of whole numbers of the lattice of A (m, n), its vectors A T short; T (n, n) is one to begin with.
    A has full column rank."""
    T = T.copy()
    n, k = T.shape[1], 1
    while k < n:
        R = np.linalg.qr(A @ T[:, : k + 1])[1]
        for j in range(k - 1, -1, -1):
            q = int(np.rint(R[j, k] / R[j, j]))
            T[:, k] -= q * T[:, j]
            R[:, k] -= q * R[:, j]
        slant = R[k - 1, k] / R[k - 1, k - 1]
        if R[k, k] ** 2 >= (ORTHOGONAL - slant**2) * R[k - 1, k - 1] ** 2:
            k += 1
        else:
            T[:, [k - 1, k]] = T[:, [k, k - 1]]
            k = max(k - 1, 1)
    return T


def within(A: np.ndarray, T: np.ndarray, radius: float, most: int) -> np.ndarray:
    """All m (M, n) of whole numbers, but zero, with |A m| up to a radius; T is a reduced basis. Raises TooMany where
    more than `most` have to be looked at."""
    R = np.linalg.qr(A @ T)[1]
    n = R.shape[1]
    x, left = np.zeros((1, n)), np.full(1, radius**2)
    for i in range(n - 1, -1, -1):
        centre = -(x[:, i + 1 :] @ R[i, i + 1 :]) / R[i, i]
        reach = np.sqrt(left) / abs(R[i, i])
        low, high = np.ceil(centre - reach), np.floor(centre + reach)
        count = np.maximum(high - low + 1, 0).astype(np.int64)
        if count.sum() > most:
            raise TooMany
        of = np.repeat(np.arange(len(x)), count)
        value = low[of] + np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
        x = x[of]
        x[:, i] = value
        left = np.maximum(left[of] - (R[i, i] * (value - centre[of])) ** 2, 0.0)
    found = x @ T.T
    return found[np.any(found != 0, axis=1)]


# ---- world -----------------------------------------------------------------------------------------------------------
def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Mean range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².
    Raises ConfigError, with the name of the case, for a target that cannot be."""
    if target.kind == "random_polynomial":
        return physics.polynomial((target.range_m,), t)
    return radial.checked_truth(target, t, case)


def spread(target: Any) -> np.ndarray:
    """Standard deviations (2,) of the velocity (m/s) and acceleration (m/s²) that each realisation draws, or zeros."""
    own = (getattr(target, name, 0.0) for name in ("sigma_velocity_mps", "sigma_acceleration_mps2"))
    return np.array([value or 0.0 for value in own])


def drawn_motions(t: np.ndarray) -> np.ndarray:
    """What a drawn velocity of 1 m/s, and an acceleration of 1 m/s², add to the motion: (2, K, 3) at times t (K,)."""
    one, zero = np.ones_like(t), np.zeros_like(t)
    return np.stack([np.stack([t, one, zero], axis=1), np.stack([t**2 / 2, t, one], axis=1)])


# ---- filters ---------------------------------------------------------------------------------------------------------
BOTTOMLESS = 10.0**300  # the depth of a list that nothing is dropped from
COMBINATIONS = {"expected_error": records.WEIGHS, "intersection": records.CHOOSES}


class Member(NamedTuple):
    """One Kalman filter: the order of its model, what it does with the velocity, and its manoeuvre variance."""

    order: int
    doppler: str
    manoeuvre_variance: float

    @property
    def components(self) -> tuple[bool, bool, bool]:
        """Which of range, velocity and acceleration it estimates."""
        return True, self.order > 0 or self.doppler != "none", self.order > 1


def members(one: Any) -> tuple[Member, ...]:
    """The Kalman filters of a filter's options: of each order; combined but by likelihood, also without the velocity.
    Likelihoods can be compared of the same plots alone."""
    pairs = list(zip(one.orders, one.variances, strict=True))
    ways = [one.doppler]
    if one.combine in COMBINATIONS and one.doppler != "none":
        ways.append("none")
    return tuple(Member(order, way, variance) for way in ways for order, variance in pairs)


def components(one: Any) -> tuple[bool, ...]:
    """Which of range, velocity and acceleration a filter estimates: what any of its members does."""
    return tuple(map(any, zip(*(member.components for member in members(one)), strict=True)))


def model(order: int, variance: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """F and Q (3, 3) of a motion of order 0, 1 or 2 over dt, in a state of range, velocity and acceleration.

    Order 2 has a random jerk, order 1 a random acceleration, constant over the scan, of that variance (P1 eqs. 3, 6).
    Order 0 has a random velocity, drawn at each scan with that variance: measured, it moves the range; unmeasured, it
    is a random walk's step."""
    F, Q = np.zeros((3, 3)), np.zeros((3, 3))
    if order == 0:
        F[0, :2], Q[1, 1] = (1.0, dt), variance
    else:
        size = order + 1
        F[:size, :size], Q[:size, :size] = transition(dt, size), manoeuvre_covariance(variance, dt, size)
    return F, Q


def prior_variances(order: int, prior: Any) -> np.ndarray:
    """Variances (2,) of velocity and acceleration before the first plot; zero where the model has none."""
    return np.array([prior.sigma_velocity_mps**2, prior.sigma_acceleration_mps2**2 if order == 2 else 0.0])


def design_row(member: Member, prior: Any, dt: float) -> np.ndarray:
    """The numbers (DESIGN,) of a member's design, as `kernels.records` has them."""
    F, Q = model(member.order, member.manoeuvre_variance, dt)
    row = np.zeros(records.DESIGN)
    row[records.MOTION : records.MOTION + 5] = F[0, 1], F[0, 2], F[1, 1], F[1, 2], F[2, 2]
    row[records.NOISE : records.NOISE + 6] = Q[np.triu_indices(3)]
    row[records.PRIOR : records.PRIOR + 2] = prior_variances(member.order, prior)
    row[records.TAKES_VELOCITY] = {"none": 0, "remainder": 2}.get(member.doppler, 1)
    return row


def kind(one: Any, doppler: str) -> int:
    """What the bank of a member of a filter does about the folds."""
    if doppler != "folded":
        return {"none": records.NONE, "unfolded": records.UNFOLDS, "remainder": records.REMAINDER}[doppler]
    if one.merge == "each_scan":
        return records.MERGES
    return records.NEAREST if one.hypotheses == 1 else records.REMEMBERS


class Bank(NamedTuple):
    """A bank: what it does, its designs (of likelihood) or its one, or the banks it combines; see `records.Banks`."""

    kind: int
    parts: tuple[int, ...]
    orders: tuple[int, ...] = ()
    most: int = 1
    deepest: float = BOTTOMLESS
    reads: int = records.MEAN
    stay: float = 1.0
    unfolding: int = records.NONE
    shares: bytes = b""


@dataclass
class Gathered:
    """Designs and banks so far, each once: filters that differ in their estimate alone share a bank."""

    designs: dict[bytes, np.ndarray] = field(default_factory=dict)
    banks: list[Bank] = field(default_factory=list)

    def design(self, row: np.ndarray) -> int:
        """The number of a design."""
        self.designs.setdefault(row.tobytes(), row)
        return list(self.designs).index(row.tobytes())

    def bank(self, one: Bank) -> int:
        """The number of a bank."""
        if one not in self.banks:
            self.banks.append(one)
        return self.banks.index(one)


def banks(spec: Any, shares: Callable[[Any], np.ndarray]) -> records.Banks:
    """The filters' arrays; shares(filter) gives, for one that combines, the numbers (K, MEMBERS, 3) that it needs."""
    gathered = Gathered()
    bank = [_bank(gathered, one, spec, shares) for one in spec.filters]
    names = [one.name for one in spec.filters]
    oracles = [i for i, one in enumerate(spec.filters) if one.doppler == "unfolded" and one.combine is None]
    made, count = gathered.banks, len(gathered.banks)
    held = np.zeros((count, spec.scans, records.MAX_MEMBERS, 3))
    for b, one in enumerate(made):
        if one.shares:
            held[b] = np.frombuffer(one.shares).reshape(held.shape[1:])
    parts, orders = np.zeros((count, records.MAX_MEMBERS), np.int64), np.zeros((count, records.MAX_MEMBERS), np.int64)
    for b, one in enumerate(made):
        parts[b, : len(one.parts)], orders[b, : len(one.orders)] = one.parts, one.orders
    whole = {"dtype": np.int64}
    place = [records.MEAN if one.combine in COMBINATIONS else _read(one) for one in spec.filters]
    return records.Banks(
        designs=plain(list(gathered.designs.values()), len(gathered.designs), records.DESIGN),
        kind=plain([one.kind for one in made], count, **whole),
        members=parts,
        orders=orders,
        size=plain([len(one.parts) for one in made], count, **whole),
        max_hypotheses=plain([one.most for one in made], count, **whole),
        max_depth=plain([one.deepest for one in made], count),
        member_field=plain([one.reads for one in made], count, **whole),
        stay=plain([one.stay for one in made], count),
        unfolding=plain([one.unfolding for one in made], count, **whole),
        shares=held,
        bank=plain(bank, len(bank), **whole),
        estimate_field=plain(place, len(place), **whole),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        oracle=oracles[0] if oracles else -1,
    )


def _bank(gathered: Gathered, one: Any, spec: Any, shares: Callable[[Any], np.ndarray]) -> int:
    """The number of a filter's bank; what it needs is gathered before it."""
    every, dt = members(one), spec.radar.scan_period_s
    designs = [gathered.design(design_row(member, spec.prior, dt)) for member in every]
    orders = tuple(member.order for member in every)
    if one.combine == "likelihood":
        # A list of one hypothesis is the nearest fold.
        unfolding = {records.NEAREST: records.REMEMBERS}.get(kind(one, one.doppler), kind(one, one.doppler))
        kept = _kept(one) if unfolding == records.REMEMBERS else {}
        return gathered.bank(
            Bank(records.INTERACTS, tuple(designs), orders, stay=one.stay_probability, unfolding=unfolding, **kept)
        )
    parts = [gathered.bank(_single(one, design, member.doppler)) for design, member in zip(designs, every, strict=True)]
    if one.combine is None:
        return parts[0]
    held = shares(one).tobytes()
    return gathered.bank(Bank(COMBINATIONS[one.combine], tuple(parts), orders, reads=_read(one), shares=held))


def _single(one: Any, design: int, doppler: str) -> Bank:
    """The bank of one design."""
    what = kind(one, doppler)
    if what != records.REMEMBERS:
        return Bank(what, (design,))
    return Bank(what, (design,), **_kept(one))


def _kept(one: Any) -> dict[str, Any]:
    """How many hypotheses a filter keeps, and how deep below the best."""
    return {"most": one.hypotheses, "deepest": -math.log(one.prune_below) if one.prune_below > 0 else BOTTOMLESS}


def _read(one: Any) -> int:
    """Which of its hypotheses' outputs a filter's estimate is."""
    return records.BEST if one.estimate == "best" else records.MEAN


# ---- exact -----------------------------------------------------------------------------------------------------------
FARTHEST = 8.5  # standard deviations that an integral goes to: beyond lie 2e-17
INTERVAL_SIGMAS = 2.0  # half width of the intervals that the smoothest order has to meet: 95 % of a Gaussian's errors
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(12)  # over one standard deviation: exact to rounding


@dataclass(frozen=True)
class Gains:
    """A filter's gains over K scans without missed plots, of innovations that are taken range first, velocity after."""

    F: np.ndarray  #: (3, 3) its motion
    range: np.ndarray  #: (K, 3) zero at the first scan
    velocity: np.ndarray  #: (K, 3) zero where it takes none
    variance: np.ndarray  #: (K,) of the velocity's innovation, (m/s)²
    range_variance: np.ndarray  #: (K,) of the range's, m²; one at the first scan
    believed: np.ndarray  #: (K, 3, 3) covariance after the plot, in m, m/s, m/s²


def gains(one: Member, prior: Any, sigma: np.ndarray, dt: float, scans: int) -> Gains:
    """The Kalman filter of a member; sigma (2,) of the plots."""
    F, Q = model(one.order, one.manoeuvre_variance, dt)
    f, q, (before_v, before_a) = pack_transition(F), pack(Q), prior_variances(one.order, prior)
    P: Any = (sigma[0] ** 2, 0.0, 0.0, before_v, 0.0, before_a)
    of_range, of_velocity = np.zeros((scans, 3)), np.zeros((scans, 3))
    variance, range_variance, believed = np.zeros(scans), np.ones(scans), np.zeros((scans, 6))
    for k in range(scans):
        if k > 0:
            P, of_range[k], range_variance[k] = take_value(predicted_covariance(P, f, q), sigma[0] ** 2, 1.0)
        after, gain, variance[k] = take_rate(P, sigma[1] ** 2, 1.0)
        if one.doppler != "none" and (k > 0 or one.doppler != "remainder"):  # a remainder needs two scans
            P, of_velocity[k] = after, gain
        believed[k] = P
    return Gains(F, of_range, of_velocity, variance, range_variance, unpack(believed.T))


def errors(of: Sequence[Gains], motions: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What I filters whose folds are right make of given motions (M, K, 3), and of the noise of plots of sigma (2,).

    Errors (M, I, K, 3) without noise, and covariances (K, I, 3, I, 3) of the errors by noise, between the filters too.
    The error is linear in all of these: e⁺ = (I − h eᵥᵀ)(I − g eᵣᵀ)(F e + F x − x⁺) + noise runs for each motion, and
    for the noise's covariance with all filters' states one below the other."""
    count, scans = len(of), motions.shape[1]
    bias, noise = np.zeros((len(motions), count, scans, 3)), np.zeros((scans, 3 * count, 3 * count))
    for k in range(scans):
        if k == 0:  # the first range is taken as it is
            steps = [Step(np.eye(3), np.array([1.0, 0, 0]), one.velocity[0]) for one in of]
            began = np.zeros((len(motions), count, 3)), np.zeros((3 * count, 3 * count))
            bias[:, :, 0], noise[0] = advanced(*began, np.zeros((len(motions), 3)), motions[:, 0], steps, sigma)
        else:
            steps = [Step(one.F, one.range[k], one.velocity[k]) for one in of]
            before = bias[:, :, k - 1], noise[k - 1]
            bias[:, :, k], noise[k] = advanced(*before, motions[:, k - 1], motions[:, k], steps, sigma)
    return bias, noise.reshape(scans, count, 3, count, 3)


class Step(NamedTuple):
    """What a filter does at a scan: motion F (3, 3) since the last, gains (3,) of range and of velocity."""

    F: np.ndarray
    range: np.ndarray
    velocity: np.ndarray


def advanced(
    bias: np.ndarray, noise: np.ndarray, before: np.ndarray, now: np.ndarray, steps: Sequence[Step], sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of I filters a scan later: without noise (M, I, 3), and the noise's covariance (3 I, 3 I).

    before, now (M, 3) are the motions at the scan before and at this; sigma (2,) of the plots."""
    count = len(steps)
    A, of_range, of_velocity = np.zeros((3 * count, 3 * count)), np.zeros(3 * count), np.zeros(3 * count)
    moved = np.empty_like(bias)
    for i, (F, g, h) in enumerate(steps):
        own = slice(3 * i, 3 * i + 3)
        take = np.eye(3) - np.outer(h, [0, 1, 0])
        kept = take @ (np.eye(3) - np.outer(g, [1, 0, 0]))
        A[own, own], of_range[own], of_velocity[own] = kept @ F, take @ g, h
        moved[:, i] = bias[:, i] @ (kept @ F).T + (before @ F.T - now) @ kept.T
    after = A @ noise @ A.T + sigma[0] ** 2 * np.outer(of_range, of_range)
    return moved, after + sigma[1] ** 2 * np.outer(of_velocity, of_velocity)


def widths(bias: np.ndarray, noise: np.ndarray, of: Sequence[Member], prior: Any) -> np.ndarray:
    """Half widths (K, I, 3) of intervals of INTERVAL_SIGMAS; zero where a filter has no estimate.

    bias (2, I, K, 3) of a drawn velocity and acceleration of one, noise (K, I, 3, I, 3). What is drawn from the prior
    is no manoeuvre: a velocity, and an acceleration to a model that has one."""
    models = np.array([one.order > 1 for one in of])[:, None, None]
    known = np.array([one.components for one in of])
    variance = np.einsum("kixix->ikx", noise) + bias[0] ** 2 * prior.sigma_velocity_mps**2
    variance += bias[1] ** 2 * prior.sigma_acceleration_mps2**2 * models
    return INTERVAL_SIGMAS * np.sqrt(variance).swapaxes(0, 1) * known


def joint(bias: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The joint second moments E_ij = b_i b_j + C_ij of the errors of I filters by scan and component (K, 3, I, I).

    bias (M, I, K, 3) of M motions whose squares are weighted by weight (M,); noise (K, I, 3, I, 3)."""
    return np.einsum("mikx,mjkx,m->kxij", bias, bias, weight) + np.einsum("kixjx->kxij", noise)


def best_shares(E: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Shares (K, I, 3), of sum one, of the linear combination of least error: E⁻¹1/(1ᵀE⁻¹1); they may be negative. E
    (K, 3, I, I); known (I, 3) says which filter estimates which component; all zero where none does."""
    shares = np.zeros((E.shape[0], E.shape[2], 3))
    for c in range(3):
        own = np.flatnonzero(known[:, c])
        if own.size:
            shares[:, own, c] = _least(E[:, c][:, own][:, :, own])
    return shares


def _least(E: np.ndarray) -> np.ndarray:
    """E⁻¹1/(1ᵀE⁻¹1) of matrices (K, I, I): (K, I)."""
    spread = np.diagonal(E, axis1=1, axis2=2)
    scale = 1 / np.sqrt(np.where(spread > 0, spread, 1.0))
    solved = np.linalg.pinv(E * scale[:, :, None] * scale[:, None, :], rcond=1e-12, hermitian=True)
    raw = scale * np.einsum("kij,kj->ki", solved, scale)
    total = raw.sum(axis=1, keepdims=True)
    certain = (spread == 0).any(axis=1)[:, None]  # a filter without error: it has the whole share
    total = np.where(certain, 1.0, total)
    return np.where(certain, np.eye(E.shape[1])[spread.argmin(axis=1)], raw / total)


def expected_motions(manoeuvres: Any, t: np.ndarray) -> np.ndarray:
    """What a class of manoeuvres adds at times t (K,): motions (K, K, 3), one for each scan at which it may begin."""
    size, length = manoeuvres.acceleration_mps2, manoeuvres.duration_s
    return np.stack([physics.acceleration_pulse((0.0,), size, begin, length, t) for begin in t])


def remainders_right(
    mean: np.ndarray, spread: np.ndarray, t: np.ndarray, sigma: float, spans: np.ndarray, joint: np.ndarray
) -> np.ndarray:
    """Probability (K,) that the Chinese remainder of a scan and the one before it gives the right fold.

    mean (K,) velocities at times t (K,), spread (2,) of the velocity and acceleration drawn beside; sigma of a
    measured velocity; spans D (K,); joint (K,) span L of a scan and the one before, m/s, zero: they have none.
    Right is what lies in ± L/2 and whose difference δ from the velocity before, folded by that one's span, is the
    least of all that the two spans leave, which lie d = D D′/L apart: |δ − i D′| < d/2 for a whole i. Of both the
    joint normal law is known, on any target."""
    right = np.zeros(len(t))
    normal = np.vectorize(NormalDist().cdf, otypes=[float])
    for k in range(1, len(t)):
        if joint[k] == 0:
            continue
        dt, step, before = t[k] - t[k - 1], spans[k] * spans[k - 1] / joint[k], spans[k - 1]
        of_delta, of_u = spread[1] ** 2 * dt**2 + 2 * sigma**2, spread[0] ** 2 + spread[1] ** 2 * t[k] ** 2 + sigma**2
        both = spread[1] ** 2 * dt * t[k] + sigma**2
        centre, reach = mean[k] - mean[k - 1], FARTHEST * of_delta**0.5
        first, last = (math.floor((centre + side * reach) / before + 0.5) for side in (-1, 1))
        for i in range(first, last + 1):
            low, high = max(i * before - step / 2, centre - reach), min(i * before + step / 2, centre + reach)
            if low >= high:
                continue
            pieces = math.ceil((high - low) / of_delta**0.5)
            edges = np.linspace(low, high, pieces + 1)
            half = np.diff(edges)[:, None] / 2
            delta = edges[:-1, None] + half * (1 + NODES)
            density = np.exp(-((delta - centre) ** 2) / (2 * of_delta)) / np.sqrt(2 * np.pi * of_delta)
            u, off = mean[k] + both / of_delta * (delta - centre), (of_u - both**2 / of_delta) ** 0.5
            inside = normal((joint[k] / 2 - u) / off) - normal((-joint[k] / 2 - u) / off)
            right[k] += float(np.sum(half * NODE_WEIGHTS * density * inside))
    return right


def all_right(of: Gains, spans: np.ndarray) -> np.ndarray:
    """Probability (K,) that the nearest folds are right up to each scan: ∏ [2Φ(D/2√S) − 1], spans D (K,).

    Exact where the filter's model and prior are the truth's: its innovations are then independent, N(0, S). (Integer
    bootstrapping: Teunissen, Journal of Geodesy 72, 1998, 606-612.)"""
    normal = NormalDist()
    each = [2 * normal.cdf(D / 2 / S**0.5) - 1 for D, S in zip(spans, of.variance, strict=True)]
    return np.cumprod(each)
