"""Where rare losses of lock come from, and bursts drawn from there: importance sampling along the hand-overs.

An estimate at the end of a window is, near the truth, linear in the unit normals z of forecast and noise. What a window
hands over, Δ = e_k − e_{k+1}, is caught when Z = Δᵀ H Δ is small (P4, (16)); Z is nearly λ (uᵀz)², u the unit vector
that the leading singular vector of its root names. So locks are lost where |uᵀz| is large for one of the hand-overs,
on either side; and where, with all hand-overs safe, a component of the last window's own error passes five bounds.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from radarsim.bursts.kernels import strip as strips
from radarsim.bursts.kernels.lanes import COLUMNS, END, RATIO, SHIFT, WEIGHTS, M, S
from radarsim.bursts.kernels.scoring import SIZE, TURN
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.random import fill_normal_strip
from radarsim.studies.discriminator import nearest
from radarsim.studies.discriminator.kernels import rare as kernels

LEAST_SHARE = 0.1  # of a direction, over that of the likeliest


class Plan(nearest.Plan, Protocol):
    """What of the study's plan is used; see there."""

    @property
    def keys(self) -> np.ndarray: ...
    @property
    def mixture(self) -> kernels.Mixture | None: ...


class NoLoss(ValueError):
    """Along no direction is a lock lost."""


@dataclass(frozen=True)
class Linear:
    """Errors at each window of an estimator as maps (K, size, 6 + 4B) of unit normals to turns over the burst.

    Columns: those of the forecast, then of each block four.
    """

    forecast: np.ndarray
    errors: np.ndarray


def linear(plan: Plan, f: int) -> Linear:
    """How the errors of estimator f follow from the normals, to first order about the truth."""
    size, law = plan.layout.shapes["error"][2], plan.world.factor
    count, forecast = 4 * len(law), np.zeros((size, SIZE + 4 * len(law)))
    forecast[:, :size] = np.diag(plan.prior_sigma[:size])
    weight = TURN * float(plan.world.physics["amplitude"]) / float(plan.world.physics["sigma"]) ** 2
    errors = np.zeros((int(plan.options[f]["windows"]), size, SIZE + count))
    table, weights = plan.tables
    for k, window in enumerate(plan.windows[f, : len(errors)]):
        begin, blocks = int(window["table"]), int(window["blocks"])
        row = table.reshape(-1, COLUMNS)[begin : begin + blocks]
        ends = row[:, END].astype(int)
        of = np.repeat(np.arange(blocks), np.diff(ends, prepend=0))  # the window's block of each one drawn
        joining = weights.reshape(-1, WEIGHTS)[int(window["weights"]) : int(window["weights"]) + len(of)]
        mean, slope = np.ones((size, blocks)), np.zeros((size, blocks))
        mean[1:], slope[1:] = row[:, M : M + size - 1].T, row[:, S : S + size - 1].T
        zeroth, first = mean[:, of] + slope[:, of] * joining[:, SHIFT], slope[:, of] * joining[:, RATIO]
        g = law[: len(of)].T  # the rows of the imaginary parts of Z₀ and Z₁
        parts = [zeroth * g[1] + first * g[6], zeroth * g[2] + first * g[7], first * g[8], first * g[9]]
        gradient = np.zeros((size, SIZE + count))
        gradient[:, SIZE : SIZE + 4 * len(of)] = weight * np.stack(parts, axis=2).reshape(size, -1)
        powers = window["powers"][:size, None]
        if not plan.options[f]["from_truth"]:
            gradient += window["precision"][:size, None] * powers * forecast
        root = window["root"][:size, :size]
        errors[k] = root.T @ (root @ gradient) / powers
    return Linear(forecast, errors)


