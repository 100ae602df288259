"""Labels of the study's sums, with the exact values.

Short vectors of a lattice: the sequences of folds near the right one.

A basis is first made short and nearly orthogonal (Lenstra, Lenstra & Lovász, Mathematische Annalen 261, 1982, 515),
then all vectors within a radius are listed, coordinate by coordinate (Fincke & Pohst, Mathematics of Computation 44,
1985, 463).

The target's true motion: a mean, and the motions that each realisation adds to it.

From a filter's options to the arrays that the kernels read: designs, which give gains, and banks, which unfold.

Exact errors of filters whose folds are right, and the probability that the nearest fold is right."""

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
    """Labels of the sums: F filters, K scans, components r, Vr, ar. Exact values are not-a-number where unknown."""

    spans: np.ndarray  #: (K,) of velocity, m/s
    folded: np.ndarray  #: (F,) whether a filter takes the velocity folded
    remembers: np.ndarray  #: (F,) whether it keeps several hypotheses
    combines: np.ndarray  #: (F,) whether it combines orders
    exact_right: np.ndarray  #: (F, K) probability that all folds are right
    oracle_sigma: np.ndarray  #: (F, K, 3) exact σ of the same filter with unfolded velocity
    best_order: np.ndarray  #: (F, K, 3) exact σ of the best member at each scan, chosen with the truth known
    best_combination: np.ndarray  #: (F, K, 3) exact σ of the best linear combination of the members


# ---- lattice ---------------------------------------------------------------------------------------------------------
LOVASZ_CONDITION = 0.75  # Lovász' condition: how much shorter a vector must become by an exchange


class TooManyVectors(ValueError):
    """There are more vectors than the limit."""


def reduce_basis(A: np.ndarray, T: np.ndarray) -> np.ndarray:
    """A basis T (n, n) of whole numbers with short vectors A T, of the lattice of A (m, n).

    T (n, n) is the basis to begin with; A has full column rank."""
    T = T.copy()
    n, k = T.shape[1], 1
    while k < n:
        R = np.linalg.qr(A @ T[:, : k + 1])[1]
        for j in range(k - 1, -1, -1):
            q = int(np.rint(R[j, k] / R[j, j]))
            T[:, k] -= q * T[:, j]
            R[:, k] -= q * R[:, j]
        slant = R[k - 1, k] / R[k - 1, k - 1]
        if R[k, k] ** 2 >= (LOVASZ_CONDITION - slant**2) * R[k - 1, k - 1] ** 2:
            k += 1
        else:
            T[:, [k - 1, k]] = T[:, [k, k - 1]]
            k = max(k - 1, 1)
    return T


def lattice_vectors(A: np.ndarray, T: np.ndarray, radius: float, max_candidates: int) -> np.ndarray:
    """All vectors m (M, n) of whole numbers, except zero, with |A m| up to a radius; T is a reduced basis.

    Raises TooManyVectors if there are more than `max_candidates` at any step."""
    R = np.linalg.qr(A @ T)[1]
    n = R.shape[1]
    x, remaining = np.zeros((1, n)), np.full(1, radius**2)
    for i in range(n - 1, -1, -1):
        centre = -(x[:, i + 1 :] @ R[i, i + 1 :]) / R[i, i]
        reach = np.sqrt(remaining) / abs(R[i, i])
        low, high = np.ceil(centre - reach), np.floor(centre + reach)
        count = np.maximum(high - low + 1, 0).astype(np.int64)
        if count.sum() > max_candidates:
            raise TooManyVectors
        parents = np.repeat(np.arange(len(x)), count)
        coordinate = low[parents] + np.arange(len(parents)) - np.repeat(np.cumsum(count) - count, count)
        x = x[parents]
        x[:, i] = coordinate
        remaining = np.maximum(remaining[parents] - (R[i, i] * (coordinate - centre[parents])) ** 2, 0.0)
    vectors = x @ T.T
    return vectors[np.any(vectors != 0, axis=1)]


