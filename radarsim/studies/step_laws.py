"""The laws of a plot's errors in strips of eight lanes, as `radarsim.kernels.step_likelihood` takes them.

Each number is an outlier by a law of its own, whatever the others are. One of them is alone, or all are together:
other sets are so rare that they are left out. In the first strip lane 0 has the stated σ, and of outliers in all
numbers lane 1 has near ones, the others have far ones of one width each (`radarsim.kernels.likelihood`). A strip for
each number alone has near ones to either side in lanes 0 and 1, and far ones. A last strip has sound plots after a hard
manoeuvre, in its first lane."""

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
    from radarsim.kernels.likelihood import FAR, FAR_COUNT, FAR_WIDTH, HARD_FACTOR, NEAR, OFFSET, SPREAD, start_factor

    outliers = law.outlier_rows(len(used))
    hard = 1 + len(used) if outliers[:, [NEAR, FAR]].any() else 1  # the strip of a hard manoeuvre
    strips = hard + 1 if law.manoeuvres else hard
    factors, shifts = np.ones((strips, len(sigmas), WIDTH)), np.zeros((strips, len(sigmas), WIDTH))
    weights, is_outlier = np.zeros((strips, WIDTH)), np.zeros((len(used), strips, WIDTH))
    start_factors = np.ones((len(sigmas), WIDTH))
    odds = outliers[:, [NEAR, FAR]] / (1 - outliers[:, [NEAR, FAR]].sum(axis=1, keepdims=True))
    weights[0, 0], is_outlier[:, 0, 1:] = 1.0, 1.0
    if len(used) > 1:
        weights[0, 1], weights[0, 2:] = odds.prod(axis=0) / (1, FAR_COUNT)
    for strip, (number, span) in enumerate(zip(used[: hard - 1], spans, strict=False), 1):
        offset, spread = outliers[strip - 1, [OFFSET, SPREAD]]
        ratio = max(span / (FAR_WIDTH * sigmas[number]), 1.0) if sigmas[number] > 0 else 1.0
        weights[strip, :2], weights[strip, 2:] = odds[strip - 1] / (2, FAR_COUNT)
        factors[[0, strip], number, 2:] = FAR_WIDTH * ratio ** np.linspace(0, 1, FAR_COUNT)
        factors[0, number, 1], factors[strip, number, :2] = math.hypot(1, offset, spread), math.hypot(1, spread)
        shifts[strip, number, :2] = offset, -offset
        is_outlier[strip - 1, strip] = 1.0
        start_factors[number] = math.sqrt(start_factor(outliers[strip - 1]))
    weights *= (1 - law.manoeuvres) / weights.sum()
    weights[hard:, 0] = law.manoeuvres
    with np.errstate(divide="ignore"):
        chances = np.log(weights)
    noise_factors = np.where(np.arange(strips) == hard, math.sqrt(HARD_FACTOR), 1.0)
    return PlotLaws(start_factors.ravel(), factors.ravel(), shifts.ravel(), chances, noise_factors, is_outlier)
