"""Notes where an interval covers less than it says, none elsewhere; and what is said of them above an answer."""

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.app import result as output
from radarsim.config.document import SHIPPED
from radarsim.report import notes, statistics
from radarsim.report.quantities import Quantity
from radarsim.report.statistics import FEW


def test_effective_realisations_mark_a_row_whatever_n():
    n = np.full(5, 10_000.0)
    fewest = np.array([notes.EFFECTIVE - 1, notes.EFFECTIVE, np.inf, np.nan, 5.0])
    assert list(notes.notes_on(n, fewest)) == [notes.HEAVY, "", "", "", notes.HEAVY]


@pytest.mark.parametrize("n", [20, 60, 300])
def test_gaussian_errors_of_few_realisations_have_no_tails(n):
    """Half of them count, however few they are; those of a tenth of the realisations would."""
    assert list(notes.notes_on(np.full(2, float(n)), np.array([n / 2, n / 10]))) == ["", notes.HEAVY]


@pytest.mark.parametrize("count", [50, 300])
def test_a_sound_run_of_few_realisations_has_no_marks(count):
    made = radarsim.run("sonar_smoothing", realisations=count, overrides=["scans=5"]).tables
    assert not [name for name, table in made.items() if "note" in table]


def test_a_gain_rests_on_the_fewer_of_its_two_filters():
    rows = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.5, "sigma_lo": 1.0, "sigma_hi": 2.0}
    curves = pd.DataFrame([{**rows, "filter": "one", "n_eff": 2000.0}, {**rows, "filter": "two", "n_eff": 20.0}])
    gain = {"baseline": "two", "gain_percent": 0.5, "gain_lo": 0.0, "gain_hi": 1.0, "exact_percent": np.nan}
    gains = pd.DataFrame([{**rows, "filter": "one", **gain}])
    noted = notes.noted({"curves": curves, "gains": gains.drop(columns="n")}, [])
    assert list(noted["curves"]["note"]) == ["", notes.HEAVY]
    assert list(noted["gains"]["note"]) == [notes.HEAVY]


def test_a_scan_near_one_with_heavy_tails_is_marked_too():
    of = [{"case": "a", "component": c, "k": k, "n": 5000, "filter": f} for f in "fg" for c in "xy" for k in range(60)]
    curves = pd.DataFrame(of).assign(sigma=1.0, sigma_lo=0.9, sigma_hi=1.1, n_eff=2500.0)
    curves.loc[(curves["filter"] == "g") & (curves["component"] == "x") & (curves["k"] == 20), "n_eff"] = 30.0
    noted = notes.noted({"curves": curves}, [])["curves"].set_index(["filter", "component", "k"])["note"]
    near = noted[noted == notes.HEAVY].index.tolist()
    assert near == [("g", "x", k) for k in range(14, 27)]  # a tenth of 60 scans on either side
    assert (noted == "").sum() == 240 - 13


@pytest.mark.parametrize(
    ("half", "exact", "alike"), [(0.3, np.nan, True), (5.0, np.nan, False), (0.3, 3.0, False), (0.0, np.nan, False)]
)
def test_gains_of_filters_that_err_nearly_alike_are_marked(half, exact, alike):
    """Independent σ to ± 4 % would give a gain to ± 5.7; the same filter twice has no chance in it."""
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.0, "sigma_lo": 0.96, "sigma_hi": 1.04}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    gain = {"gain_percent": 0.0, "gain_lo": -half, "gain_hi": half, "exact_percent": exact}
    gains = pd.DataFrame([{**row, "filter": "one", "baseline": "two", **gain}]).drop(columns="n")
    noted = notes.noted({"curves": curves, "gains": gains}, [])["gains"]
    assert list(noted.get("note", [""])) == [notes.ALIKE if alike else ""]


@pytest.mark.parametrize(("value", "alike"), [(0.0, True), (-95.0, False), (95.0, True)])
def test_a_paired_quantity_that_a_study_declares_is_marked_likewise(value, alike):
    """As wide as ± 0.3 % of the other σ: wide of a σ that is a twentieth of it, not of one that is twice as much."""
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 1.0, "sigma_lo": 0.96, "sigma_hi": 1.04}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    above = {"above_percent": value, "above_lo": value - 0.3, "above_hi": value + 0.3}
    table = pd.DataFrame([{**row, "filter": "one", **above}]).drop(columns="n")
    declared = Quantity("above", "above", "apart", "above_percent|above", kind="signed", unit="%", paired=True)
    noted = notes.noted({"curves": curves, "apart": table}, [], declared=[declared])["apart"]
    assert list(noted.get("note", [""])) == [notes.ALIKE if alike else ""]


