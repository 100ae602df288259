"""The nearest loss of lock: of all unit normals z of forecast and noise with which a lock is lost, those of least |z|.

What is lost is densest there, and a law shifted there has it without heavy weights (the design point of structural
reliability: Hasofer & Lind, Journal of the Engineering Mechanics Division 100, 1974, 111; the search: Rackwitz &
Fiessler, Computers & Structures 9, 1978, 489). Along a unit vector u lock is first lost at s u. If n is the normal of
the boundary there, the plane that touches it is only s nᵀu from the origin: so u turns to n, as long as that brings the
loss nearer.

The normal is a gradient. Of two bursts on either side of the boundary, close to each other, one goes astray in a
window. After a few steps of scoring in it they are still close, but what led across the boundary has grown by each
step, and nothing else has: how far an estimate has gone along their difference is a smooth function of z, and its
gradient the normal. If no window tells them apart, a component of the last one has passed its bounds, and is that
function itself."""

import math
from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from radarsim.bursts.estimators import World
from radarsim.bursts.kernels import sequence_lanes
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.scoring_lanes import COLUMNS, END, PASSES, PRIOR
from radarsim.engine.sums import Layout
from radarsim.kernels.lanes import WIDTH, rows

LOCK_FACTOR = 5.0  # Cramér–Rao bounds that a locked component is within
# All distances are multiples of STEP/64, without rounding: a search takes the same turns everywhere.
SEARCH_BEGIN, STEP, END_OF_SEARCH = 1.0, 0.25, 12.0  # σ along a direction at which a loss is looked for
MAX_LOSS_DISTANCE = 8.0  # σ of a loss that is told: once in 10¹⁵
MIN_GAIN = 1 / 64  # σ by which a turn has to bring the loss nearer
MAX_TURNS = 12
SIDE_TOLERANCE = 0.03  # σ by which losses on the two sides of a direction may differ: e^0.15 in a weight
TURN_SHARES = (1.0, 0.5, 0.25, 0.125)  # to the normal: as far as the loss comes nearer
SEPARATION = 1.0  # posterior σ between bursts on either side of the boundary, where one has lost its lock
MIN_SEPARATION = 0.3  # the same after so many steps that the boundary's normal is what they tell, …
MIN_STEPS = 4  # … which are those in windows before it too
DIFFERENCE, SMOOTH_DIFFERENCE = 1 / 256, 0.05  # σ, of the gradient's differences at a boundary and at bounds
DIGITS = 6  # of a unit vector: the last bits of another processor or LAPACK are not in it


class Plan(Protocol):
    """The part of the study's plan that this search reads."""

    @property
    def layout(self) -> Layout: ...
    @property
    def world(self) -> World: ...
    @property
    def tables(self) -> tuple[np.ndarray, np.ndarray]: ...
    @property
    def windows(self) -> np.ndarray: ...
    @property
    def options(self) -> np.ndarray: ...
    @property
    def prior_sigma(self) -> np.ndarray: ...
    @property
    def potential(self) -> np.ndarray: ...
    @property
    def posterior(self) -> np.ndarray: ...


class Loss(NamedTuple):
    """A unit vector (6 + 4B,) and how many σ along it a burst without other noise is shifted where it loses its lock.

    Its elements: those of the forecast, then of each block four."""

    unit: np.ndarray
    distance: float


