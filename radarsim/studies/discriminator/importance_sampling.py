"""Where rare losses of lock come from, and bursts drawn from there: importance sampling along the hand-overs.

An estimate at the end of a window is, near the truth, linear in the unit normals z of forecast and noise. What a window
hands over, Δ = e_k − e_{k+1}, is caught when Z = Δᵀ H Δ is small (P4, (16)); Z is nearly λ (uᵀz)², u the unit vector
that the leading singular vector of its root names. So locks are lost where |uᵀz| is large for one of the hand-overs, on
either side; and where, with all hand-overs safe, a component of the last window's own error passes five bounds."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from radarsim.bursts.kernels import sequence_lanes
from radarsim.bursts.kernels.scoring import SIZE, TURN
from radarsim.bursts.kernels.scoring_lanes import COLUMNS, END, RATIO, SHIFT, WEIGHTS, M, S
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.random import fill_normal_strip
from radarsim.studies.discriminator import nearest_loss
from radarsim.studies.discriminator.kernels import weights as kernels_weights

MIN_SHARE = 0.1  # of a direction, over that of the likeliest


class RarePlan(nearest_loss.Plan, Protocol):
    """The part of the study's plan that importance sampling reads."""

    @property
    def keys(self) -> np.ndarray: ...
    @property
    def mixture(self) -> kernels_weights.Mixture | None: ...


class NoLoss(ValueError):
    """Along no direction is a lock lost."""


@dataclass(frozen=True)
class WindowErrorMaps:
    """Errors at each window of an estimator as maps (K, size, 6 + 4B) of unit normals to turns over the burst.

    Columns: those of the forecast, then of each block four."""

    forecast: np.ndarray
    errors: np.ndarray


def window_error_maps(plan: RarePlan, f: int) -> WindowErrorMaps:
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
        block_of = np.repeat(np.arange(blocks), np.diff(ends, prepend=0))  # the window's block of each one drawn
        weights_of_blocks = weights.reshape(-1, WEIGHTS)[
            int(window["weights"]) : int(window["weights"]) + len(block_of)
        ]
        mean, slope = np.ones((size, blocks)), np.zeros((size, blocks))
        mean[1:], slope[1:] = row[:, M : M + size - 1].T, row[:, S : S + size - 1].T
        zeroth, first = (
            mean[:, block_of] + slope[:, block_of] * weights_of_blocks[:, SHIFT],
            slope[:, block_of] * weights_of_blocks[:, RATIO],
        )
        g = law[: len(block_of)].T  # the rows of the imaginary parts of Z₀ and Z₁
        parts = [zeroth * g[1] + first * g[6], zeroth * g[2] + first * g[7], first * g[8], first * g[9]]
        gradient = np.zeros((size, SIZE + count))
        gradient[:, SIZE : SIZE + 4 * len(block_of)] = weight * np.stack(parts, axis=2).reshape(size, -1)
        powers = window["powers"][:size, None]
        if not plan.options[f]["from_truth"]:
            gradient += window["precision"][:size, None] * powers * forecast
        root = window["root"][:size, :size]
        errors[k] = root.T @ (root @ gradient) / powers
    return WindowErrorMaps(forecast, errors)


def directions(plan: RarePlan, f: int) -> np.ndarray:
    """Unit vectors (M, 6 + 4B) along which estimator f loses lock: its hand-overs', then its last window's components.
    Of the first window the start is the forecast, of which the phase is not used."""
    maps, units = window_error_maps(plan, f), []
    handed_over = [maps.forecast, *maps.errors[:-1]]
    for k, window in enumerate(plan.windows[f, : len(maps.errors)]):
        if k == 0 and plan.options[f]["from_truth"]:
            continue
        size, drop = len(maps.forecast), int(k == 0)
        root = window["root"][:size, :size]
        delta = window["powers"][:size, None] * (handed_over[k] - maps.errors[k])
        # Σ v vᵀ = (Φ + P)⁻¹ over the root's rows; without the phase the form is a block of Φ + P, not its complement.
        form = np.linalg.inv(root.T @ root)[drop:, drop:]
        units.append(leading_vector(np.linalg.cholesky(form).T @ delta[drop:]))
    last = maps.errors[-1]
    return np.array([*units, *(last / np.linalg.norm(last, axis=1, keepdims=True))])


