"""The classical rival of the sequence of discriminators: the short-time spectrum's ridge, without a prior.

Quasi maximum likelihood with a refinement in the manner of O'Shea: a short-time Fourier transform gives the frequency
of each stretch of the burst; a robust polynomial through them demodulates the burst; sums over longer and longer
stretches of what is left, unwrapped, give the phase, and a least-squares polynomial its coefficients. Scoring over the
whole burst follows, in the kernels. The prior is used nowhere.

What an efficient estimator would score where P4's sequence is judged: the share of bursts that stay within 3 σ.

An efficient estimator's errors over growing windows are a Gaussian process: with J_k = Φ_k + R_pr⁻¹ the information of
window k, J_k e_k = J_{k−1} e_{k−1} + w, w ~ N(0, Φ_k − Φ_{k−1}). No closed form is known for the share of such paths
that stay within bounds; it is drawn, to 10⁻³.

The nearest loss of lock: of all unit normals z of forecast and noise with which a lock is lost, those of least |z|.

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
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from radarsim.bursts.burst import Burst, World, balanced_inverse, sample_times, sensitivities
from radarsim.bursts.kernels import strip as strips
from radarsim.bursts.kernels.lanes import COLUMNS, END, PASSES, PRIOR
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.engine.results import Layout
from radarsim.kernels.lanes import WIDTH, rows

# ---- ridge -----------------------------------------------------------------------------------------------------------
STRETCH = 256  # pulses of a short-time spectrum
PADDED = 4 * STRETCH
TRIALS = 400  # polynomials through a few stretches each, of which the one with most company starts the fit
INLIER = 2.0 / PADDED  # turns a pulse between ridge and polynomial
ROUNDS = 4  # of fitting to the inliers
SUMS = (150, 300)  # sums in which the demodulated burst is unwrapped, first coarse


class Ridge:
    """Samples (n,), one a pulse, to phase coefficients (size,) in turns over the burst."""

    def __init__(self, pulses: int, size: int):
        self.pulses, self.size = pulses, size
        starts = np.arange(0, pulses - STRETCH + 1, STRETCH // 2)
        self.stretches = starts[:, None] + np.arange(STRETCH)
        self.centres = (starts + 0.5 * (STRETCH - 1)) / pulses
        self.t = np.arange(pulses) / pulses
        # One stretch from each of as many equal parts of the burst as the polynomial has coefficients; fixed draws.
        bounds = np.linspace(0, len(starts), size).astype(int)
        draws = np.random.default_rng(1).random((TRIALS, size - 1))
        self.trials = bounds[:-1] + (draws * np.diff(bounds)).astype(int)

    def __call__(self, samples: np.ndarray) -> np.ndarray:
        rough = self.from_frequencies(self.frequencies(samples))
        for count in SUMS:
            rough = self.refined(samples, rough, count)
        return rough

    def frequencies(self, samples: np.ndarray) -> np.ndarray:
        """Frequency in turns a burst of each stretch: the parabola through the spectrum's peak and its neighbours."""
        from scipy import fft

        windowed = samples[self.stretches] * np.hanning(STRETCH)
        power = np.abs(fft.fft(windowed, PADDED, axis=1)[:, : PADDED // 2 if np.isrealobj(samples) else PADDED]) ** 2
        peak = np.clip(power.argmax(axis=1), 1, power.shape[1] - 2)
        before_peak, at_peak, after_peak = (power[np.arange(len(peak)), peak + d] for d in (-1, 0, 1))
        bend = np.minimum(before_peak - 2.0 * at_peak + after_peak, -1e-12 * at_peak)
        turns = (peak + np.clip(0.5 * (before_peak - after_peak) / bend, -1.0, 1.0)) / PADDED
        if np.iscomplexobj(samples):
            turns = turns - np.rint(turns)
        return turns * self.pulses

    def from_frequencies(self, frequencies: np.ndarray) -> np.ndarray:
        """Coefficients of a robust polynomial through the ridge: random sample consensus, then a fit to the inliers."""
        powers = self.centres[:, None] ** np.arange(self.size - 1)
        slopes = np.linalg.solve(powers[self.trials], frequencies[self.trials][..., None])[..., 0]
        is_inlier = np.abs(slopes @ powers.T - frequencies) < INLIER * self.pulses
        best = slopes[is_inlier.sum(axis=1).argmax()]
        for _ in range(ROUNDS):
            inliers = np.abs(powers @ best - frequencies) < INLIER * self.pulses
            best = np.linalg.lstsq(powers[inliers], frequencies[inliers], rcond=None)[0]
        return np.concatenate([[0.0], best / np.arange(1, self.size)])

    def refined(self, samples: np.ndarray, coefficients: np.ndarray, count: int) -> np.ndarray:
        """Demodulated, summed over stretches, unwrapped, and the remaining phase fitted."""
        turns = np.polynomial.polynomial.polyval(self.t, coefficients)
        bare = samples * np.exp(-2j * np.pi * (turns - np.rint(turns)))
        used = self.pulses // count * count
        sums = bare[:used].reshape(-1, count).sum(axis=1)
        centre = (np.arange(len(sums)) + 0.5 - 0.5 / count) * count / self.pulses
        phase = np.unwrap(np.angle(sums)) / (2.0 * np.pi)
        powers = centre[:, None] ** np.arange(self.size)
        return coefficients + np.linalg.lstsq(powers, phase, rcond=None)[0]


# ---- ceiling ---------------------------------------------------------------------------------------------------------
DRAWS = 1 << 18
SEED = 2010


@lru_cache(maxsize=16)
def always_within(
    burst: Burst,
    pulses: tuple[int, ...],
    prior_sigma: tuple[float, ...],
    factor: float = 3.0,
    noise_factor: float = 1.0,
) -> float:
    """Share of bursts of which every error stays under `factor` posterior σ at every window, these long in pulses.

    prior_sigma (size,) in the units of θ. noise_factor: σ of the true noise over that of the burst, which the
    estimator believes. Standard error under 10⁻³."""
    random = np.random.Generator(np.random.Philox(SEED))
    root = np.diag(1.0 / np.asarray(prior_sigma, dtype=float))
    information = root**2
    score = random.standard_normal((DRAWS, len(root))) @ root  # information times error: a sum of independent parts
    inside = np.ones(DRAWS, dtype=bool)
    for first, last in zip((0, *pulses[:-1]), pulses, strict=True):
        root = _root(burst, first, last, len(prior_sigma))
        information = information + root.T @ root
        score += noise_factor * random.standard_normal((DRAWS, len(root))) @ root
        covariance = balanced_inverse(information)
        inside &= (np.abs(score @ covariance) < factor * np.sqrt(np.diag(covariance))).all(axis=1)
    return float(inside.mean())


def _root(burst: Burst, first: int, last: int, size: int) -> np.ndarray:
    """The upper triangle R (size, size), RᵀR the information of pulses first … last − 1, with a positive diagonal. Of
    the samples themselves and not of their sums, which are too ill conditioned for a root."""
    t = sample_times(burst, last)[:, first:]
    rows = sensitivities(size, burst.duration_s) * (t.ravel()[:, None] / burst.duration_s) ** np.arange(size)
    level = burst.amplitude**2 / burst.noise_variance * (1.0 if burst.complex_samples else 0.5)
    scale = np.sqrt(np.square(rows).sum(axis=0))
    triangle = np.linalg.qr(rows / scale, mode="r")
    return np.sqrt(level) * np.sign(np.diag(triangle))[:, None] * triangle * scale


# ---- nearest ---------------------------------------------------------------------------------------------------------
FIVE = 5.0  # potential σ that a locked component is within
# All distances are multiples of STEP/64, without rounding: a search takes the same turns everywhere.
BEGIN, STEP, END_OF_SEARCH = 1.0, 0.25, 12.0  # σ along a direction at which a loss is looked for
FARTHEST = 8.0  # σ of a loss that is told: once in 10¹⁵
LEAST_GAIN = 1 / 64  # σ by which a turn has to bring the loss nearer
MOST_TURNS = 12
NEARLY = 0.03  # σ by which losses on the two sides of a direction may differ: e^0.15 in a weight
TURNS = (1.0, 0.5, 0.25, 0.125)  # to the normal: as far as the loss comes nearer
ASTRAY = 1.0  # posterior σ between bursts on either side of the boundary, where one has lost its lock
APART = 0.3  # the same after so many steps that the boundary's normal is what they tell, …
FEWEST_STEPS = 4  # … which are those in windows before it too
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


class Room:
    """Work arrays for eight bursts, and the steps of the estimator on them."""

    def __init__(self, plan: Plan):
        self.plan = plan
        self.work, self.sums, self.drawn, self.a, self.b = strips.room_for(len(plan.world.factor))
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
        strips.put_drawn(self.plan.world.sums, self.plan.world.factor, self.a, self.b, self.drawn)

    def follow(self, f: int, errors: np.ndarray, options: np.void | None = None) -> None:
        """Errors (up to 8, K, 6) of estimator f on the bursts in the work arrays, with its own options or others."""
        plan = self.plan
        strips.run_strip(
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
        is_outside = np.abs(self.errors(f, z)[: len(z), last]) >= FIVE * self.plan.potential[f, last]
        return np.asarray(is_outside.any(axis=1))


def either_side(room: Room, f: int, unit: np.ndarray) -> Iterator[Loss]:
    """The nearest losses of estimator f on both sides of a unit vector (6 + 4B,), within MAX_LOSS_DISTANCE.

    The loss on one side is the start of the search on the other, which ends when it is nearly as near there."""
    positive = nearest(room, f, unit)
    if positive is None:
        negative = nearest(room, f, -unit)
    else:
        enough = positive.distance + NEARLY if positive.distance <= FARTHEST else 0.0
        negative = nearest(room, f, -unit, mirrored(positive.unit), enough=enough)
    if negative is not None and (positive is None or negative.distance < positive.distance - NEARLY):
        starts = [unit if positive is None else positive.unit, mirrored(negative.unit)]
        positive = nearest(room, f, *starts, enough=negative.distance + NEARLY)
    yield from (loss for loss in (positive, negative) if loss is not None and loss.distance <= FARTHEST)


def mirrored(unit: np.ndarray) -> np.ndarray:
    """A unit vector (6 + 4B,) with which errors have the other sign, but for the image: that of the conjugate burst. Of
    the normals of a block's Z₀ and Z₁ those of the imaginary parts turn, those of the real ones do not."""
    return unit * np.r_[-np.ones(SIZE), np.tile((1.0, -1.0), (len(unit) - SIZE) // 2)]


def nearest(room: Room, f: int, *starts: np.ndarray, enough: float = 0.0) -> Loss | None:
    """The nearest loss of estimator f that is found from the nearest of unit vectors (6 + 4B,); None if it has none.
    The search ends where one is near `enough`."""
    crossings = [(crossing(room, f, start, BEGIN, END_OF_SEARCH), start) for start in map(rounded, starts)]
    losses = [(distance, start) for distance, start in crossings if distance is not None]
    if not losses:
        return None
    distance, unit = min(losses, key=lambda loss: loss[0])
    for _ in range(MOST_TURNS):
        boundary_normal = normal(room, f, unit, distance) if distance > enough else None
        if boundary_normal is None:
            break
        for share in TURNS:
            turned = rounded(share * boundary_normal + (1.0 - share) * unit)
            new_distance = crossing(room, f, turned, STEP * (0.5 * distance // STEP), distance - LEAST_GAIN)
            if new_distance is not None:
                distance, unit = new_distance, turned
                break
        else:
            break
    return Loss(unit, distance)


def rounded(vector: np.ndarray) -> np.ndarray:
    """The unit vector of a vector (n,), of few digits but of length one."""
    short = np.round(vector / np.linalg.norm(vector), DIGITS)
    return np.asarray(short / math.sqrt(math.fsum(short * short)))


def crossing(room: Room, f: int, unit: np.ndarray, begin: float, farthest: float) -> float | None:
    """How many σ along a unit vector (6 + 4B,) estimator f first loses its lock, to STEP/64; None if not so far."""
    width = STEP
    while width >= STEP / WIDTH**2:
        distances = begin + width * np.arange(1, WIDTH + 1)
        lost = room.lost(f, distances[:, None] * unit)
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


def normal(room: Room, f: int, unit: np.ndarray, distance: float) -> np.ndarray | None:
    """The boundary's unit normal (6 + 4B,), outwards, where estimator f loses its lock: at σ along a unit vector. None
    where the two sides do not part in small steps."""
    plan, options = room.plan, room.plan.options[f].copy()
    sides = np.array([distance - STEP / WIDTH**2, distance])[:, None] * unit
    size, last, middle = plan.layout.shapes["error"][2], int(options["windows"]) - 1, sides.mean(axis=0)
    errors_on_sides = room.errors(f, sides)[:2, : last + 1, :size]
    has_separated = (
        np.abs(errors_on_sides[1] - errors_on_sides[0]) / plan.posterior[f, : last + 1, :size] > ASTRAY
    ).any(axis=1)
    if not has_separated.any():
        component = int(np.argmax(np.abs(errors_on_sides[1, last]) / plan.potential[f, last, :size]))
        along = np.where(np.arange(size) == component, np.sign(errors_on_sides[1, last]), 0.0)
        return gradient(room, f, middle, along, GradientReference(last, options, SMOOTH_DIFFERENCE))
    k, all_steps = int(np.argmax(has_separated)), int(options["steps"])
    options["windows"], sigma = k + 1, plan.posterior[f, k, :size]
    for steps in range(FEWEST_STEPS, all_steps + 1):
        options["steps"] = steps
        errors_on_sides = room.errors(f, sides, options)[:2, k, :size]
        separation = from_turn(errors_on_sides[1] - errors_on_sides[0]) / sigma
        if np.linalg.norm(separation) > APART:
            return gradient(room, f, middle, separation / sigma, GradientReference(k, options, DIFFERENCE))
    return None


def from_turn(errors: np.ndarray) -> np.ndarray:
    """Differences of errors (…, size), the phases to the nearest turn."""
    return np.concatenate([errors[..., :1] - np.rint(errors[..., :1]), errors[..., 1:]], axis=-1)


def gradient(room: Room, f: int, z: np.ndarray, along: np.ndarray, reference: GradientReference) -> np.ndarray | None:
    """The unit vector (6 + 4B,) in which alongᵀ(error) of a window grows fastest at z, along (size,), by differences.
    None where nothing changes it."""
    plan, window = room.plan, room.plan.windows[f, reference.window]
    ends = plan.tables[0].reshape(-1, COLUMNS)[int(window["table"]) + int(window["blocks"]) - 1, END]
    normals_used = SIZE + 4 * int(ends)  # what is drawn later is not in the estimate
    differences, size = np.zeros(len(z)), len(along)
    errors_at_z = room.errors(f, z[None], reference.options)[:1, reference.window, :size]
    for first in range(0, normals_used, WIDTH):
        moved_z = z + reference.difference * np.eye(min(WIDTH, normals_used - first), len(z), first)
        moved_errors = room.errors(f, moved_z, reference.options)[: len(moved_z), reference.window, :size]
        differences[first : first + len(moved_z)] = from_turn(moved_errors - errors_at_z) @ along
    length = np.linalg.norm(differences)
    return differences / length if length > 0.0 else None
