"""From a filter's options to the arrays that the kernels read: designs, which give gains, and banks, which unfold."""

import math
from typing import Any

import numpy as np

from radarsim.kernels.linear import plain
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.studies.ambiguous_doppler.kernels import records

BOTTOMLESS = 1e300  # the depth of a list that nothing is dropped from


def model(order: int, variance: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """F and Q (3, 3) of a motion of order 0, 1 or 2 over dt, in a state of range, velocity and acceleration.

    Order 2 has a random jerk, order 1 a random acceleration, constant over the scan, of that variance (P1 eqs. 3, 6).
    Order 0 has a random velocity, drawn anew each scan with that variance: measured, it moves the range; unmeasured, it
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


def components(one: Any) -> tuple[bool, bool, bool]:
    """Which of range, velocity and acceleration a filter estimates."""
    return True, one.order > 0 or one.doppler != "none", one.order > 1


def design_row(one: Any, prior: Any, dt: float) -> np.ndarray:
    """The numbers (DESIGN,) of a filter's design, as `kernels.records` has them."""
    F, Q = model(one.order, one.manoeuvre_variance, dt)
    row = np.zeros(records.DESIGN)
    row[records.MOTION : records.MOTION + 5] = F[0, 1], F[0, 2], F[1, 1], F[1, 2], F[2, 2]
    row[records.NOISE : records.NOISE + 6] = Q[np.triu_indices(3)]
    row[records.PRIOR : records.PRIOR + 2] = prior_variances(one.order, prior)
    row[records.TAKES_VELOCITY] = one.doppler != "none"
    return row


def kind(one: Any) -> int:
    """What a filter's bank does about the folds."""
    if one.doppler != "folded":
        return records.NONE if one.doppler == "none" else records.UNFOLDS
    if one.merge == "each_scan":
        return records.MERGES
    return records.NEAREST if one.hypotheses == 1 else records.REMEMBERS


def banks(spec: Any) -> records.Banks:
    """The filters' arrays; filters that differ in their estimate alone share a bank, those of one model a design."""
    designs: dict[bytes, tuple[int, np.ndarray]] = {}
    made: dict[tuple, int] = {}
    bank, place = [], []
    for one in spec.filters:
        row = design_row(one, spec.prior, spec.radar.scan_period_s)
        number, _ = designs.setdefault(row.tobytes(), (len(designs), row))
        remembers = kind(one) == records.REMEMBERS
        deepest = -math.log(one.prune_below) if remembers and one.prune_below > 0 else BOTTOMLESS
        key = (number, kind(one), one.hypotheses if remembers else 1, deepest)
        bank.append(made.setdefault(key, len(made)))
        place.append(records.BEST if one.estimate == "best" else records.MEAN)
    names = [one.name for one in spec.filters]
    oracles = [i for i, one in enumerate(spec.filters) if one.doppler == "unfolded"]
    columns = [plain(column, len(made), dtype=np.int64) for column in list(zip(*made, strict=True))[:3]]
    return records.Banks(
        designs=plain([row for _, row in designs.values()], len(designs), records.DESIGN),
        design=columns[0],
        kind=columns[1],
        most=columns[2],
        deepest=plain([key[3] for key in made], len(made)),
        bank=plain(bank, len(bank), dtype=np.int64),
        place=plain(place, len(place), dtype=np.int64),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        oracle=oracles[0] if oracles else -1,
    )
