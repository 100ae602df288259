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
    raised = [text for _, text in Scale(True, 2e-5, 8, 0, 100).ticks(4)]
    assert raised == ["2·10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "1", "5"]  # one notation
    assert next(text for _, text in Scale(True, 12, 3e6, 0, 100).ticks(4)) == "20"
    written = [text for _, text in Scale(True, 4e-4, 300, 0, 100).ticks(4)]
    assert written == ["0.001", "0.01", "0.1", "1", "10", "100"]  # 0.0005 and 200 would stand too near
    inside = [v for v, _ in Scale(True, 20, 90, 0, 100).ticks(5)]
    assert all(20 <= v <= 90 for v in inside)


def test_maps_with_the_same_label_share_a_scale_which_is_logarithmic_over_a_wide_range():
    panels = [
        Panel(Axis("x"), Axis("y"), (Heat(np.arange(2.0), np.arange(1.0), np.array([values]), label),))
        for values, label in (([1.0, 2.0], "σ"), ([np.nan, 50.0], "σ"), ([0.0, 50.0], "share"), ([np.nan, np.nan], "n"))
    ]
    expected = {"σ": (1.0, 50.0, True, 0.0), "share": (0.0, 50.0, False, 0.0), "n": (0.0, 1.0, False, 0.0)}
    assert heat_scales(panels) == {(label, ""): scale for label, scale in expected.items()}


def test_shares_near_one_are_told_apart_by_their_colours():
    shares = np.array([[1.0, 0.9975, 0.975], [0.75, 0.999, 0.99]])
    axis = Axis("x")
    panel = Panel(axis, axis, (Heat(np.arange(3.0), np.arange(2.0), shares, "share locked"),))
    (scale,) = heat_scales([panel]).values()
    decades = scale.loss_decades(shares)
    assert np.array_equal(np.argsort(decades.ravel()), np.argsort(shares.ravel()))
    assert decades[0, 1] - decades[0, 2] > 0.8  # nearly a decade, over a fortieth of the shares
    np.testing.assert_allclose(scale.share(decades), shares, atol=1e-12)
    assert [text for _, text in scale.loss_ticks()] == ["0.9", "0.99", "0.999", "1"]


def test_maps_of_each_group_have_their_own_colours():
    axis, cells = Axis("x"), (np.arange(2.0), np.arange(1.0))
    maps = [
        Heat(*cells, np.array([values]), "σ", group) for values, group in (((1, 2), "a"), ((3, 4), "a"), ((9, 10), "b"))
    ]
    scales = heat_scales([Panel(axis, axis, (heat,)) for heat in maps])
    assert {group: (scale.low, scale.high) for (_, group), scale in scales.items()} == {"a": (1, 4), "b": (9, 10)}