# ---- world -----------------------------------------------------------------------------------------------------------
def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Mean range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².

    Raises ConfigError, with the name of the case, for an impossible target."""
    if target.kind == "random_polynomial":
        return physics.polynomial((target.range_m,), t)
    return radial.checked_truth(target, t, case)


def random_motion_sigma(target: Any) -> np.ndarray:
    """Standard deviations (2,) of the velocity (m/s) and acceleration (m/s²) that each realisation draws, or zeros."""
    sigmas = (getattr(target, name, 0.0) for name in ("sigma_velocity_mps", "sigma_acceleration_mps2"))
    return np.array([value or 0.0 for value in sigmas])


def unit_motions(t: np.ndarray) -> np.ndarray:
    """The motions (2, K, 3) that an added velocity of 1 m/s, and an acceleration of 1 m/s², cause at times t (K,)."""
    ones, zeros = np.ones_like(t), np.zeros_like(t)
    return np.stack([np.stack([t, ones, zeros], axis=1), np.stack([t**2 / 2, t, ones], axis=1)])


# ---- filters ---------------------------------------------------------------------------------------------------------
UNLIMITED_DEPTH = 10.0**300  # of a list from which no hypothesis is dropped
COMBINATIONS = {"expected_error": records.WEIGHS, "intersection": records.CHOOSES}


class Member(NamedTuple):
    """One Kalman filter: the order of its model, how it uses the velocity, and its manoeuvre variance."""

    order: int
    doppler: str
    manoeuvre_variance: float

    @property
    def components(self) -> tuple[bool, bool, bool]:
        """Which of range, velocity and acceleration it estimates."""
        return True, self.order > 0 or self.doppler != "none", self.order > 1


def members(options: Any) -> tuple[Member, ...]:
    """The Kalman filters that a filter's options name: one for each order, and the same without the velocity if they
    are combined, unless by likelihood, which is comparable only between filters of the same plots."""
    pairs = list(zip(options.orders, options.variances, strict=True))
    dopplers = [options.doppler]
    if options.combine in COMBINATIONS and options.doppler != "none":
        dopplers.append("none")
    return tuple(Member(order, doppler, variance) for doppler in dopplers for order, variance in pairs)


def components(options: Any) -> tuple[bool, ...]:
    """Which of range, velocity and acceleration any member of a filter estimates."""
    return tuple(map(any, zip(*(member.components for member in members(options)), strict=True)))


def model(order: int, variance: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """F and Q (3, 3) of a motion of order 0, 1 or 2 over dt, in a state of range, velocity and acceleration.

    Order 2 has a random jerk, order 1 a random acceleration, constant over the scan, of that variance (P1 eqs. 3, 6).
    Order 0 has a random velocity, drawn at each scan with that variance: if measured, it moves the range; else it is
    the step of a random walk."""
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


def fold_treatment(options: Any, doppler: str) -> int:
    """How a filter's bank treats the folds of a member."""
    if doppler != "folded":
        return {"none": records.NONE, "unfolded": records.UNFOLDS, "remainder": records.REMAINDER}[doppler]
    if options.merge == "each_scan":
        return records.MERGES
    return records.NEAREST if options.hypotheses == 1 else records.REMEMBERS


class Bank(NamedTuple):
    """A bank: its kind, with its design, the designs that interact, or the banks that it combines; see
    `records.Banks`."""

    kind: int
    members: tuple[int, ...]
    orders: tuple[int, ...] = ()
    max_hypotheses: int = 1
    max_depth: float = UNLIMITED_DEPTH
    member_field: int = records.MEAN
    stay: float = 1.0
    unfolding: int = records.NONE
    shares: bytes = b""


@dataclass
class BankList:
    """The designs and banks of a case, each once: filters that differ only in their estimate share a bank."""

    designs: dict[bytes, np.ndarray] = field(default_factory=dict)
    banks: list[Bank] = field(default_factory=list)

    def design(self, row: np.ndarray) -> int:
        """The number of a design, which is added if it is new."""
        self.designs.setdefault(row.tobytes(), row)
        return list(self.designs).index(row.tobytes())

    def bank(self, bank: Bank) -> int:
        """The number of a bank, which is added if it is new."""
        if bank not in self.banks:
            self.banks.append(bank)
        return self.banks.index(bank)