def leading_vector(matrix: np.ndarray) -> np.ndarray:
    """The right singular vector (n,) of the largest singular value of a matrix (m, n), m small; its side is fixed."""
    vectors = np.linalg.eigh(matrix @ matrix.T)[1]
    vector = vectors[:, -1] @ matrix
    vector = vector / np.linalg.norm(vector)
    # An eigenvector's sign is LAPACK's choice.
    return vector * np.sign(vector[np.argmax(np.abs(vector))])


def mixture(plan: RarePlan, f: int, plain: float) -> kernels_weights.Mixture:
    """The mixture for the losses of estimator f at its last window, with a share of plain bursts.

    Along each direction it finds the nearest losses on both sides. Each of them is the shift of one law, whose share
    grows with the probability beyond it. Raises NoLoss where there is none."""
    workspace = nearest_loss.BurstWorkspace(plan)
    losses = [loss for unit in directions(plan, f) for loss in nearest_loss.losses_on_both_sides(workspace, f, unit)]
    if not losses:
        raise NoLoss(
            f"loses no lock within {nearest_loss.MAX_LOSS_DISTANCE:g} σ along any direction: far rarer than 10⁻¹²"
        )
    units, shift = np.array([loss.unit for loss in losses]), np.array([loss.distance for loss in losses])
    chance = np.array([math.erfc(distance / math.sqrt(2.0)) for distance in shift])
    return mixture_from_directions(plan, units, shift, chance + MIN_SHARE * chance.max(), plain)


def mixture_from_directions(
    plan: RarePlan, units: np.ndarray, shift: np.ndarray, shares: np.ndarray, plain: float
) -> kernels_weights.Mixture:
    """A mixture of directions units (M, 6 + 4B), shifts and shares (M,) among those that are not plain."""
    sigma, noise = plan.prior_sigma, units[:, SIZE:].reshape(len(units), -1, 4)
    cumulative = np.cumsum([plain, *((1.0 - plain) * shares / shares.sum())])
    cumulative[-1] = 1.0
    return kernels_weights.Mixture(
        cumulative=cumulative,
        shift=np.asarray(shift, dtype=float),
        forecast=units[:, :SIZE] * sigma,
        weight=np.where(sigma > 0.0, units[:, :SIZE] / np.where(sigma > 0.0, sigma, 1.0), 0.0),
        first=np.ascontiguousarray(noise[:, :, [0, 2]].reshape(len(units), -1)),
        second=np.ascontiguousarray(noise[:, :, [1, 3]].reshape(len(units), -1)),
    )


def weighted_estimates(plan: RarePlan, first: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Errors (count, F, K, 6) and passes (count, F) as `study.estimate`, weights (count,), and whether it is plain."""
    law, shape = plan.mixture, plan.windows.shape
    assert law is not None  # a case with `rare` has one
    errors, passes = np.zeros((count, *shape, SIZE)), np.zeros((count, shape[0]), np.int64)
    weights, law_indices = np.empty(count), np.zeros(-(-count // WIDTH) * WIDTH, np.int64)
    workspace = nearest_loss.BurstWorkspace(plan)
    kernels_weights.choose(plan.keys[2], first, law.cumulative, law_indices)
    for start in range(0, count, WIDTH):
        stop = min(start + WIDTH, count)
        sequence_lanes.draw_forecasts(plan.keys[1], first + start, plan.prior_sigma, workspace.work)
        fill_normal_strip(plan.keys[0], first + start, 0, workspace.a, workspace.b)
        kernels_weights.move(law, law_indices[start : start + WIDTH], workspace.work, workspace.a, workspace.b)
        kernels_weights.weigh(law, workspace.work, workspace.a, workspace.b, workspace.along, weights[start:stop])
        workspace.put()
        for f in range(shape[0]):
            workspace.follow(f, errors[start:stop, f])
            passes[start:stop, f] = workspace.passes[: stop - start]
    return errors, passes, weights, law_indices[:count] == 0