class BurstWorkspace:
    """Work arrays for eight bursts, and the steps of the estimator on them."""

    def __init__(self, plan: Plan):
        self.plan = plan
        self.work, self.sums, self.drawn, self.a, self.b = sequence_lanes.allocate_work_arrays(len(plan.world.factor))
        self.along = rows(1)

    def row(self, number: int) -> np.ndarray:
        """A row of work, of eight bursts."""
        return self.work[WIDTH * number : WIDTH * (number + 1)]

    @property
    def passes(self) -> np.ndarray:
        """Passes (8,) of the last call of `follow`."""
        return self.row(PASSES)

    def put(self) -> None:
        """Block sums of the normals in place."""
        sequence_lanes.put_block_sums(self.plan.world.sums, self.plan.world.factor, self.a, self.b, self.drawn)

    def follow(self, f: int, errors: np.ndarray, options: np.void | None = None) -> None:
        """Errors (up to 8, K, 6) of estimator f on the bursts in the work arrays, with its own options or others."""
        plan = self.plan
        sequence_lanes.run_strip(
            *(plan.world.physics, self.drawn, plan.tables, plan.windows[f]),
            *(plan.options[f] if options is None else options, self.work, self.sums, errors),
        )

    def errors(self, f: int, z: np.ndarray, options: np.void | None = None) -> np.ndarray:
        """Errors (n, K, 6) of estimator f with the normals z (n, 6 + 4B), n at most eight; see `Loss` for their order.
        In turns over the burst; zero at windows that the options omit."""
        z = np.concatenate([z, np.repeat(z[-1:], WIDTH - len(z), axis=0)])
        for j in range(SIZE):
            self.row(PRIOR + j)[:] = self.plan.prior_sigma[j] * z[:, j]
        noise = z[:, SIZE:].reshape(WIDTH, -1, 2)
        self.a.reshape(-1, WIDTH)[:], self.b.reshape(-1, WIDTH)[:] = noise[..., 0].T, noise[..., 1].T
        self.put()
        errors = np.zeros((WIDTH, self.plan.windows.shape[1], SIZE))
        self.follow(f, errors, options)
        return errors

    def lost(self, f: int, z: np.ndarray) -> np.ndarray:
        """Whether estimator f loses its lock (n,) with the normals z (n, 6 + 4B)."""
        last = int(self.plan.options[f]["windows"]) - 1
        is_outside = np.abs(self.errors(f, z)[: len(z), last]) >= LOCK_FACTOR * self.plan.potential[f, last]
        return np.asarray(is_outside.any(axis=1))


def losses_on_both_sides(workspace: BurstWorkspace, f: int, unit: np.ndarray) -> Iterator[Loss]:
    """The nearest losses of estimator f on both sides of a unit vector (6 + 4B,), within MAX_LOSS_DISTANCE.

    The loss on one side is the start of the search on the other, which ends when it is nearly as near there."""
    positive = nearest_loss(workspace, f, unit)
    if positive is None:
        negative = nearest_loss(workspace, f, -unit)
    else:
        sufficient_distance = positive.distance + SIDE_TOLERANCE if positive.distance <= MAX_LOSS_DISTANCE else 0.0
        negative = nearest_loss(
            workspace, f, -unit, mirror_unit(positive.unit), sufficient_distance=sufficient_distance
        )
    if negative is not None and (positive is None or negative.distance < positive.distance - SIDE_TOLERANCE):
        starts = [unit if positive is None else positive.unit, mirror_unit(negative.unit)]
        positive = nearest_loss(workspace, f, *starts, sufficient_distance=negative.distance + SIDE_TOLERANCE)
    yield from (loss for loss in (positive, negative) if loss is not None and loss.distance <= MAX_LOSS_DISTANCE)


