"""Captions and axes of the shares of locked bursts say what is drawn."""

from types import SimpleNamespace

import pandas as pd
import pytest

from radarsim.studies.discriminator import figures


def figure_of_locks(rates, rare=None):
    rows = [
        {"case": "c", "filter": name, "t_s": 10.0**k, "lock_rate": rate, "lock_lo": rate, "lock_hi": rate}
        for name, values in rates.items()
        for k, rate in enumerate(values)
    ]
    result = SimpleNamespace(
        name="c", count=1000, axes=SimpleNamespace(filters=tuple(rates)), spec=SimpleNamespace(rare=rare)
    )
    return figures.locks(result, {"locks": pd.DataFrame(rows)})


def test_a_share_of_failures_is_said_to_be_one():
    figure = figure_of_locks({"dense": [1, 1, 1], "wide": [0.99, 0.999, 1]})
    (panel,) = figure.panels
    assert panel.y.label == "share of bursts that fail to lock"
    assert figure.caption.startswith("Share of bursts with a component beyond")
    assert "Without failures: “dense”." in figure.caption
    rates = figure_of_locks({"wide": [0.2, 0.5, 0.7]})
    assert rates.panels[0].y.label == "share locked"
    assert rates.caption.startswith("Share of bursts with every component within")


@pytest.mark.parametrize("rare", [None, object()])
def test_weighted_bursts_are_said_to_be_so(rare):
    figure = figure_of_locks({"wide": [0.99, 0.999, 1]}, rare)
    assert ("Importance sampling; weighted bursts per case: 1000." in figure.caption) == (rare is not None)
