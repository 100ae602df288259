"""Design of the controls: Kalman filters of gains computed beforehand, whose errors have known moments, and slopes.

A control has the motion of one model of a filter's bank. Its gains are those of a Kalman filter whose plots have the
covariance R₀ = G G' of the plots at the truth, so they are the same in all realisations, and it is fed with the plot's
error as linearised there, w = G n. Its error is then a linear function of the noise n, of which mean and covariance
follow by recursion, exactly: with the chance p that a plot comes, in letters of `kernels.controls`,

    m⁻ = F m + (F x₋ − x)         mean error of the prediction; x₋, x: the true state before and now
    m = m⁻ − p K H m⁻             of the estimate
    C⁻ = F C F'                   covariance of the error
    C = (1 − p) C⁻ + p (A C⁻ A' + K R₀ K') + p (1 − p) K h h' K',  A = I − K H,  h = H m⁻

This holds for any gain K and any h, so both are held over some scans where they change little.

A filter's squared error is regressed on d and d² − E d² of the controls of its own models, d the control's error less
m, in a pilot with noise of its own. So the slopes do not depend on a run's realisations, and what they take off has
expectation zero, whatever the slopes. (Glasserman, Monte Carlo Methods in Financial Engineering, 2003, 4.1.)
"""

from collections.abc import Callable, Mapping
from threading import Lock

import numpy as np

from radarsim.physics import frames
from radarsim.studies.multimodel import filters
from radarsim.studies.multimodel.config import Keys, Sensor
from radarsim.studies.multimodel.kernels import controls as kernel
from radarsim.studies.multimodel.kernels import records, sums
from radarsim.studies.multimodel.kernels.records import STATES

PILOT = 1024  # realisations of the pilot: 24 slopes of a filter of three models widen an interval by 1.2 %
# Where the parts of a stage end, in shares of its scans: a filter's errors are largest where a stage begins.
ENDS = (1 / 32, 1 / 8, 1 / 2, 1)
RIDGE = 1e-9  # of the correlations of regressors, which of two models nearly alike are singular
POSITIONS = slice(0, STATES, 3)
DIMENSIONS = {name: len(shape) for name, shape in records.controlled_shapes(0, 0, 0).items()}

assert len(ENDS) == records.PARTS


def bank(spec: Keys) -> tuple[list[tuple[float, float, float]], np.ndarray]:
    """The different models of all filters, as `filters.bank` has them, and the number of each model's (F, 8)."""
    models: list[tuple[float, float, float]] = []
    own = np.zeros((len(spec.filters), 8), dtype=np.int64)
    for f, options in enumerate(spec.filters):
        for j, model in enumerate(options.models):
            key = (*filters.MOTIONS[model.motion], model.sigma_acceleration_mps2)
            if key not in models:
                models.append(key)
            own[f, j] = models.index(key)
    return models, own


def plot_noise(sensor: Sensor, plot_truth: np.ndarray) -> np.ndarray:
    """G (K, 3, 3): the error of a plot in the local frame is G n, linearised at the truth (K, PLOT_TRUTH)."""
    if sensor.sigma_range_m is None:
        return np.tile(np.diag(sensor.sigma), (len(plot_truth), 1, 1))
    sines = plot_truth[:, [records.ELEVATION, records.AZIMUTH]]
    biconical = np.column_stack([plot_truth[:, records.RANGE], np.arcsin(sines)])
    R = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    return R @ frames.jacobian(biconical) * np.asarray(sensor.sigma)


