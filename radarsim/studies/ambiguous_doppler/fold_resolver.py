"""Unfolds recorded velocities: by the span of a row, or by those of two rows."""

import math
from typing import Any

import numpy as np

from radarsim.errors import PlotFault
from radarsim.studies.ambiguous_doppler.config import joint_span
from radarsim.studies.ambiguous_doppler.kernels import recorded_rows
from radarsim.studies.ambiguous_doppler.kernels.plots import chinese_remainder

CERTAIN_SIGMAS = 4.0  # standard deviations of the velocity's innovation in half a span from which the fold is certain


class FoldResolver:
    """Unfolds velocities: by the span of a row, or by those of two rows."""

    def __init__(self, radar: Any):
        self.radar = radar
        self.span = np.nan  # of this row
        self.previous: tuple[float, float] | None = None  # the velocity of the previous plot, and its span

    def begin_row(self, t: float, span: float) -> None:
        """Begin a row; if it has no span of its own, the span follows from its time."""
        spans = self.radar.spans_mps
        self.span = spans[round(t / self.radar.scan_period_s) % len(spans)] if np.isnan(span) else span

    def nearest_innovation(self, e: np.ndarray) -> np.ndarray:
        """The innovations e with the nearest folds."""
        return e - self.span * np.rint(e / self.span)

    def nearby_count(self, S: np.ndarray | float, count: int) -> int:
        """The number of folds to either side of the nearest that may matter, for `count` innovations of variances S.

        Raises PlotFault if these are too many, or if the variances are only rounding errors."""
        max_variance = float(np.max(S))
        if not max_variance > 0:
            raise PlotFault("velocity_mps: a filter's numbers are lost in rounding: split the file here")
        if 2 * recorded_rows.FARTHEST * math.sqrt(max_variance) / self.span * count > recorded_rows.MAX_SEQUENCES:
            clause, limit = (
                f"its σ before, {math.sqrt(max_variance):g} m/s",
                f"{recorded_rows.MAX_SEQUENCES:g} sequences",
            )
            raise PlotFault(f"velocity_mps: {clause}, leaves more than {limit} of folds by {self.span:g} m/s")
        return recorded_rows.nearby_folds(max_variance, self.span)

    def innovations(self, e: np.ndarray, S: np.ndarray) -> np.ndarray:
        """Innovations e + n D (..., folds) of all folds that matter; e (...) as measured, S (...) their variances."""
        max_fold = self.nearby_count(S, e.size)
        return self.nearest_innovation(e)[..., None] + self.span * np.arange(-max_fold, max_fold + 1)

    def is_certain(self, S: float) -> bool:
        """Whether an innovation of that variance leaves only one fold."""
        return 2 * CERTAIN_SIGMAS * np.sqrt(S) <= self.span

    def remainder(self, v: float) -> float:
        """The velocity by the Chinese remainder of this row and the previous plot; not-a-number if there is none."""
        v = math.remainder(v, self.span)
        previous, self.previous = self.previous, (v, self.span)
        joint_span_mps = joint_span(self.span, previous[1]) if previous else 0.0
        if previous is None or joint_span_mps == 0:
            return np.nan
        return chinese_remainder(v, self.span, *previous, joint_span_mps)
