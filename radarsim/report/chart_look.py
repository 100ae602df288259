"""Colours, dashes and markers of a page's charts, for a light and for a dark page.

Every colour stands out from its page by 3 : 1 at least (WCAG 2.2, 1.4.11); dash and marker tell curves apart in grey.
"""

import numpy as np

from radarsim.report.drawing import GREY, Style

# Ten even steps of lightness, on a light page and on a dark one, with hues found by search so that every two are told
# apart in grey and under protanopia, deuteranopia and tritanopia (CIEDE2000; tests/report/test_colours.py).
LADDER = (
    *(("#2d0257", "#fefa41"), ("#5c0126", "#beefad"), ("#0810ba", "#6de1fd"), ("#881800", "#cebeca")),
    *(("#074dae", "#27cba1"), ("#7d0af9", "#c4a50d"), ("#437a04", "#829bc7"), ("#756cd8", "#a78662")),
    *(("#109b4d", "#598783"), ("#fe5292", "#6c753e")),
)
COLOURS = tuple(LADDER[i] for i in (0, 6, 3, 9, 4, 8, 1, 7, 2, 5))  # in the order of use: few curves lie far apart
NEUTRAL = ("#6b6b6b", "#a9a9a9")  # of what is no curve of its own
SHADES = (  # of an ordered scale, least to most
    ("#440154", "#3b528b", "#2a788e", "#1f9a6e", "#4f8a10"),
    ("#8c8cf0", "#4fa3e0", "#35b7a0", "#7ad151", "#fde725"),
)
HEAT = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")
DASHES = ("", "6 2.5", "1.8 2", "7 2.5 1.8 2.5", "11 3.5", "4 2 1.5 2 1.5 2")
MARKERS = (  # paths about a point, moved to by "M x y" before
    "m-2.6 0a2.6 2.6 0 1 0 5.2 0a2.6 2.6 0 1 0-5.2 0",
    "m-2.4-2.4h4.8v4.8h-4.8z",
    "m0-3.1l3 5.4h-6z",
    "m0-3.4l3 3.4l-3 3.4l-3-3.4z",
    "m0 3.1l3-5.4h-6z",
    "m-1-3h2v2h2v2h-2v2h-2v-2h-2v-2h2z",
    "m-2.9-1.5l1.4-1.4l1.5 1.5l1.5-1.5l1.4 1.4l-1.5 1.5l1.5 1.5l-1.4 1.4l-1.5-1.5l-1.5 1.5l-1.4-1.4l1.5-1.5z",
    "m0-4.4l1.1 3h3.2l-2.6 1.9l1 3.1l-2.7-1.9l-2.7 1.9l1-3.1l-2.6-1.9h3.2z",
    "m-3.1 0l5.4-3v6z",
    "m0-3l2.6 1.5v3l-2.6 1.5l-2.6-1.5v-3z",
    "m3.1 0l-5.4-3v6z",
    "m0-3.6l1.8 3.6l-1.8 3.6l-1.8-3.6z",
    "m0-3l2.9 2.1l-1.1 3.4h-3.6l-1.1-3.4z",
)
CROSS = "m-3 0h6m-3-3v6"


def ink(style: Style) -> tuple[str, str]:
    """The colour of a style on a light and on a dark page."""
    if isinstance(style.colour, float):
        return mixed(SHADES[0], style.colour), mixed(SHADES[1], style.colour)
    if style.colour == GREY:
        return NEUTRAL
    return COLOURS[style.colour % len(COLOURS)]


def mixed(stops: tuple[str, ...], share: float) -> str:
    """A colour between stops at equal distances, share from 0 to 1."""
    at = np.clip(share, 0.0, 1.0) * (len(stops) - 1)
    low = min(int(at), len(stops) - 2)
    a, b = ([int(stop[i : i + 2], 16) for i in (1, 3, 5)] for stop in stops[low : low + 2])
    return "#" + "".join(f"{round(x + (at - low) * (y - x)):02x}" for x, y in zip(a, b, strict=True))


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one: str, other: str) -> float:
    """Contrast of two colours, 1 to 21 (WCAG 2.2)."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)