def banks(spec: Any, shares: Callable[[Any], np.ndarray]) -> records.Banks:
    """The filters' arrays; shares(options) gives the numbers (K, MAX_MEMBERS, 3) of a filter that combines orders."""
    bank_list = BankList()
    filter_banks = [_add_bank(bank_list, options, spec, shares) for options in spec.filters]
    names = [options.name for options in spec.filters]
    oracles = [i for i, o in enumerate(spec.filters) if o.doppler == "unfolded" and o.combine is None]
    count = len(bank_list.banks)
    bank_shares = np.zeros((count, spec.scans, records.MAX_MEMBERS, 3))
    bank_members = np.zeros((count, records.MAX_MEMBERS), np.int64)
    orders = np.zeros((count, records.MAX_MEMBERS), np.int64)
    for b, bank in enumerate(bank_list.banks):
        if bank.shares:
            bank_shares[b] = np.frombuffer(bank.shares).reshape(bank_shares.shape[1:])
        bank_members[b, : len(bank.members)], orders[b, : len(bank.orders)] = bank.members, bank.orders
    estimate_fields = [records.MEAN if o.combine in COMBINATIONS else _estimate_field(o) for o in spec.filters]
    integers = {"dtype": np.int64}
    return records.Banks(
        designs=plain(list(bank_list.designs.values()), len(bank_list.designs), records.DESIGN),
        kind=plain([bank.kind for bank in bank_list.banks], count, **integers),
        members=bank_members,
        orders=orders,
        size=plain([len(bank.members) for bank in bank_list.banks], count, **integers),
        max_hypotheses=plain([bank.max_hypotheses for bank in bank_list.banks], count, **integers),
        max_depth=plain([bank.max_depth for bank in bank_list.banks], count),
        member_field=plain([bank.member_field for bank in bank_list.banks], count, **integers),
        stay=plain([bank.stay for bank in bank_list.banks], count),
        unfolding=plain([bank.unfolding for bank in bank_list.banks], count, **integers),
        shares=bank_shares,
        bank=plain(filter_banks, len(filter_banks), **integers),
        estimate_field=plain(estimate_fields, len(estimate_fields), **integers),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        oracle=oracles[0] if oracles else -1,
    )


def _add_bank(bank_list: BankList, options: Any, spec: Any, shares: Callable[[Any], np.ndarray]) -> int:
    """Add a filter's bank, after the designs and banks that it needs; returns its number."""
    filter_members, dt = members(options), spec.radar.scan_period_s
    designs = [bank_list.design(design_row(member, spec.prior, dt)) for member in filter_members]
    orders = tuple(member.order for member in filter_members)
    if options.combine == "likelihood":
        unfolding = fold_treatment(options, options.doppler)
        if unfolding == records.NEAREST:  # the same as a list of one hypothesis
            unfolding = records.REMEMBERS
        limits = _list_limits(options) if unfolding == records.REMEMBERS else {}
        stay = options.stay_probability
        return bank_list.bank(Bank(records.INTERACTS, tuple(designs), orders, stay=stay, unfolding=unfolding, **limits))
    single_banks = [
        bank_list.bank(_single_bank(options, design, member.doppler))
        for design, member in zip(designs, filter_members, strict=True)
    ]
    if options.combine is None:
        return single_banks[0]
    kind, share_bytes = COMBINATIONS[options.combine], shares(options).tobytes()
    return bank_list.bank(
        Bank(kind, tuple(single_banks), orders, member_field=_estimate_field(options), shares=share_bytes)
    )


def _single_bank(options: Any, design: int, doppler: str) -> Bank:
    """The bank of a single design."""
    treatment = fold_treatment(options, doppler)
    if treatment != records.REMEMBERS:
        return Bank(treatment, (design,))
    return Bank(treatment, (design,), **_list_limits(options))


