"""Tables, figures, sentences and recorded plots of a small run."""

import numpy as np
import pytest

import radarsim
from radarsim.app.configs import load
from radarsim.errors import ConfigError
from radarsim.studies import registry
from radarsim.studies.ambiguous_doppler import map as fans
from radarsim.studies.ambiguous_doppler import study, track


@pytest.fixture(scope="module")
def found():
    return radarsim.run("ambiguous_rls4", realisations=3000)


def test_folds(found):
    folds = found.tables["folds"]
    assert set(folds["filter"]) == {"nearest fold", "no memory", "best hypothesis", "memory"}
    assert (folds["right_lo"] <= folds["right"]).all()
    assert (folds["right"] <= folds["listed"]).all()
    memory = folds[folds["filter"] == "memory"].set_index("k")
    assert memory.loc[8, "right"] > 0.98
    assert memory.loc[1, "hypotheses"] == pytest.approx(210, abs=5)  # as many as spans fit into the prior
    nearest = folds[folds["filter"] == "nearest fold"]
    assert (nearest["hypotheses"] == 1).all()
    assert (nearest["right"].diff().dropna() <= 0).all()  # once lost, always lost


def test_calibration_is_of_filters_that_remember(found):
    table = found.tables["calibration"]
    assert set(table["filter"]) == {"best hypothesis", "memory"}
    assert table.groupby(["filter", "k"])["n"].sum().eq(3000).all()
    assert ((table["expected"] >= table["bin_lo"]) & (table["expected"] <= table["bin_hi"])).all()


def test_gains_beside_the_oracle(found):
    gains = found.tables["gains"]
    own = gains[(gains["filter"] == "oracle")]
    assert own["above_oracle_percent"].isna().all()
    curves = found.curves.set_index(["filter", "component", "k"])["sigma"]
    row = gains[(gains["filter"] == "memory") & (gains["component"] == "Vr") & (gains["k"] == 5)].iloc[0]
    ratio = curves["memory", "Vr", 5] / curves["oracle", "Vr", 5]
    assert row["above_oracle_percent"] == pytest.approx(100 * (ratio - 1))
    assert row["above_oracle_lo"] < row["above_oracle_percent"] < row["above_oracle_hi"]


def test_sentences_tell_from_which_scan_on_it_is_as_good(found):
    experiment = load("ambiguous_rls4")
    one = registry.study("ambiguous_doppler")
    assert one.question(experiment) == "How much is the folded velocity of RLS 4 worth, and from which scan on?"
    (sentence,) = one.answer(found.cases, found.tables)
    assert sentence.startswith("RLS 4, D = 15 m/s, memory: ")
    assert "all folds are right in" in sentence


def test_orders_and_their_sentence():
    made = radarsim.run("orders", realisations=1000)
    table = made.tables["orders"]
    assert table.groupby(["filter", "k"])["weight"].sum().to_numpy() == pytest.approx(1)
    assert set(table["filter"]) == {"likelihood", "expected error", "intersection"}
    assert len(made.tables["folds"]) == 0
    (sentence,) = registry.study("ambiguous_doppler").answer(made.cases, made.tables)
    assert "by the best combination" in sentence
    assert {"orders", "sigma_r"} <= set(made.figures)


def test_figures(found):
    assert {"sigma_Vr", "right", "lost", "hypotheses"} <= set(found.figures)


def test_fan_holds_what_the_filter_estimates():
    """The weighted mean of the listed hypotheses is the filter's estimate, scan by scan."""
    case = load("ambiguous_rls4").cases[0]
    plan = study.prepare(case)
    _, out = study.sums.simulated(plan.world, plan.banks, 0)
    shown = fans.fan(case, 5, 6)
    for k, (v, a, p) in enumerate(shown.lists):
        mean = out[plan.banks.bank[5], k, :3, 7]
        assert p @ v == pytest.approx(mean[1], rel=1e-9, abs=1e-6)
        assert p @ a == pytest.approx(mean[2], rel=1e-9, abs=1e-6)
        assert (np.diff(p) <= 0).all()


@pytest.mark.parametrize("keys", [(), ("radar.detection_probability=0.7",), ("radar.repetition_rate_hz=[1000, 1200]",)])
def test_track_over_simulated_plots_is_the_study(keys):
    """Recorded at the config's own times, the trackers' estimates are those of the kernels."""
    case = load("ambiguous_rls4", [*keys, "filters.2.hypotheses=2"]).cases[0]
    plan = study.prepare(case)
    plots, out = study.sums.simulated(plan.world, plan.banks, 8)
    columns = track.simulated(case, 11)
    seen = ~np.isnan(columns["range_m"])
    assert np.array_equal(columns["range_m"][seen], plots[seen, 0, 3])
    assert (np.abs(columns["velocity_mps"][seen]) <= plan.world.spans[seen] / 2).all()
    given = columns | {"velocity_mps": columns["velocity_mps"].copy()}
    made = track.Tracker(case).feed(given)
    started = np.cumsum(seen) > 0
    for f, name in enumerate(made.filters):
        if name != "oracle":  # recorded velocities are folded
            own = out[plan.banks.bank[f], :, plan.banks.place[f] : plan.banks.place[f] + 3, 3]
            assert np.abs((made.estimate[f] - own)[started] / [1e5, 1e3, 10]).max() < 1e-7, name
            assert np.isnan(made.estimate[f][~started]).all()


def test_track_refuses_combinations_of_orders():
    with pytest.raises(ConfigError, match="track follows filters of one order"):
        track.Tracker(load("orders").cases[0])
