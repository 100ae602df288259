"""Targets and plots of a sonar: random motion, and correlated errors."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.random import U, normals


class World(NamedTuple):
    """Targets and plots of K scans in C coordinates; C is even: an unused coordinate is zero."""

    plots: np.ndarray  #: (2,) key of their noise
    motion: np.ndarray  #: (2,) key of that of the motion
    dt: np.ndarray  #: (K,) interval before a scan
    truth: np.ndarray  #: (K, C, 3)
    steps: np.ndarray  #: (K, C) correlation of an error with that of the previous scan
    fresh: np.ndarray  #: (K, C) standard deviation of its new part
    walk: np.ndarray  #: (C,) that of a random acceleration, constant over each interval


@kernel_part
def push(key, first, pair, dt, walk, c0, c1):
    """Move the deviations of value and rate from the course, c0 and c1 (2, n), by random accelerations walk (2,)."""
    k0, k1, start, walk_0, walk_1 = key[0], key[1], U(first), walk[0], walk[1]
    for i in range(c0.shape[1]):
        a, b = normals(k0, k1, start + U(i), pair)
        a, b = walk_0 * a, walk_1 * b
        c0[0, i] += dt * (c0[1, i] + 0.5 * dt * a)
        c0[1, i] += dt * a
        c1[0, i] += dt * (c1[1, i] + 0.5 * dt * b)
        c1[1, i] += dt * b


@kernel_part
def measure(key, first, pair, step, fresh, mean, c0, c1):
    """Compute the plots of two coordinates c0 and c1 (3, n): plots in row 0, errors in row 1, deviations in row 2.

    An error becomes step · error + fresh · normal (P3 eq. 15), stationary from the first plot on; step, fresh and mean
    (2,)."""
    k0, k1, start = key[0], key[1], U(first)
    step_0, step_1, fresh_0, fresh_1 = step[0], step[1], fresh[0], fresh[1]
    mean_0, mean_1 = mean[0], mean[1]
    for i in range(c0.shape[1]):
        a, b = normals(k0, k1, start + U(i), pair)
        a, b = step_0 * c0[1, i] + fresh_0 * a, step_1 * c1[1, i] + fresh_1 * b
        c0[1, i], c1[1, i] = a, b
        c0[0, i] = mean_0 + c0[2, i] + a
        c1[0, i] = mean_1 + c1[2, i] + b


@kernel
def move_and_measure(world, first, k, plots):
    """Compute scan k of all coordinates in place.

    plots (C, 4, n) holds plot, error, and deviation of value and rate; C is even."""
    pairs = plots.shape[0] // 2
    for p in range(pairs):
        c0, c1 = plots[2 * p], plots[2 * p + 1]
        if k > 0 and (world.walk[2 * p] > 0.0 or world.walk[2 * p + 1] > 0.0):
            push(world.motion, first, k * pairs + p, world.dt[k], world.walk[2 * p : 2 * p + 2], c0[2:], c1[2:])
        step, fresh = world.steps[k, 2 * p : 2 * p + 2], world.fresh[k, 2 * p : 2 * p + 2]
        measure(world.plots, first, k * pairs + p, step, fresh, world.truth[k, 2 * p : 2 * p + 2, 0], c0, c1)