def steps(models: list[tuple[float, float, float]], times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F and Q (U, C, 3, 3) of one axis of each model over each interval times (U,), s: P2 eq. (11)."""
    moves, accelerates, sigma = np.transpose(models)
    t = np.asarray(times)[:, None]
    g = np.stack(np.broadcast_arrays(t**2 / 2, moves * t, accelerates), axis=-1)
    F = np.zeros((len(times), len(models), 3, 3))
    F[..., 0, 0], F[..., 0, 1], F[..., 0, 2] = 1, moves * t, accelerates * t**2 / 2
    F[..., 1, 1], F[..., 1, 2], F[..., 2, 2] = moves, accelerates * t, accelerates
    return F, (sigma**2)[:, None, None] * g[..., :, None] * g[..., None, :]


def held(scans: int) -> np.ndarray:
    """The number of the gain that each scan has (K,): ever longer the same one, up to sixteen scans.

    Gains settle, and the place of the target changes them little from scan to scan. Any gains leave a control exact;
    so few fit into a processor's nearest memory.
    """
    each = np.clip(np.arange(scans) // 64, 1, 16)
    return np.floor(np.cumsum(1 / each) - 1 / each + 1e-9).astype(np.int64)


def first_estimate(world: records.World) -> np.ndarray:
    """The weight (START, 9, 3) of each of the first plots in the first estimate, as `strip.start` makes it."""
    W = np.zeros((records.START, STATES, 3))
    for axis in range(3):
        W[:, 3 * axis, axis], W[:, 3 * axis + 1, axis] = world.weights[:3], world.weights[3:6]
    return W


def moments(
    spec: Keys, world: records.World, noise: np.ndarray, row: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of a case's controls the gains (C, G, CONTROL), F of one axis (C, U, CONTROL_STEP), and E d² (C, K, 9), exactly.

    noise: G (K, 3, 3); row (K,): number of each scan's gain.
    """
    models, _ = bank(spec)
    F, Q = steps(models, world.times)
    x, p, axes, eye = world.truth, spec.sensor.detection_probability, np.eye(3), np.eye(STATES)
    R, W, a = noise @ noise.transpose(0, 2, 1), first_estimate(world), world.weights[6:]
    C = np.tile((W @ R[: records.START] @ W.transpose(0, 2, 1)).sum(axis=0), (len(models), 1, 1))
    P = C + np.kron(axes, np.outer(a, a))
    m = np.tile((W @ x[: records.START, POSITIONS, None]).sum(axis=0)[:, 0] - x[records.START - 1], (len(models), 1))
    gains, variances = np.zeros((len(models), row[-1] + 1, records.CONTROL)), np.zeros((len(models), len(x), STATES))
    K, h, current = np.zeros((len(models), STATES, 3)), np.zeros((len(models), 3)), -1
    for k in range(records.START, len(x)):
        step, drift = np.kron(axes, F[world.intervals[k]]), np.kron(axes, Q[world.intervals[k]])
        P, C = step @ P @ step.transpose(0, 2, 1) + drift, step @ C @ step.transpose(0, 2, 1)
        predicted = np.einsum("cij,cj->ci", step, m + x[k - 1]) - x[k]
        renewed, current = row[k] != current, row[k]
        if renewed:
            K, h = P[:, :, POSITIONS] @ np.linalg.inv(P[:, POSITIONS, POSITIONS] + R[k]), predicted[:, POSITIONS]
        A, plot, missed = eye - K @ eye[POSITIONS], K @ R[k] @ K.transpose(0, 2, 1), np.einsum("cij,cj->ci", K, h)
        P = (1 - p) * P + p * (A @ P @ A.transpose(0, 2, 1) + plot)
        C = (1 - p) * C + p * (A @ C @ A.transpose(0, 2, 1) + plot)
        C += p * (1 - p) * missed[:, :, None] * missed[:, None, :]
        m = predicted - p * np.einsum("cij,cj->ci", K, predicted[:, POSITIONS])
        variances[:, k] = np.diagonal(C, axis1=1, axis2=2)
        if renewed:
            gains[:, current] = np.concatenate([K.reshape(len(models), -1), h, m, np.zeros((len(models), 1))], axis=1)
    return gains, F[:, :, [0, 0, 1, 1, 2], [1, 2, 1, 2, 2]].transpose(1, 0, 2).copy(), variances


def parts(world: records.World) -> np.ndarray:
    """The part of a stage that each scan belongs to (K,), PARTS a stage."""
    found = world.stage * records.PARTS
    for s in range(len(world.lengths)):
        scans = np.flatnonzero((world.stage == s) & (np.arange(len(found)) >= records.START))
        found[scans] += np.searchsorted(ENDS, (np.arange(len(scans)) + 0.5) / max(len(scans), 1))
    return found


def designed(spec: Keys, world: records.World) -> records.Controls:
    """The controls of a case, their slopes still zero, for a pilot."""
    noise, (_, own) = plot_noise(spec.sensor, world.plot_truth), bank(spec)
    members, most = len(spec.filters), max(len(options.models) for options in spec.filters)
    row, part, stages = held(len(noise)), parts(world), len(world.lengths)
    gains, steps_, variances = moments(spec, world, noise, row)
    sums_ = np.zeros((len(gains), stages * records.PARTS, STATES))
    for k in range(records.START, len(noise)):
        sums_[:, part[k]] += variances[:, k]
    reported = np.flatnonzero(world.reported)
    return records.Controls(
        mode=np.array([records.PILOT]),
        gains=gains,
        steps=steps_,
        row=row,
        part=part,
        noise=noise.reshape(len(noise), -1),
        own=own,
        variances=np.ascontiguousarray(variances[:, reported].swapaxes(0, 1)),
        sums=sums_,
        scans=np.zeros((len(reported), members, STATES, 1 + 2 * most)),
        stages=np.zeros((stages, members, STATES, 1 + records.PARTS * records.COLLECTED * most)),
    )


def none(members: int) -> records.Controls:
    """No controls beside so many filters, for a kernel that takes some."""
    empty = np.zeros((0, members, STATES, 1))
    return records.Controls(
        mode=np.array([records.NO_CONTROLS]),
        gains=np.zeros((0, 0, records.CONTROL)),
        steps=np.zeros((0, 0, records.CONTROL_STEP)),
        row=np.zeros(0, dtype=np.int64),
        part=np.zeros(0, dtype=np.int64),
        noise=np.zeros((0, STATES)),
        own=np.zeros((members, 8), dtype=np.int64),
        variances=np.zeros((0, 0, STATES)),
        sums=np.zeros((0, 0, STATES)),
        scans=empty,
        stages=empty,
    )


def beside(
    controls: records.Controls, arrays: Mapping[str, np.ndarray], products: records.Products | None = None
) -> kernel.Beside:
    """What the kernel takes of controls: with memory, the named sums in arrays, where there are some, and products."""
    empty = np.zeros((0, 0, STATES, 0))
    named = {name: arrays.get(name, np.zeros((0,) * n)) for name, n in DIMENSIONS.items()}
    memory = kernel.memory(len(controls.gains), len(controls.own), len(controls.stages))
    return kernel.Beside(controls, memory, records.ControlSums(**named), products or records.Products(empty, empty))


def piloted(spec: Keys, world: records.World, banks: records.Banks) -> records.Controls:
    """The controls of a case with their slopes, from realisations of a world whose noise is that of no run."""
    controls = designed(spec, world)
    members, reported, stages = len(spec.filters), len(controls.scans), len(controls.stages)
    products = records.Products(*(sums_of(slopes) for slopes in (controls.scans, controls.stages)))
    plain = records.Sums(*(np.zeros(shape) for shape in records.shapes(members, reported, stages).values()))
    memory, asked = sums.memory(members, stages), beside(controls, {}, products)
    sums.simulate_block(world, banks, memory, plain, 0, 0, PILOT, asked)
    for f, options in enumerate(spec.filters):
        for slopes, found, each in zip(controls[-2:], products, (2, records.PARTS * records.COLLECTED), strict=True):
            count = each * len(options.models)
            slopes[:, f, :, : 1 + count] = regressed(found[:, f], count, PILOT)
    return controls._replace(mode=np.array([records.CONTROLLED]))


def sums_of(slopes: np.ndarray) -> np.ndarray:
    """Zeros (…, n) for the sums that slopes (…, 1 + regressors) are regressed from."""
    return np.zeros((*slopes.shape[:-1], records.products(slopes.shape[-1] - 1)))


def regressed(products: np.ndarray, regressors: int, count: int) -> np.ndarray:
    """Level and slopes (…, 1 + regressors) of y on its regressors, from sums (…, n) over `count` realisations.

    The sums are as `records.products` counts them. By least squares with an intercept; the level is the mean of y. What
    does not vary has slope zero.
    """
    size = 1 + regressors
    mean = products[..., :size] / count
    upper = np.triu_indices(size)
    S = np.zeros((*products.shape[:-1], size, size))
    S[..., upper[0], upper[1]] = products[..., size : size + len(upper[0])] / count
    S[..., upper[1], upper[0]] = S[..., upper[0], upper[1]]
    S -= mean[..., :, None] * mean[..., None, :]
    scale = np.sqrt(np.maximum(np.diagonal(S, axis1=-2, axis2=-1), 0))
    scale = np.where(scale > 0, scale, 1.0)
    S /= scale[..., :, None] * scale[..., None, :]
    normal = S[..., 1:, 1:] + RIDGE * np.eye(regressors)
    slopes = np.linalg.solve(normal, S[..., 1:, :1])[..., 0] * scale[..., :1] / scale[..., 1:]
    return np.concatenate([mean[..., :1], slopes], axis=-1)


class Once:
    """What is made when it is first asked for, by whichever thread asks first; the others wait."""

    def __init__(self, make: Callable[[], records.Controls]):
        self._make, self._lock = make, Lock()
        self._made: records.Controls | None = None

    def __call__(self) -> records.Controls:
        with self._lock:
            if self._made is None:
                self._made = self._make()
            return self._made