def mirror_unit(unit: np.ndarray) -> np.ndarray:
    """The unit vector (6 + 4B,) of the conjugate burst, whose errors have the other sign except for the image.

    Among the normals of a block's Z₀ and Z₁, those of the imaginary parts change their sign, the real ones do not."""
    return unit * np.r_[-np.ones(SIZE), np.tile((1.0, -1.0), (len(unit) - SIZE) // 2)]


def nearest_loss(
    workspace: BurstWorkspace, f: int, *starts: np.ndarray, sufficient_distance: float = 0.0
) -> Loss | None:
    """The nearest loss of estimator f, searched for from the nearest of unit vectors (6 + 4B,); None if it has none.

    The search ends at the first loss within sufficient_distance."""
    crossings = [
        (distance_to_loss(workspace, f, start, SEARCH_BEGIN, END_OF_SEARCH), start) for start in map(round_unit, starts)
    ]
    losses = [(distance, start) for distance, start in crossings if distance is not None]
    if not losses:
        return None
    distance, unit = min(losses, key=lambda loss: loss[0])
    for _ in range(MAX_TURNS):
        boundary_normal = loss_boundary_normal(workspace, f, unit, distance) if distance > sufficient_distance else None
        if boundary_normal is None:
            break
        for share in TURN_SHARES:
            turned = round_unit(share * boundary_normal + (1.0 - share) * unit)
            new_distance = distance_to_loss(workspace, f, turned, STEP * (0.5 * distance // STEP), distance - MIN_GAIN)
            if new_distance is not None:
                distance, unit = new_distance, turned
                break
        else:
            break
    return Loss(unit, distance)


def round_unit(vector: np.ndarray) -> np.ndarray:
    """The unit vector of a vector (n,), of few digits but of length one."""
    short = np.round(vector / np.linalg.norm(vector), DIGITS)
    return np.asarray(short / math.sqrt(math.fsum(short * short)))


def distance_to_loss(
    workspace: BurstWorkspace, f: int, unit: np.ndarray, begin: float, farthest: float
) -> float | None:
    """How many σ along a unit vector (6 + 4B,) estimator f first loses its lock, to STEP/64; None if not so far."""
    width = STEP
    while width >= STEP / WIDTH**2:
        distances = begin + width * np.arange(1, WIDTH + 1)
        lost = workspace.lost(f, distances[:, None] * unit)
        begin, width = (distances[np.argmax(lost)] - width, width / WIDTH) if lost.any() else (distances[-1], width)
        if begin >= farthest:
            return None
    distance = float(begin + width * WIDTH)
    return distance if distance <= farthest else None


class GradientReference(NamedTuple):
    """The estimate whose gradient is taken: its window, the options, and the step of the differences in σ."""

    window: int
    options: np.void
    difference: float


def loss_boundary_normal(workspace: BurstWorkspace, f: int, unit: np.ndarray, distance: float) -> np.ndarray | None:
    """The outward unit normal (6 + 4B,) of the boundary at which estimator f loses its lock.

    The boundary is crossed `distance` σ along a unit vector. None where the two sides do not part in small steps."""
    plan, options = workspace.plan, workspace.plan.options[f].copy()
    sides = np.array([distance - STEP / WIDTH**2, distance])[:, None] * unit
    size, last, middle = plan.layout.shapes["error"][2], int(options["windows"]) - 1, sides.mean(axis=0)
    errors_on_sides = workspace.errors(f, sides)[:2, : last + 1, :size]
    has_separated = (
        np.abs(errors_on_sides[1] - errors_on_sides[0]) / plan.posterior[f, : last + 1, :size] > SEPARATION
    ).any(axis=1)
    if not has_separated.any():
        component = int(np.argmax(np.abs(errors_on_sides[1, last]) / plan.potential[f, last, :size]))
        direction = np.where(np.arange(size) == component, np.sign(errors_on_sides[1, last]), 0.0)
        return gradient(workspace, f, middle, direction, GradientReference(last, options, SMOOTH_DIFFERENCE))
    k, all_steps = int(np.argmax(has_separated)), int(options["steps"])
    options["windows"], sigma = k + 1, plan.posterior[f, k, :size]
    for steps in range(MIN_STEPS, all_steps + 1):
        options["steps"] = steps
        errors_on_sides = workspace.errors(f, sides, options)[:2, k, :size]
        separation = phase_difference(errors_on_sides[1] - errors_on_sides[0]) / sigma
        if np.linalg.norm(separation) > MIN_SEPARATION:
            return gradient(workspace, f, middle, separation / sigma, GradientReference(k, options, DIFFERENCE))
    return None


def phase_difference(errors: np.ndarray) -> np.ndarray:
    """Differences of errors (…, size), the phases to the nearest turn."""
    return np.concatenate([errors[..., :1] - np.rint(errors[..., :1]), errors[..., 1:]], axis=-1)


def gradient(
    workspace: BurstWorkspace, f: int, z: np.ndarray, direction: np.ndarray, reference: GradientReference
) -> np.ndarray | None:
    """The unit vector (6 + 4B,) in which directionᵀ(error) of a window grows fastest at z, by differences.

    direction (size,) is over the components of the error. None where nothing changes it."""
    plan, window = workspace.plan, workspace.plan.windows[f, reference.window]
    ends = plan.tables[0].reshape(-1, COLUMNS)[int(window["table"]) + int(window["blocks"]) - 1, END]
    normals_used = SIZE + 4 * int(ends)  # what is drawn later is not in the estimate
    differences, size = np.zeros(len(z)), len(direction)
    errors_at_z = workspace.errors(f, z[None], reference.options)[:1, reference.window, :size]
    for first in range(0, normals_used, WIDTH):
        moved_z = z + reference.difference * np.eye(min(WIDTH, normals_used - first), len(z), first)
        moved_errors = workspace.errors(f, moved_z, reference.options)[: len(moved_z), reference.window, :size]
        differences[first : first + len(moved_z)] = phase_difference(moved_errors - errors_at_z) @ direction
    length = np.linalg.norm(differences)
    return differences / length if length > 0.0 else None
