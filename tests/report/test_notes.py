"""Notes where an interval rests on too little: by realisations, by events, and none elsewhere."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.report import notes, provenance, statistics
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
    rows = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.5, "sigma_lo": 1.0, "sigma_hi": 2.0}
    curves = pd.DataFrame([{**rows, "filter": "one", "n_eff": 2000.0}, {**rows, "filter": "two", "n_eff": 20.0}])
    gain = {"baseline": "two", "gain_percent": 0.5, "gain_lo": 0.0, "gain_hi": 1.0, "exact_percent": np.nan}
    gains = pd.DataFrame([{**rows, "filter": "one", **gain}])
    noted = notes.noted({"curves": curves, "gains": gains.drop(columns="n")}, [])
    assert list(noted["curves"]["note"]) == ["", notes.THIN]
    assert list(noted["gains"]["note"]) == [notes.THIN]


def test_rare_locks_are_noted_row_by_row():
    rates = [0.0, 0.001, 0.02, 0.5, 0.99, 1.0]
    table = pd.DataFrame({"case": "a", "n": 1000, "probability": rates, "probability_lo": 0.0, "probability_hi": 1.0})
    noted = notes.noted({"probabilities": table}, [])["probabilities"]
    assert list(noted["note"] == f"under {FEW_EVENTS} events") == [True, True, False, False, True, True]


def test_a_scan_near_one_with_heavy_tails_is_marked_too():
    of = [{"case": "a", "component": c, "k": k, "n": 5000, "filter": f} for f in "fg" for c in "xy" for k in range(60)]
    curves = pd.DataFrame(of).assign(sigma=1.0, sigma_lo=0.9, sigma_hi=1.1, n_eff=2500.0)
    curves.loc[(curves["filter"] == "g") & (curves["component"] == "x") & (curves["k"] == 20), "n_eff"] = 30.0
    noted = notes.noted({"curves": curves}, [])["curves"].set_index(["filter", "component", "k"])["note"]
    assert noted["g", "x", 20] == notes.THIN
    near = noted[noted == notes.NEAR].index.tolist()
    assert near == [("g", "x", k) for k in range(14, 27) if k != 20]  # a tenth of 60 scans on either side
    assert (noted == "").sum() == 240 - 13


@pytest.mark.parametrize(
    ("half", "exact", "alike"), [(0.5, np.nan, True), (5.0, np.nan, False), (0.5, 3.0, False), (0.0, np.nan, False)]
)
def test_gains_of_filters_that_err_nearly_alike_are_marked(half, exact, alike):
    """Independent σ to ± 4 % would give a gain to ± 5.7; the same filter twice has no chance in it."""
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.0, "sigma_lo": 0.96, "sigma_hi": 1.04}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    gain = {"gain_percent": 0.0, "gain_lo": -half, "gain_hi": half, "exact_percent": exact}
    gains = pd.DataFrame([{**row, "filter": "one", "baseline": "two", **gain}]).drop(columns="n")
    noted = notes.noted({"curves": curves, "gains": gains}, [])["gains"]
    assert list(noted.get("note", [""])) == [notes.ALIKE if alike else ""]


def test_a_gain_of_all_there_is_divides_by_nothing():
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 0.0, "sigma_lo": 0.0, "sigma_hi": 0.0}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    gain = {"gain_percent": 100.0, "gain_lo": 100.0, "gain_hi": 100.0, "exact_percent": np.nan}
    gains = pd.DataFrame([{**row, "filter": "one", "baseline": "two", **gain}]).drop(columns="n")
    with np.errstate(all="raise"):
        noted = notes.noted({"curves": curves, "gains": gains}, [])["gains"]
    assert list(noted.get("note", [""])) == [""]


@pytest.mark.parametrize("predicted", [True, False])
def test_a_calibration_is_marked_by_what_is_foretold(predicted, monkeypatch):
    """Bins of 16 to 24 events to come: marked by those that came, the bins left are those of chance's excess."""
    if not predicted:
        monkeypatch.setattr(notes, "SHARES", {"calibration": ("right",)})
        monkeypatch.setattr(notes, "FORETOLD", {})
    rng, n = np.random.default_rng(3), 1000
    truth = np.repeat([0.016, 0.018, 0.02, 0.022, 0.024], 4000)
    right = statistics.rate(rng.binomial(n, truth), float(n))
    table = pd.DataFrame({"case": "a", "n": n, **dict(zip(("right", "right_lo", "right_hi"), right, strict=True))})
    made = {"curves": pd.DataFrame(), "calibration": table.assign(expected=truth)}
    free = notes.noted(made, [])["calibration"]["note"].eq("").to_numpy()
    held = (right.lo <= truth) & (truth <= right.hi)
    if predicted:
        np.testing.assert_array_equal(free, truth >= 0.02)
        assert abs(held[free].mean() - 0.95) < 0.01  # Wilson's own unevenness; 12 000 bins tell it to 0.002
    else:
        few = free & (truth < 0.02)
        assert few.sum() > 1000
        assert held[few].mean() < 0.9