def _list_limits(options: Any) -> dict[str, Any]:
    """The limits of a filter's list of hypotheses, as arguments of `Bank`."""
    return {
        "max_hypotheses": options.hypotheses,
        "max_depth": -math.log(options.prune_below) if options.prune_below > 0 else UNLIMITED_DEPTH,
    }


def _estimate_field(options: Any) -> int:
    """The output of its bank that is a filter's estimate."""
    return records.BEST if options.estimate == "best" else records.MEAN


# ---- exact -----------------------------------------------------------------------------------------------------------
INTEGRAL_SIGMAS = 8.5  # standard deviations at which an integral is cut: 2e-17 of it is lost
INTERVAL_SIGMAS = 2.0  # half width of the intervals that the smoothest order has to meet: 95 % of Gaussian errors
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(12)  # over one standard deviation: exact to rounding


@dataclass(frozen=True)
class Gains:
    """A filter's gains over K scans without missed plots; the range is taken first, the velocity second."""

    F: np.ndarray  #: (3, 3) its motion
    range: np.ndarray  #: (K, 3) zero at the first scan
    velocity: np.ndarray  #: (K, 3) zero where it takes no velocity
    variance: np.ndarray  #: (K,) of the velocity's innovation, (m/s)²
    range_variance: np.ndarray  #: (K,) of the range's innovation, m²; one at the first scan
    covariance: np.ndarray  #: (K, 3, 3) after the plot, in m, m/s, m/s²


def kalman_gains(member: Member, prior: Any, sigma: np.ndarray, dt: float, scans: int) -> Gains:
    """The gains of a member over all scans; sigma (2,) of the plots."""
    F, Q = model(member.order, member.manoeuvre_variance, dt)
    f, q, (prior_v, prior_a) = pack_transition(F), pack(Q), prior_variances(member.order, prior)
    P: Any = (sigma[0] ** 2, 0.0, 0.0, prior_v, 0.0, prior_a)
    range_gains, velocity_gains = np.zeros((scans, 3)), np.zeros((scans, 3))
    variance, range_variance, covariances = np.zeros(scans), np.ones(scans), np.zeros((scans, 6))
    for k in range(scans):
        if k > 0:
            P, range_gains[k], range_variance[k] = take_value(predicted_covariance(P, f, q), sigma[0] ** 2, 1.0)
        updated_P, gain, variance[k] = take_rate(P, sigma[1] ** 2, 1.0)
        if member.doppler != "none" and (k > 0 or member.doppler != "remainder"):  # a remainder needs two scans
            P, velocity_gains[k] = updated_P, gain
        covariances[k] = P
    return Gains(F, range_gains, velocity_gains, variance, range_variance, unpack(covariances.T))


