"""Colours of curves: every two are told apart in grey and by the colour-blind, letters can be read.

Differences are CIEDE2000 (Sharma, Wu & Dalal, Color Research & Application 30, 2005, 21), deficiencies those of
Machado, Oliveira & Fernandes (IEEE Trans. Visualization and Computer Graphics 15, 2009, 1291) at full strength.
"""

from itertools import combinations

import numpy as np
import pytest

from radarsim.report.drawing import colours, style
from tests.tolerances import assert_rounded

TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])
SEEN = {
    "all": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    "grey": np.tile(TO_XYZ[1], (3, 1)),
}
APART = {"all": 12.0, "protanopia": 8.0, "deuteranopia": 8.0, "tritanopia": 8.0, "grey": 3.0}
DARK_PAGE = "#0f1419"
HALF_TURN = [[-0.574, 1.430, 0.144], [0.426, 0.430, 0.144], [0.426, 1.430, -0.856]]  # CSS: hue-rotate(180deg)


def lab(colour, sight):
    """CIE L*a*b* of #rrggbb, as it is seen."""
    rgb = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.array(SEEN[sight]) @ linear, 0, 1) / WHITE
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def ciede2000(one, other):
    """The difference of two colours in CIE L*a*b*."""
    (l1, a1, b1), (l2, a2, b2) = one, other
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    g = 0.5 * (1 - np.sqrt(mean**7 / (mean**7 + 25.0**7)))
    c1, c2 = np.hypot((1 + g) * a1, b1), np.hypot((1 + g) * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, (1 + g) * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180 if c1 * c2 else 0.0
    across = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2))
    middle = (h1 + turn / 2) % 360 if c1 * c2 else h1 + h2
    t = 1 - 0.17 * np.cos(np.radians(middle - 30)) + 0.24 * np.cos(np.radians(2 * middle))
    t += 0.32 * np.cos(np.radians(3 * middle + 6)) - 0.20 * np.cos(np.radians(4 * middle - 63))
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    sl = 1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2)
    sc, sh = 1 + 0.045 * chroma, 1 + 0.015 * chroma * t
    spin = 2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7))
    spin *= -np.sin(np.radians(60 * np.exp(-(((middle - 275) / 25) ** 2))))
    dl, dc, dh = (l2 - l1) / sl, (c2 - c1) / sc, across / sh
    return np.sqrt(dl**2 + dc**2 + dh**2 + spin * dc * dh)


@pytest.mark.parametrize(
    ("one", "other", "difference"),  # of the table that Sharma, Wu & Dalal give to test with
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((90.8027, -2.0831, 1.4410), (91.1528, -1.6435, 0.0447), 1.4441),
    ],
)
def test_the_difference_is_that_of_the_published_table(one, other, difference):
    assert ciede2000(one, other) == pytest.approx(difference, abs=5e-5)


def on_dark_page(colour):
    """A colour of a figure as the style sheet of a dark page shows it: inverted, its hue turned back, screened."""
    figure, page = (np.array([int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)]) for c in (colour, DARK_PAGE))
    seen = 1 - (1 - np.clip(np.array(HALF_TURN) @ (1 - figure), 0, 1)) * (1 - page)
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in seen)


@pytest.mark.parametrize("sight", SEEN)
def test_every_two_colours_are_told_apart(sight):
    assert len(set(colours.COLOURS)) == 10
    least = min(ciede2000(lab(a, sight), lab(b, sight)) for a, b in combinations(colours.COLOURS, 2))
    assert least > APART[sight]


def test_colours_rise_in_lightness_by_even_steps():
    steps = np.diff([lab(colour, "all")[0] for colour in colours.LADDER])
    assert steps.min() > 3.5
    assert steps.max() < 8


def test_the_first_colours_lie_far_apart_in_grey():
    lightness = [lab(colour, "all")[0] for colour in colours.COLOURS[:4]]
    assert min(abs(a - b) for a, b in combinations(lightness, 2)) > 14


@pytest.mark.parametrize("colour", [*colours.COLOURS, colours.NEUTRAL])
def test_curves_stand_out_from_light_and_dark_pages_and_their_names_can_be_read(colour):
    assert colours.contrast(colour, "#ffffff") >= 3
    assert colours.contrast(on_dark_page(colour), DARK_PAGE) >= 4.5
    assert colours.contrast(style.readable_colour(colour), "#ffffff") >= 4.5


def test_contrast_is_that_of_the_standard():
    assert_rounded(colours.contrast("#ffffff", "#000000"), 21, operations=4)
    assert colours.contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)
