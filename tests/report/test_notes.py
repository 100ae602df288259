"""Notes where an interval rests on too little: by realisations, by events, and none elsewhere."""

import numpy as np
import pytest

import radarsim
from radarsim.report import notes
from radarsim.report.statistics import FEW, FEW_EFFECTIVE, FEW_EVENTS, FEW_HEAVY


def test_words():
    n = np.array([1.0, FEW - 1, FEW, FEW_HEAVY - 1, FEW_HEAVY])
    assert list(map(bool, notes.notes_on(n))) == [True, True, True, True, False]
    assert notes.notes_on(n)[1] == f"under {FEW} realisations"
    assert "heavy tails" in notes.notes_on(n)[2]
    events = np.array([0.0, FEW_EVENTS - 1, FEW_EVENTS])
    assert list(map(bool, notes.notes_on(np.full(3, 1e6), events))) == [True, True, False]


@pytest.mark.parametrize(("count", "noted"), [(50, "under 200"), (300, "heavy tails"), (1000, None)])
def test_tables_say_so(count, noted):
    made = radarsim.run("rls2", realisations=count, overrides=["scans=5"]).tables
    for name in ("curves", "gains", "consistency"):
        if noted is None:
            assert "note" not in made[name]
        else:
            assert made[name].columns[-1] == "note"
            assert made[name]["note"].str.contains(noted, regex=False).all()


def test_effective_realisations_mark_a_row_whatever_n():
    n = np.full(5, 10_000.0)
    effective = np.array([FEW_EFFECTIVE - 1, FEW_EFFECTIVE, np.inf, np.nan, 5.0])
    assert list(notes.notes_on(n, effective=effective)) == [notes.THIN, "", "", "", notes.THIN]
    assert notes.notes_on(n / 50, effective=effective)[2] == ""
    assert "heavy tails?" in notes.notes_on(n / 50, effective=effective)[3]


def test_a_gain_rests_on_the_fewer_of_its_two_filters():
    import pandas as pd

    rows = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma_lo": 1.0, "sigma_hi": 2.0}
    curves = pd.DataFrame([{**rows, "filter": "one", "n_eff": 2000.0}, {**rows, "filter": "two", "n_eff": 20.0}])
    gains = pd.DataFrame([{**rows, "filter": "one", "baseline": "two", "gain_lo": 0.0, "gain_hi": 1.0}])
    noted = notes.noted({"curves": curves, "gains": gains.drop(columns="n")}, [])
    assert list(noted["curves"]["note"]) == ["", notes.THIN]
    assert list(noted["gains"]["note"]) == [notes.THIN]


def test_rare_locks_are_noted_row_by_row():
    import pandas as pd

    rates = [0.0, 0.001, 0.02, 0.5, 0.99, 1.0]
    table = pd.DataFrame({"case": "a", "n": 1000, "probability": rates, "probability_lo": 0.0, "probability_hi": 1.0})
    noted = notes.noted({"probabilities": table}, [])["probabilities"]
    assert list(noted["note"] == f"under {FEW_EVENTS} events") == [True, True, False, False, True, True]