@pytest.mark.parametrize("share", [1.0, 0.002])
def test_a_gain_is_marked_where_few_realisations_differ_and_covers_where_all_do(share):
    """1000 runs of 1000 realisations of two filters whose squared errors differ in this share of them."""
    runs, n, rng = 1000, 1000, np.random.default_rng(6)
    b = rng.standard_normal((runs, n))
    there = rng.random((runs, n)) < share
    e = b + there * rng.standard_normal((runs, n)) * (0.02 if share == 1 else 1.0)
    true = 100 * (1 - np.sqrt(1 + share * (0.02**2 if share == 1 else 1.0)))
    sums = [(one**power).sum(1) for one in (e, b) for power in (2, 4)]
    gain = statistics.gain(*sums, (e**2 * b**2).sum(1), n)
    differ = e**2 - b**2
    square, fourth = ((differ**power).sum(1)[:, None, None] for power in (2, 4))
    marked = notes.few_differ(square, fourth, np.full((runs, 1, 1), float(n))).ravel()
    inside = (gain.lo < true) & (true < gain.hi)
    if share == 1:
        assert marked.mean() < 0.03
        assert abs(inside[~marked].mean() - 0.95) < 3 * np.sqrt(0.95 * 0.05 / runs)
    else:
        assert marked.all()
        assert inside.mean() < 0.8


def test_a_gain_of_all_there_is_divides_by_nothing():
    row = {"case": "a", "component": "x", "k": 1, "n": 5000, "sigma": 0.0, "sigma_lo": 0.0, "sigma_hi": 0.0}
    curves = pd.DataFrame([{**row, "filter": name, "n_eff": 2500.0} for name in ("one", "two")])
    gain = {"gain_percent": 100.0, "gain_lo": 100.0, "gain_hi": 100.0, "exact_percent": np.nan}
    gains = pd.DataFrame([{**row, "filter": "one", "baseline": "two", **gain}]).drop(columns="n")
    with np.errstate(all="raise"):
        noted = notes.noted({"curves": curves, "gains": gains}, [])["gains"]
    assert list(noted.get("note", [""])) == [""]


def test_a_table_keeps_the_notes_that_it_brings():
    table = pd.DataFrame(
        {"case": "a", "n": [5000, 500], "n_eff": 2500.0, "filter": "f", "component": "x", "k": [1, 99]}
    )
    table = table.assign(ratio=1.0, ratio_lo=0.9, ratio_hi=1.1)
    made = {"curves": pd.DataFrame(), "ratios": table.assign(note=["own", ""])}
    assert list(notes.noted(made, [])["ratios"]["note"]) == ["own", ""]
    assert list(made["ratios"]["note"]) == ["own", ""]
    assert "note" not in notes.noted(made | {"ratios": table.assign(note="")}, [])["ratios"]


@pytest.mark.parametrize("exact", [True, False])
def test_no_note_stands_beside_an_exact_value(exact):
    """Whether the sample agrees with it or not; of a bound, which a filter need not reach, it does."""
    row = {"case": "a", "component": "x", "filter": "f", "n": 5000, "sigma": 1.0, "sigma_lo": 0.9, "sigma_hi": 1.1}
    curves = pd.DataFrame(
        [{**row, "k": k, "n_eff": 20.0, "exact_sigma": of} for k, of in enumerate((1.0, 5.0, np.nan))]
    )
    noted = notes.noted({"curves": curves}, [], exact)["curves"]
    assert list(noted["note"]) == ["" if exact else notes.HEAVY] * 2 + [notes.HEAVY]


S_BAND = (
    *("radar.sigma_range_m=60", "radar.sigma_velocity_mps=3", "radar.scan_period_s=4"),
    "radar.detection_probability=0.9",
)


def test_the_answer_of_a_radar_that_misses_plots_stands_without_a_warning():
    """Its exact values stand beside it: 23 rows were said to rest on 'under 200, the least on 20334'."""
    result = radarsim.run("rls2", realisations=2000, overrides=list(S_BAND))
    assert not result.warnings
    assert "note" not in result.curves
    assert "note" not in result.gains


def given(*rows):
    """An answer that gives the interval of σ of these rows of curves, to two digits."""
    return lambda made: [f"{made['curves']['sigma_lo'][i]:.2g} {made['curves']['sigma_hi'][i]:.2g}" for i in rows]


