"""Colours of curves, and how well two colours contrast.

Every colour of a curve has a contrast of at least 3 : 1 with a white page (WCAG 2.2, 1.4.11)."""

# Ten even steps of lightness, with hues found by search so that every two are told apart in grey and under protanopia,
# deuteranopia and tritanopia (CIEDE2000; tests/report/test_colours.py).
LADDER = (
    *("#2d0257", "#5c0126", "#0810ba", "#881800", "#074dae"),
    *("#7d0af9", "#437a04", "#756cd8", "#109b4d", "#fe5292"),
)
COLOURS = tuple(LADDER[i] for i in (0, 6, 3, 9, 4, 8, 1, 7, 2, 5))  # in the order of use: few curves lie far apart
NEUTRAL = "#6b6b6b"  # guides and crowds of points, which are not curves


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(colour: str, background: str) -> float:
    """Contrast of two colours, 1 to 21 (WCAG 2.2)."""
    low, high = sorted((luminance(colour), luminance(background)))
    return (high + 0.05) / (low + 0.05)
