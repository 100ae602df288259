"""Ticks at round values on Matplotlib's axes."""

import math
from collections.abc import Sequence
from itertools import pairwise

from matplotlib.axis import XAxis, YAxis
from matplotlib.ticker import FuncFormatter, Locator, NullFormatter

from radarsim.report.drawing import scales
from radarsim.report.drawing.model import Axis as AxisSpec
from radarsim.report.drawing.scales import Scale, Scans, tick_text
from radarsim.report.drawing.style import LETTER_EM, STYLE, TICK_GAP_PT


def set_ticks(side: XAxis | YAxis, axis: AxisSpec, has_own_ticks: bool, scans: Scans | None = None) -> None:
    """Set the ticks of an axis: those that it declares; those of its bars or its map; at scans; else round values."""
    if axis.ticks:
        values, labels = zip(*axis.ticks, strict=True)
        side.set_ticks(values, labels)
    elif not has_own_ticks:
        locator = RoundLocator(axis.scale == "log", 6 if side.axis_name == "x" else 5, scans)
        side.set_major_locator(locator)
        side.set_major_formatter(FuncFormatter(lambda value, _: locator.texts.get(value, tick_text(value))))
    side.set_minor_formatter(NullFormatter())


class RoundLocator(Locator):
    """Ticks at round values; where all lines lie on scans, at scans.

    On an axis of x there are at most as many as leave gaps between their numbers. texts: the numbers of the last
    ticks, by their values."""

    def __init__(self, log: bool, tick_count: int, scans: Scans | None = None):
        self.log, self.tick_count, self.scans = log, tick_count, scans
        self.texts: dict[float, str] = {}
        self._last_axis: tuple[float, float, float] | None = None

    def __call__(self) -> list[float]:
        assert self.axis is not None  # Matplotlib sets it before it asks
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """The ticks between two ends."""
        low, high = sorted((float(vmin), float(vmax)))
        axis = (low, high, self._length_pt())
        if axis != self._last_axis:  # Matplotlib asks several times a drawing
            self._last_axis, self.texts = axis, dict(self._spaced_ticks(Scale(self.log, low, high, 0.0, axis[2])))
        return list(self.texts)

    def _spaced_ticks(self, scale: Scale) -> list[tuple[float, str]]:
        """As many ticks as wanted, or fewer that leave gaps between their numbers."""
        if self.scans:
            choices = (scales.scan_ticks(self.scans, count) for count in range(self.tick_count, 1, -1))
            return next((ticks for ticks in choices if has_gaps(scale, ticks)), scales.scan_ticks(self.scans, 1))
        ticks = scale.ticks(self.tick_count)
        for count in range(self.tick_count - 1, 1, -1):
            if has_gaps(scale, ticks):
                break
            ticks = scale.ticks(count)
        while not has_gaps(scale, ticks):
            ticks = ticks[::2]
        return ticks

    def _length_pt(self) -> float:
        """The length of an axis of x, points; infinite for another axis, whose numbers never meet."""
        if not isinstance(self.axis, XAxis):
            return math.inf
        axes = self.axis.axes
        return float(axes.get_window_extent().width) * 72 / axes.figure.dpi


def has_gaps(scale: Scale, ticks: Sequence[tuple[float, str]]) -> bool:
    """Whether the numbers of neighbouring ticks leave a gap; the scale ends at the axis' length in points."""
    if math.isinf(scale.end):
        return True
    half_widths = [LETTER_EM * STYLE["xtick.labelsize"] * len(text) / 2 for _, text in ticks]
    centres = [float(scale.position(value)) for value, _ in ticks]
    neighbours = zip(pairwise(centres), pairwise(half_widths), strict=True)
    return all(c - b >= half_b + half_c + TICK_GAP_PT for (b, c), (half_b, half_c) in neighbours)
