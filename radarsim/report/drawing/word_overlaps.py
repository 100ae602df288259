"""Words of a drawing that lie one over the other."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Tick
from matplotlib.figure import Figure as Canvas
from matplotlib.text import Text

TITLES = "_left_title", "_right_title"  # of a panel; not public
MIN_OVERLAP_PT = 0.5, 1.2  # side by side, one above the other: boxes are larger than the letters in them
TICK_GAP_PT = 1.5  # between the words of neighbouring ticks of an axis of x, less than which reads as one word


def overlapping_words(canvas: Canvas) -> list[tuple[str, str]]:
    """Pairs of words of a laid-out drawing that lie one over the other; a legend counts as one word."""
    canvas.get_tightbbox()  # puts the labels of axes in their places
    texts, tick_words = list(_drawn_texts(canvas)), _tick_words(canvas)
    legends = [legend for legend in (*canvas.legends, *(axes.get_legend() for axes in canvas.axes)) if legend]
    # Text's own method: that of an annotation counts what it points at.
    extents = [Text.get_window_extent(text) for text in texts] + [legend.get_window_extent() for legend in legends]
    boxes = np.array([(box.x0, box.y0, box.x1, box.y1) for box in extents]).reshape(-1, 4)
    is_tick = np.array([text in tick_words for text in texts] + [False] * len(legends), bool)
    words = [*(text.get_text() for text in texts), *("legend" for _ in legends)]
    low, high = boxes[:, :2], boxes[:, 2:]
    shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    shared[..., 0] += np.where(is_tick[:, None] & is_tick, (MIN_OVERLAP_PT[0] + TICK_GAP_PT) * canvas.dpi / 72, 0.0)
    is_over = (shared > np.array(MIN_OVERLAP_PT) * canvas.dpi / 72).all(axis=-1)
    return [(words[i], words[j]) for i, j in np.argwhere(np.triu(is_over, 1))]


def _drawn_texts(canvas: Canvas) -> Iterator[Text]:
    """All words of a drawing that are seen, outside legends."""
    texts = [*canvas.texts]
    for axes in canvas.axes:
        texts += _axis_texts(axes) if axes.axison else []
        texts += [*axes.texts, *(getattr(axes, name, axes.title) for name in TITLES)]
    return (text for text in texts if text.get_visible() and text.get_text().strip())


def _tick_words(canvas: Canvas) -> set[Text]:
    """The words of the ticks of all axes of x."""
    shown = (axes.xaxis for axes in canvas.axes if axes.axison)
    return {tick.label1 for side in shown for tick in getattr(side, "_update_ticks", list)()}


def _axis_texts(axes: Axes) -> list[Text]:
    """The labels of a panel's axes and of those of their ticks that are within them."""
    texts: list[Text] = []
    for side in (axes.xaxis, axes.yaxis):
        ticks: list[Tick] = getattr(side, "_update_ticks", list)()  # not public: a version without it counts no ticks
        texts += [label for tick in ticks for label in (tick.label1, tick.label2)]
        texts += [side.label, side.offsetText]
    return texts
