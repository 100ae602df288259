"""The laws of a plot's errors in strips of eight lanes, as `radarsim.kernels.step_likelihood` takes them.

An outlier is the whole plot, in the first strip, or one of its numbers alone, all equally likely, and never two of
these at once. In the first strip lane 0 has the stated σ and lane 1 near outliers, in the others these two near
outliers to either side; the rest of all are far ones of one width each (`radarsim.kernels.likelihood`). A last strip
has sound plots after a hard manoeuvre, in its first lane."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from radarsim.studies.error_law import ErrorLaw


class PlotLaws(NamedTuple):
    """The arguments of the kernel: factors on σ of a plot's numbers where it starts a track; factors on σ and shifts,
    in σ, by law; the logarithms of the laws' probabilities; factors on σ of the process noise, by strip; and 1 where a
    law has outliers in a number of those used."""

    start_factors: np.ndarray
    factors: np.ndarray
    shifts: np.ndarray
    chances: np.ndarray
    noise_factors: np.ndarray
    outliers: np.ndarray


def has_laws(law: ErrorLaw) -> bool:
    """Whether errors follow more than the stated law."""
    return bool(law.manoeuvres or law.outliers or any(outliers.share for outliers in law.outlier_laws))


def plot_laws(law: ErrorLaw, sigmas: Sequence[float], spans: Sequence[float], used: Sequence[int]) -> PlotLaws:
    """The laws of the numbers of a plot with these σ; used: which of them a filter takes; spans: of their data."""
    from radarsim.kernels.lanes import WIDTH
    from radarsim.kernels.likelihood import FAR_COUNT, FAR_WIDTH, HARD_FACTOR, start_factor

    outliers = law.outlier_rows(1)[0]
    near, far, offset, spread = outliers.tolist()
    hard = 1 + len(used) if near + far > 0 else 1  # the strip of a hard manoeuvre
    strips = hard + 1 if law.manoeuvres else hard
    factors, shifts = np.ones((strips, len(sigmas), WIDTH)), np.zeros((strips, len(sigmas), WIDTH))
    weights, is_outlier = np.zeros((strips, WIDTH)), np.zeros((len(used), strips, WIDTH))
    weights[0, :2], weights[1:hard, :2], weights[:hard, 2:] = (1 - near - far, near), near / 2, far / FAR_COUNT
    is_outlier[:, 0, 1:] = 1.0
    for strip, (number, span) in enumerate(zip(used[: hard - 1], spans, strict=False), 1):
        ratio = max(span / (FAR_WIDTH * sigmas[number]), 1.0) if sigmas[number] > 0 else 1.0
        factors[[0, strip], number, 2:] = FAR_WIDTH * ratio ** np.linspace(0, 1, FAR_COUNT)
        factors[0, number, 1], factors[strip, number, :2] = math.hypot(1, offset, spread), math.hypot(1, spread)
        shifts[strip, number, :2] = offset, -offset
        is_outlier[strip - 1, strip] = 1.0
    # A number is an outlier in two of the strips: with its whole plot, or alone.
    chance = 2 / (1 + (hard - 1) * (near + far))
    at_start = np.full(len(sigmas) * WIDTH, math.sqrt(start_factor(outliers * [chance, chance, 1.0, 1.0])))
    weights *= (1 - law.manoeuvres) / weights.sum()
    weights[hard:, 0] = law.manoeuvres
    with np.errstate(divide="ignore"):
        chances = np.log(weights)
    noise_factors = np.where(np.arange(strips) == hard, math.sqrt(HARD_FACTOR), 1.0)
    return PlotLaws(at_start, factors.ravel(), shifts.ravel(), chances, noise_factors, is_outlier)