def test_bins_of_few_realisations_have_no_tails():
    """Of yes or no alone nothing is heavy: 300 of the 1000 that a mean would want are enough."""
    row = {"case": "a", "n": 300, "right": 0.5, "right_lo": 0.44, "right_hi": 0.56, "expected": 0.5}
    made = {"curves": pd.DataFrame(), "calibration": pd.DataFrame([row, row | {"n": 100}])}
    assert list(notes.noted(made, [])["calibration"]["note"]) == ["", f"under {FEW} realisations"]


def curves_of(errors):
    """curves.csv of errors (realisations, scans) of one filter and component, and the case that it is of."""
    from types import SimpleNamespace

    from radarsim.report import tables

    n, scans = errors.shape
    sums = np.stack([(errors**p).sum(axis=0) for p in (1, 2, 3, 4)], axis=-1)[None, :, None, :]
    axes = SimpleNamespace(
        available=np.full((1, scans, 1), True),
        filters=("f",),
        components=(("x", "m"),),
        k=np.arange(1, scans + 1),
        t_s=np.arange(scans),
        exact_sigma=np.full((1, scans, 1), np.nan),
        exact_bias=np.full((1, scans, 1), np.nan),
    )
    result = SimpleNamespace(name="a", count=n, sums={"error": sums}, axes=axes)
    return tables.curves([result]), [result]


def test_an_error_of_most_bias_is_marked_by_what_makes_its_spread():
    """A bias of ten spreads, of which five of 1000 realisations depart: of the errors themselves no tail shows."""
    rng = np.random.default_rng(5)
    errors = 10 + rng.normal(size=(1000, 40))
    errors[:5, 20] -= 10
    curves, results = curves_of(errors)
    assert curves["n_eff"].min() > 5000
    noted = notes.noted({"curves": curves}, results)["curves"]
    assert list(noted.columns[:-1]) == list(curves.columns)
    np.testing.assert_array_equal(noted["n_eff"], curves["n_eff"])  # the table says what it said
    assert noted["note"].iloc[20] == notes.THIN
    assert set(noted["note"].iloc[17:24]) == {notes.THIN, notes.NEAR}
    assert noted["note"].iloc[30] == ""  # departures by ten spreads, of three in 1000, are lost in ten of bias


def test_large_errors_at_one_scan_mark_those_whose_sample_may_lack_them():
    """Five of 1000 realisations err by 30 σ at one scan: three of them elsewhere would more than double σ."""
    rng = np.random.default_rng(6)
    errors = rng.normal(size=(1000, 40))
    errors[:5, 5] += 30
    noted = notes.noted(*(lambda made, results: ({"curves": made}, results))(*curves_of(errors)))["curves"]
    assert noted["note"].iloc[5] == notes.THIN
    assert set(noted["note"].iloc[12:]) == {notes.UNSEEN}
    plain, results = curves_of(rng.normal(size=(1000, 40)))
    assert "note" not in notes.noted({"curves": plain}, results)["curves"]


def test_a_table_keeps_the_notes_that_it_brings():
    table = pd.DataFrame({"case": "a", "n": [5000, 50], "ratio": 1.0, "ratio_lo": 0.9, "ratio_hi": 1.1, "note": "own"})
    for empty in (False, True):
        made = {"curves": pd.DataFrame(), "believed": table.assign(note="") if empty else table}
        noted = notes.noted(made, [])["believed"]
        assert list(noted["note"]) == ["" if empty else "own", f"under {FEW} realisations"]
    assert list(table["note"]) == ["own", "own"]
    none = notes.noted({"curves": pd.DataFrame(), "believed": table[:1].assign(note="")}, [])["believed"]
    assert "note" not in none


def test_marked_rows_of_any_table_are_told_in_one_line():
    """Curves and what is sought of rare events have lines of their own, and so have cases of few realisations."""
    results = [SimpleNamespace(name="a", count=5000), SimpleNamespace(name="b", count=FEW - 1)]
    cases = ["a", "a", "b"]
    made = {
        "curves": pd.DataFrame({"case": cases, "note": notes.THIN}),
        "gains": pd.DataFrame({"case": cases, "note": [notes.ALIKE, "", notes.ALIKE]}),
        "locks": pd.DataFrame({"case": cases, "note": ["", "", "under 200 realisations"]}),
        "rare": pd.DataFrame({"case": cases, "sought": [True, False, False], "note": "heavy"}),
        "passes": pd.DataFrame({"case": cases}),
    }
    (line,) = provenance.marked(results, made)
    assert line.endswith("in the column note: 1 of 3 in gains.csv, 1 of 3 in rare.csv")
    assert not provenance.marked(results[1:], {"locks": made["locks"].iloc[2:]})
