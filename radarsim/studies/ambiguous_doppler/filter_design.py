"""From a filter's options to the arrays that the kernels read: designs, which give gains, and banks, which unfold."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra
from radarsim.kernels.gap_noise import ONE_PERIOD, manoeuvre_noise
from radarsim.kernels.second_order import as_kernel_array
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.ambiguous_doppler.kernels import layout

UNLIMITED_DEPTH = 10.0**300  # of a list from which no hypothesis is dropped
COMBINATIONS = {"expected_error": layout.WEIGHS, "intersection": layout.CHOOSES}


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
    """F and Q (3, 3) of a motion of order 0, 1 or 2 over a scan, in a state of range, velocity and acceleration.

    Order 2 has a random jerk, order 1 a random acceleration, constant over the scan, of that variance (P1 eqs. 3, 6).
    Order 0 has a random velocity, drawn at each scan with that variance: if measured, it moves the range; else it is
    the step of a random walk."""
    return model_over(order, variance, dt, dt)


def model_over(order: int, variance: float, dt: float, period: float) -> tuple[np.ndarray, np.ndarray]:
    """As `model`, over a time dt: of more than a period as if there were a scan in each."""
    F, Q = np.zeros((3, 3)), np.zeros((3, 3))
    if order == 0:
        F[0, :2], Q[1, 1] = (1.0, dt), variance
        if dt > ONE_PERIOD * period:  # velocities of the scans between last a period each, the latest one what is left
            F[0, 1], (whole, part) = period, divmod(dt / period, 1.0)
            Q[0, 0] = variance * period**2 * (whole - 1.0 + part**2)
    else:
        size = order + 1
        F[:size, :size], Q[:size, :size] = transition(dt, size), manoeuvre_covariance(variance, dt, size)
        if dt > ONE_PERIOD * period:
            Q[:size, :size] = kalman_algebra.unpack(manoeuvre_noise(variance, dt, period, size))[:size, :size]
    return F, Q


def prior_variances(order: int, prior: Any) -> np.ndarray:
    """Variances (2,) of velocity and acceleration before the first plot; zero where the model has none."""
    return np.array([prior.sigma_velocity_mps**2, prior.sigma_acceleration_mps2**2 if order == 2 else 0.0])


def design_row(member: Member, prior: Any, dt: float) -> np.ndarray:
    """The numbers (DESIGN,) of a member's design, as `kernels.layout` has them."""
    F, Q = model(member.order, member.manoeuvre_variance, dt)
    row = np.zeros(layout.DESIGN)
    row[layout.MOTION : layout.MOTION + 5] = F[0, 1], F[0, 2], F[1, 1], F[1, 2], F[2, 2]
    row[layout.NOISE : layout.NOISE + 6] = Q[np.triu_indices(3)]
    row[layout.PRIOR : layout.PRIOR + 2] = prior_variances(member.order, prior)
    row[layout.TAKES_VELOCITY] = {"none": 0, "remainder": 2}.get(member.doppler, 1)
    return row


def fold_treatment(options: Any, doppler: str) -> int:
    """How a filter's bank treats the folds of a member."""
    if doppler != "folded":
        return {"none": layout.NONE, "unfolded": layout.UNFOLDS, "remainder": layout.REMAINDER}[doppler]
    if options.merge == "each_scan":
        return layout.MERGES
    return layout.NEAREST if options.hypotheses == 1 else layout.REMEMBERS


class Bank(NamedTuple):
    """A bank: its kind, with its design, the designs that interact, or the banks that it combines; see
    `layout.Banks`."""

    kind: int
    members: tuple[int, ...]
    orders: tuple[int, ...] = ()
    max_hypotheses: int = 1
    max_depth: float = UNLIMITED_DEPTH
    member_field: int = layout.MEAN
    stay: float = 1.0
    unfolding: int = layout.NONE
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


def banks(spec: Any, shares: Callable[[Any], np.ndarray]) -> layout.Banks:
    """The filters' arrays; shares(options) gives the numbers (K, MAX_MEMBERS, 3) of a filter that combines orders."""
    bank_list = BankList()
    filter_banks = [_add_bank(bank_list, options, spec, shares) for options in spec.filters]
    names = [options.name for options in spec.filters]
    oracles = [i for i, o in enumerate(spec.filters) if o.doppler == "unfolded" and o.combine is None]
    count = len(bank_list.banks)
    bank_shares = np.zeros((count, spec.scans, layout.MAX_MEMBERS, 3))
    bank_members = np.zeros((count, layout.MAX_MEMBERS), np.int64)
    orders = np.zeros((count, layout.MAX_MEMBERS), np.int64)
    for b, bank in enumerate(bank_list.banks):
        if bank.shares:
            bank_shares[b] = np.frombuffer(bank.shares).reshape(bank_shares.shape[1:])
        bank_members[b, : len(bank.members)], orders[b, : len(bank.orders)] = bank.members, bank.orders
    estimate_fields = [layout.MEAN if o.combine in COMBINATIONS else _estimate_field(o) for o in spec.filters]
    integers = {"dtype": np.int64}
    return layout.Banks(
        designs=as_kernel_array(list(bank_list.designs.values()), len(bank_list.designs), layout.DESIGN),
        kind=as_kernel_array([bank.kind for bank in bank_list.banks], count, **integers),
        members=bank_members,
        orders=orders,
        size=as_kernel_array([len(bank.members) for bank in bank_list.banks], count, **integers),
        max_hypotheses=as_kernel_array([bank.max_hypotheses for bank in bank_list.banks], count, **integers),
        max_depth=as_kernel_array([bank.max_depth for bank in bank_list.banks], count),
        member_field=as_kernel_array([bank.member_field for bank in bank_list.banks], count, **integers),
        stay=as_kernel_array([bank.stay for bank in bank_list.banks], count),
        unfolding=as_kernel_array([bank.unfolding for bank in bank_list.banks], count, **integers),
        shares=bank_shares,
        bank=as_kernel_array(filter_banks, len(filter_banks), **integers),
        estimate_field=as_kernel_array(estimate_fields, len(estimate_fields), **integers),
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
        if unfolding == layout.NEAREST:  # the same as a list of one hypothesis
            unfolding = layout.REMEMBERS
        limits = _list_limits(options) if unfolding == layout.REMEMBERS else {}
        stay = options.stay_probability
        return bank_list.bank(Bank(layout.INTERACTS, tuple(designs), orders, stay=stay, unfolding=unfolding, **limits))
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
    if treatment != layout.REMEMBERS:
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
    return layout.BEST if options.estimate == "best" else layout.MEAN