def linear_errors(
    filter_gains: Sequence[Gains], motions: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of I filters whose folds are right: for motions (M, K, 3), and for the noise of plots of sigma (2,).

    Returns errors (M, I, K, 3) without noise, and covariances (K, I, 3, I, 3) of the errors by noise, also between
    filters. The error is linear in motion and noise: e⁺ = (I − h eᵥᵀ)(I − g eᵣᵀ)(F e + F x − x⁺) + noise runs for each
    motion, and for the covariance of the noise with the states of all filters stacked."""
    count, scans = len(filter_gains), motions.shape[1]
    bias, noise = np.zeros((len(motions), count, scans, 3)), np.zeros((scans, 3 * count, 3 * count))
    for k in range(scans):
        if k == 0:  # the first range is taken as it is
            steps = [
                Step(np.eye(3), np.array([1.0, 0, 0]), gains_of_filter.velocity[0]) for gains_of_filter in filter_gains
            ]
            start = np.zeros((len(motions), count, 3)), np.zeros((3 * count, 3 * count))
            bias[:, :, 0], noise[0] = advance_errors(*start, np.zeros((len(motions), 3)), motions[:, 0], steps, sigma)
        else:
            steps = [
                Step(gains_of_filter.F, gains_of_filter.range[k], gains_of_filter.velocity[k])
                for gains_of_filter in filter_gains
            ]
            previous = bias[:, :, k - 1], noise[k - 1]
            bias[:, :, k], noise[k] = advance_errors(*previous, motions[:, k - 1], motions[:, k], steps, sigma)
    return bias, noise.reshape(scans, count, 3, count, 3)


class Step(NamedTuple):
    """A filter's scan: its motion F (3, 3) since the previous one, and its gains (3,) of range and velocity."""

    F: np.ndarray
    range: np.ndarray
    velocity: np.ndarray


def advance_errors(
    bias: np.ndarray,
    noise: np.ndarray,
    previous_motions: np.ndarray,
    current_motions: np.ndarray,
    steps: Sequence[Step],
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of I filters one scan later: without noise (M, I, 3), and the covariance by noise (3 I, 3 I).

    previous_motions, current_motions (M, 3) are those at the two scans; sigma (2,) of the plots."""
    count = len(steps)
    A, range_noise, velocity_noise = np.zeros((3 * count, 3 * count)), np.zeros(3 * count), np.zeros(3 * count)
    errors = np.empty_like(bias)
    for i, (F, g, h) in enumerate(steps):
        block = slice(3 * i, 3 * i + 3)
        velocity_update = np.eye(3) - np.outer(h, [0, 1, 0])
        update = velocity_update @ (np.eye(3) - np.outer(g, [1, 0, 0]))
        A[block, block], range_noise[block], velocity_noise[block] = update @ F, velocity_update @ g, h
        errors[:, i] = bias[:, i] @ (update @ F).T + (previous_motions @ F.T - current_motions) @ update.T
    covariance = A @ noise @ A.T + sigma[0] ** 2 * np.outer(range_noise, range_noise)
    return errors, covariance + sigma[1] ** 2 * np.outer(velocity_noise, velocity_noise)


def interval_widths(bias: np.ndarray, noise: np.ndarray, members: Sequence[Member], prior: Any) -> np.ndarray:
    """Half widths (K, I, 3) of intervals of INTERVAL_SIGMAS; zero where a filter has no estimate.

    bias (2, I, K, 3) for a unit velocity and a unit acceleration, noise (K, I, 3, I, 3). The motion that the prior
    allows is no manoeuvre: a velocity, and an acceleration if the model has one."""
    models = np.array([member.order > 1 for member in members])[:, None, None]
    estimated = np.array([member.components for member in members])
    variance = np.einsum("kixix->ikx", noise) + bias[0] ** 2 * prior.sigma_velocity_mps**2
    variance += bias[1] ** 2 * prior.sigma_acceleration_mps2**2 * models
    return INTERVAL_SIGMAS * np.sqrt(variance).swapaxes(0, 1) * estimated


def joint_moments(bias: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The joint second moments E_ij = b_i b_j + C_ij of the errors of I filters by scan and component (K, 3, I, I).

    bias (M, I, K, 3) of M motions whose squares are weighted by weight (M,); noise (K, I, 3, I, 3)."""
    return np.einsum("mikx,mjkx,m->kxij", bias, bias, weight) + np.einsum("kixjx->kxij", noise)


def best_shares(E: np.ndarray, estimated: np.ndarray) -> np.ndarray:
    """Shares (K, I, 3) of the linear combination with the smallest error: E⁻¹1/(1ᵀE⁻¹1); they may be negative.

    E (K, 3, I, I); estimated (I, 3): which filter estimates which component. The shares add up to one, or are all zero
    where no filter estimates the component."""
    shares = np.zeros((E.shape[0], E.shape[2], 3))
    for c in range(3):
        estimating = np.flatnonzero(estimated[:, c])
        if estimating.size:
            shares[:, estimating, c] = _min_error_shares(E[:, c][:, estimating][:, :, estimating])
    return shares


def _min_error_shares(E: np.ndarray) -> np.ndarray:
    """E⁻¹1/(1ᵀE⁻¹1) of matrices (K, I, I): (K, I)."""
    variances = np.diagonal(E, axis1=1, axis2=2)
    scale = 1 / np.sqrt(np.where(variances > 0, variances, 1.0))
    solved = np.linalg.pinv(E * scale[:, :, None] * scale[:, None, :], rcond=1e-12, hermitian=True)
    raw = scale * np.einsum("kij,kj->ki", solved, scale)
    share_sum = raw.sum(axis=1, keepdims=True)
    error_free = (variances == 0).any(axis=1)[:, None]  # a filter without error has the whole share
    share_sum = np.where(error_free, 1.0, share_sum)
    return np.where(error_free, np.eye(E.shape[1])[variances.argmin(axis=1)], raw / share_sum)


def manoeuvre_motions(manoeuvres: Any, t: np.ndarray) -> np.ndarray:
    """Motions (K, K, 3) that a class of manoeuvres adds at times t (K,), one for each scan at which it may begin."""
    size, length = manoeuvres.acceleration_mps2, manoeuvres.duration_s
    return np.stack([physics.acceleration_pulse((0.0,), size, start_s, length, t) for start_s in t])


def remainder_probability(
    mean: np.ndarray, spread: np.ndarray, t: np.ndarray, sigma: float, spans: np.ndarray, joint: np.ndarray
) -> np.ndarray:
    """Probability (K,) that the Chinese remainder of a scan and the previous one gives the right fold.

    mean (K,) velocities at times t (K,); spread (2,) of the random velocity and acceleration; sigma of a measured
    velocity; spans D (K,); joint (K,) span L of a scan and the previous one, m/s, zero: they have none.
    The fold is right if the velocity lies in ± L/2, and its difference δ from the previous velocity, folded by the
    previous span, is the smallest of all that the two spans leave, which are d = D D′/L apart: |δ − i D′| < d/2 for a
    whole i. The joint normal law of both is known for any target."""
    right = np.zeros(len(t))
    normal = np.vectorize(NormalDist().cdf, otypes=[float])
    for k in range(1, len(t)):
        if joint[k] == 0:
            continue
        dt, step, previous_span = t[k] - t[k - 1], spans[k] * spans[k - 1] / joint[k], spans[k - 1]
        delta_variance, u_variance = (
            spread[1] ** 2 * dt**2 + 2 * sigma**2,
            spread[0] ** 2 + spread[1] ** 2 * t[k] ** 2 + sigma**2,
        )
        covariance = spread[1] ** 2 * dt * t[k] + sigma**2
        centre, reach = mean[k] - mean[k - 1], INTEGRAL_SIGMAS * delta_variance**0.5
        first, last = (math.floor((centre + side * reach) / previous_span + 0.5) for side in (-1, 1))
        for i in range(first, last + 1):
            low, high = (
                max(i * previous_span - step / 2, centre - reach),
                min(i * previous_span + step / 2, centre + reach),
            )
            if low >= high:
                continue
            pieces = math.ceil((high - low) / delta_variance**0.5)
            edges = np.linspace(low, high, pieces + 1)
            half = np.diff(edges)[:, None] / 2
            delta = edges[:-1, None] + half * (1 + NODES)
            density = np.exp(-((delta - centre) ** 2) / (2 * delta_variance)) / np.sqrt(2 * np.pi * delta_variance)
            u, off = (
                mean[k] + covariance / delta_variance * (delta - centre),
                (u_variance - covariance**2 / delta_variance) ** 0.5,
            )
            probability = normal((joint[k] / 2 - u) / off) - normal((-joint[k] / 2 - u) / off)
            right[k] += float(np.sum(half * NODE_WEIGHTS * density * probability))
    return right


def nearest_fold_probability(gains: Gains, spans: np.ndarray) -> np.ndarray:
    """Probability (K,) that the nearest folds are right up to each scan: ∏ [2Φ(D/2√S) − 1], spans D (K,).

    Exact if the filter's model and prior are those of the truth: its innovations are then independent, N(0, S).
    (Integer bootstrapping: Teunissen, Journal of Geodesy 72, 1998, 606-612.)"""
    normal = NormalDist()
    probabilities = [2 * normal.cdf(D / 2 / S**0.5) - 1 for D, S in zip(spans, gains.variance, strict=True)]
    return np.cumprod(probabilities)