def test_what_is_said_above_an_answer_is_of_the_intervals_that_it_gives():
    """In one line, whatever other rows of whatever table are marked; none where none of its own is."""
    results = [SimpleNamespace(name="a", count=5000)]
    of = [{"case": "a", "component": "x", "k": k, "n": 5000, "filter": f} for f in "fg" for k in range(60)]
    curves = pd.DataFrame(of).assign(sigma=1.0, sigma_lo=0.9, sigma_hi=1.1, n_eff=2500.0)
    curves.loc[20, "n_eff"] = 30.0
    made = notes.noted({"curves": curves, "gains": pd.DataFrame()}, results)
    assert notes.heavy(made["curves"]).sum() == 13
    assert not notes.of_intervals(results, made, [given(0, 59, 80)])
    (line,) = notes.of_intervals(results, made, [given(0, 14, 80)])
    assert line.startswith("1 interval of the answer is too narrow")
    assert "(f): run with -n 2e4" in line  # 5000 × 100/30
    (line,) = notes.of_intervals(results, made, [given(14), given(15, 26, 27)])
    assert line.startswith("3 intervals of the answer are too narrow")
    (line,) = notes.of_intervals([SimpleNamespace(name="a", count=FEW - 1)], made, [given(14)])
    assert f"{FEW - 1} realisations are rough" in line


def test_a_note_that_begins_with_the_name_of_an_interval_is_of_that_one_alone():
    row = {"case": "a", "filter": "f", "n": 5000, "sigma_lo": 0.9, "sigma_hi": 1.1, "gain_lo": 1.0, "gain_hi": 3.0}
    made = {"stages": pd.DataFrame([row | {"note": notes.OF_GAIN + notes.HEAVY}]), "curves": pd.DataFrame()}
    results = [SimpleNamespace(name="a", count=5000)]
    assert not notes.of_intervals(results, made, [lambda made: [str(made["stages"]["sigma_hi"][0])]])
    (line,) = notes.of_intervals(results, made, [lambda made: [str(made["stages"]["gain_hi"][0])]])
    assert "may be too narrow" in line
    assert "(f)" in line


def check_notes_and_warning(config):
    """Of a shipped config: no note beside an exact value; a sentence at most, true of the answer, or none needed."""
    result = radarsim.run(config, realisations=FEW)
    study, made = output.study(result.experiment.study), result.tables
    for table in made.values():
        exact = [name for name in table if name in ("exact_sigma", "exact_percent", "exact_right")]
        if "note" in table and exact and study.exact_errors:
            assert not table.loc[table[exact].notna().all(axis=1), "note"].any()
    said = [line for line in result.warnings if "of the answer" in line]
    assert len(said) <= 1
    assert not any("rare event" in line for line in result.warnings)

    def answer(widened):
        """With intervals twice as wide in some rows of each table."""
        wide = {name: notes._wider(table, at) for name, table in made.items() if len(at := widened(name, table))}
        return list(study.answer(result.cases, {**made, **wide}))

    found = notes.concerned(made, [lambda tables: study.answer(result.cases, tables)])
    every = answer(lambda _, table: np.flatnonzero(notes.heavy(table) & (table.get("note", "") != notes.VARIES)))
    own = answer(lambda name, table: table.index.get_indexer(found[name].index) if name in found else ())
    assert own == every  # no other row's interval is in the answer
    assert bool(said) == (every != list(result.answer)) == bool(found)
    for line in said:
        assert int(re.match(r"[\d,]+", line)[0].replace(",", "")) == sum(map(len, found.values()))
        names = list(dict.fromkeys(name for rows in found.values() for name in rows["filter"]))
        assert all(name in line for name in names[:3])
        asked = re.search(r"-n (\S+) would", line)
        assert asked is None or float(asked[1]) > FEW


@pytest.mark.slow_cases("sonar_missed")
@pytest.mark.parametrize(
    "config", [pytest.param("ambiguous_missed", marks=pytest.mark.slow), "pulses_rls4", "sonar_missed", "rls2"]
)
def test_a_warning_is_true_of_the_answer(config):
    check_notes_and_warning(config)


@pytest.mark.slow
@pytest.mark.parametrize("config", sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml")))
def test_of_every_shipped_config_the_warning_is_true_of_the_answer(config):
    check_notes_and_warning(config)


def test_notes_say_what_their_rows_have():
    """Under a hundred: each marked row has so few, there or within a tenth of the run, and no other has."""
    made = radarsim.run("multimodel_1hz", realisations=1000).curves
    fewest = notes.nearby(made)
    np.testing.assert_array_equal(notes.heavy(made), fewest < notes.EFFECTIVE)
    assert set(made["note"]) == {"", notes.HEAVY}


def test_filters_whose_names_hold_a_comma_are_told_apart():
    results = [SimpleNamespace(name=name, count=FEW - 1) for name in ("PDA", "PDA, 4 of 6")]
    assert notes.few(results)[0].startswith("PDA and “PDA, 4 of 6”: ")
