"""From a filter's options to the arrays that the kernels read: designs, which give gains, and banks, which unfold."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels.linear import plain
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.ambiguous_doppler.kernels import records

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

    Likelihoods can be compared of the same plots alone.
    """
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
    is a random walk's step.
    """
    F, Q = np.zeros((3, 3)), np.zeros((3, 3))
    if order == 0:
        F[0, :2], Q[1, 1] = (1.0, dt), variance
    else:
        size = order + 1
        F[:size, :size], Q[:size, :size] = transition(dt, size), manoeuvre_covariance(variance, dt, size)
    return F, Q


def prior_variances(order: int, prior: Any) -> np.ndarray:
    """Variances (2,) of velocity and acceleration before the first plot; zero of what the model has not."""
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
    held = np.zeros((count, spec.scans, records.MEMBERS, 3))
    for b, one in enumerate(made):
        if one.shares:
            held[b] = np.frombuffer(one.shares).reshape(held.shape[1:])
    parts, orders = np.zeros((count, records.MEMBERS), np.int64), np.zeros((count, records.MEMBERS), np.int64)
    for b, one in enumerate(made):
        parts[b, : len(one.parts)], orders[b, : len(one.orders)] = one.parts, one.orders
    whole = {"dtype": np.int64}
    place = [records.MEAN if one.combine in COMBINATIONS else _read(one) for one in spec.filters]
    return records.Banks(
        designs=plain(list(gathered.designs.values()), len(gathered.designs), records.DESIGN),
        kind=plain([one.kind for one in made], count, **whole),
        parts=parts,
        orders=orders,
        size=plain([len(one.parts) for one in made], count, **whole),
        most=plain([one.most for one in made], count, **whole),
        deepest=plain([one.deepest for one in made], count),
        reads=plain([one.reads for one in made], count, **whole),
        stay=plain([one.stay for one in made], count),
        unfolding=plain([one.unfolding for one in made], count, **whole),
        shares=held,
        bank=plain(bank, len(bank), **whole),
        place=plain(place, len(place), **whole),
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
