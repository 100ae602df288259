"""Ticks are round and few."""

import numpy as np
import pytest

from radarsim.report.drawing.model import Axis, Heat, Panel
from radarsim.report.drawing.scales import Scale, heat_scales


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 140, ["0", "50", "100"]),
        (-1, 1, ["−1", "−0.5", "0", "0.5", "1"]),
        (0, 3e6, ["0", "10⁶", "2·10⁶", "3·10⁶"]),
        (2.5, 2.6, ["2.5", "2.525", "2.55", "2.575", "2.6"]),
    ],
)
def test_linear_ticks_are_round(low, high, expected):
    assert [text for _, text in Scale(False, low, high, 0, 100).ticks(4)] == expected


def test_logarithmic_ticks_are_decades_and_few_multiples():
    texts = [text for _, text in Scale(True, 0.009, 120, 0, 100).ticks(5)]
    assert texts == ["0.01", "0.1", "1", "10", "100"]
    assert [text for _, text in Scale(True, 8, 600, 0, 100).ticks(5)] == ["10", "20", "50", "100", "200", "500"]
    assert len(Scale(True, 1e-12, 1e12, 0, 100).ticks(5)) <= 8
    inside = [v for v, _ in Scale(True, 20, 90, 0, 100).ticks(5)]
    assert all(20 <= v <= 90 for v in inside)


def test_maps_with_the_same_label_share_a_scale_which_is_logarithmic_over_a_wide_range():
    panels = [
        Panel(Axis("x"), Axis("y"), (Heat(np.arange(2.0), np.arange(1.0), np.array([values]), label),))
        for values, label in (([1.0, 2.0], "σ"), ([np.nan, 50.0], "σ"), ([0.0, 50.0], "share"), ([np.nan, np.nan], "n"))
    ]
    assert heat_scales(panels) == {"σ": (1.0, 50.0, True), "share": (0.0, 50.0, False), "n": (0.0, 1.0, False)}
