"""Which points of a line are drawn, and which have a marker."""

from dataclasses import replace

import numpy as np

from radarsim.report.drawing.model import Line

MAX_POINTS = 2000  # of a line; longer ones are drawn at every n-th scan
MAX_MARKERS = 16  # about so many markers or crosses a line


def marker_stride(line: Line) -> int:
    """From one marker of a line to the next, in points; twice as far where markers and crosses alternate."""
    stride = 1 if line.style.dash is None else max(1, -(-len(line.x) // MAX_MARKERS))
    return stride if line.exact is None or stride == 1 else 2 * stride


def marker_indices(line: Line) -> list[int]:
    """The points of a line that have a marker."""
    return sorted({*range(0, len(line.x), marker_stride(line)), *lone_points(line)})


def rough_points(line: Line) -> np.ndarray:
    """Which points (n,) of a line with a band have neither ends of it, as a note marks them unreliable, nor an exact
    value."""
    if line.lo is None or line.hi is None:
        return np.full(len(line.x), False)
    exact = np.full(len(line.x), np.nan) if line.exact is None else np.asarray(line.exact, float)
    unknown = np.isnan(np.asarray(line.lo, float)) & np.isnan(np.asarray(line.hi, float)) & np.isnan(exact)
    return unknown & np.isfinite(np.asarray(line.y, float))


def lone_points(line: Line) -> list[int]:
    """The points of a line without a neighbour: neither the line nor its band shows them."""
    return [int(run[0]) for run in unbroken_runs(np.isfinite(line.y)) if len(run) == 1]


def unbroken_runs(flags: np.ndarray) -> list[np.ndarray]:
    """The indices of each unbroken run of true values."""
    indices = np.flatnonzero(flags)
    return [run for run in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if run.size]


def thin_line(line: Line) -> Line:
    """A line with every so many of its points, at most `MAX_POINTS`."""
    stride = -(-len(line.x) // MAX_POINTS)
    if stride <= 1:
        return line
    columns = {name: getattr(line, name) for name in ("x", "y", "lo", "hi", "exact")}
    return replace(line, **{name: column[::stride] for name, column in columns.items() if column is not None})