def directions(plan: Plan, f: int) -> np.ndarray:
    """Unit vectors (M, 6 + 4B) along which estimator f loses lock: its hand-overs', then its last window's components.

    Of the first window the start is the forecast, of which the phase is not used.
    """
    maps, found = linear(plan, f), []
    before = [maps.forecast, *maps.errors[:-1]]
    for k, window in enumerate(plan.windows[f, : len(maps.errors)]):
        if k == 0 and plan.options[f]["from_truth"]:
            continue
        size, drop = len(maps.forecast), int(k == 0)
        root = window["root"][:size, :size]
        delta = window["powers"][:size, None] * (before[k] - maps.errors[k])
        # Σ v vᵀ = (Φ + P)⁻¹ over the root's rows; without the phase the form is a block of Φ + P, not its complement.
        form = np.linalg.inv(root.T @ root)[drop:, drop:]
        found.append(leading(np.linalg.cholesky(form).T @ delta[drop:]))
    last = maps.errors[-1]
    return np.array([*found, *(last / np.linalg.norm(last, axis=1, keepdims=True))])


def leading(matrix: np.ndarray) -> np.ndarray:
    """The right singular vector (n,) of the largest singular value of a matrix (m, n), m small; its side is fixed."""
    vectors = np.linalg.eigh(matrix @ matrix.T)[1]
    found = vectors[:, -1] @ matrix
    found = found / np.linalg.norm(found)
    # An eigenvector's sign is LAPACK's choice.
    return found * np.sign(found[np.argmax(np.abs(found))])


def mixture(plan: Plan, f: int, plain: float) -> kernels.Mixture:
    """The mixture for the losses of estimator f at its last window, with a share of plain bursts.

    From each direction the nearest losses on both sides are looked for; each is shifted to, and has a share by the
    probability of what lies beyond it. Raises NoLoss where there is none.
    """
    room = nearest.Room(plan)
    found = [loss for unit in directions(plan, f) for loss in nearest.either_side(room, f, unit)]
    if not found:
        raise NoLoss(f"loses no lock within {nearest.FARTHEST:g} σ along any direction: far rarer than 10⁻¹²")
    units, shift = np.array([loss.unit for loss in found]), np.array([loss.distance for loss in found])
    chance = np.array([math.erfc(one / math.sqrt(2.0)) for one in shift])
    return made(plan, units, shift, chance + LEAST_SHARE * chance.max(), plain)


def made(plan: Plan, units: np.ndarray, shift: np.ndarray, shares: np.ndarray, plain: float) -> kernels.Mixture:
    """A mixture of directions units (M, 6 + 4B), shifts and shares (M,) among those that are not plain."""
    sigma, noise = plan.prior_sigma, units[:, SIZE:].reshape(len(units), -1, 4)
    cumulative = np.cumsum([plain, *((1.0 - plain) * shares / shares.sum())])
    cumulative[-1] = 1.0
    return kernels.Mixture(
        cumulative=cumulative,
        shift=np.asarray(shift, dtype=float),
        forecast=units[:, :SIZE] * sigma,
        weight=np.where(sigma > 0.0, units[:, :SIZE] / np.where(sigma > 0.0, sigma, 1.0), 0.0),
        first=np.ascontiguousarray(noise[:, :, [0, 2]].reshape(len(units), -1)),
        second=np.ascontiguousarray(noise[:, :, [1, 3]].reshape(len(units), -1)),
    )


def estimate(plan: Plan, first: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Errors (count, F, K, 6) and passes (count, F) as `study.estimate`, weights (count,), and whether it is plain."""
    law, shape = plan.mixture, plan.windows.shape
    assert law is not None  # a case with `rare` has one
    errors, passes = np.zeros((count, *shape, SIZE)), np.zeros((count, shape[0]), np.int64)
    weights, chosen = np.empty(count), np.zeros(-(-count // WIDTH) * WIDTH, np.int64)
    room = nearest.Room(plan)
    kernels.choose(plan.keys[2], first, law.cumulative, chosen)
    for start in range(0, count, WIDTH):
        stop = min(start + WIDTH, count)
        strips.draw_forecasts(plan.keys[1], first + start, plan.prior_sigma, room.work)
        fill_normal_strip(plan.keys[0], first + start, 0, room.a, room.b)
        kernels.move(law, chosen[start : start + WIDTH], room.work, room.a, room.b)
        kernels.weigh(law, room.work, room.a, room.b, room.along, weights[start:stop])
        room.put()
        for f in range(shape[0]):
            room.follow(f, errors[start:stop, f])
            passes[start:stop, f] = room.passes[: stop - start]
    return errors, passes, weights, chosen[:count] == 0
