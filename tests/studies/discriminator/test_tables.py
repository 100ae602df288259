"""P4's tables, figures and claims, from a small run."""

import re

import numpy as np
import pytest

from radarsim.api import configs, run
from radarsim.bursts.burst import phase_turns, sample_times, signal
from radarsim.language.translate import quote_name
from radarsim.papers.discriminator import measures
from radarsim.papers.evidence import MissingEvidence
from radarsim.report.drawing.model import Line
from radarsim.studies.discriminator import answer, scenario, study
from radarsim.studies.discriminator import tables as report
from radarsim.studies.discriminator.kernels.sums import bin_edges
from radarsim.studies.discriminator.one_burst import one_burst
from tests.answers import answer_texts
from tests.tolerances import rounding, sigma_error


@pytest.fixture(scope="module")
def made():
    return run.run("discriminator", realisations=256, threads=1)


def test_curves_are_of_the_locked_and_tell_of_all(made):
    rows = made.curves[(made.curves["filter"] == "sequence") & (made.curves["component"] == "f3")]
    last = rows.iloc[-1]
    assert (last["k"], last["t_s"]) == (13, pytest.approx(0.3, rel=rounding(operations=2)))
    assert last["bound"] == pytest.approx(1213, rel=5e-4)  # four printed digits
    assert last["n"] < 256
    assert last["sigma"] == pytest.approx(1213, rel=sigma_error(last["n"]))
    assert last["sigma_all"] > 10 * last["sigma"]
    assert np.all(rows["posterior_crb"] <= rows["bound"])


def test_locks_fall_along_the_windows(made):
    rows = made.tables["locks"]
    own = rows[rows["filter"] == "sequence"]
    assert np.all(np.diff(own["unbroken_lock_rate_3sigma"]) <= 0)
    assert np.all(
        (own["lock_lo"] <= own["lock_rate"]) & (own["lock_rate"] <= own["lock_hi"] * (1 + rounding(operations=8)))
    )
    assert np.all(own["lock_rate_3sigma"] <= own["lock_rate"])
    assert rows[rows["filter"] == "narrow"]["lock_rate"].item() == 0
    assert rows[rows["filter"] == "narrow"]["k"].item() == 1


def test_every_estimator_has_its_own_windows(made):
    windows = made.tables["windows"].groupby("filter")["pulses"].agg(list)
    assert windows["sequence"][0] == 199
    assert windows["narrow"] == [30000]
    assert set(windows["sequence"]) < set(windows["dense"])
    assert windows["wide"] == [199]


def test_motion_follows_from_the_wavelength(made):
    rows = made.tables["motion"].set_index(["band", "burst_point"])
    centimetre, metre = rows.loc[("centimetre", "beginning")], rows.loc[("metre", "beginning")]
    assert centimetre["sigma_velocity_mps"] == pytest.approx(0.015 * 0.4502, rel=1e-3)
    assert metre["sigma_acceleration_mps2"] == pytest.approx(0.9 * 12.204, rel=1e-3)
    assert rows.loc[("metre", "middle")]["sigma_velocity_mps"] < metre["sigma_velocity_mps"] / 4


def test_quantiles_of_a_histogram():
    values = np.abs(np.random.default_rng(1).normal(size=20_000))
    inner = bin_edges()[1:-1]  # outer bins are open
    counts = np.bincount(np.searchsorted(inner, values, side="right"), minlength=len(inner) + 1)[None].astype(float)
    for share, (found,) in zip(
        (0.05, 0.5, 0.95), report.quantiles(counts, bin_edges(), (0.05, 0.5, 0.95)), strict=True
    ):
        # Straight lines within a quarter of an octave, over which the density changes by a tenth or two.
        assert found == pytest.approx(np.quantile(values, share), rel=0.03)


def test_residuals_lie_under_three_bounds(made):
    rows = made.tables["residuals"]
    own = rows[rows["filter"] == "cured"]
    assert np.all(own["q05"] < own["median"])
    assert np.all(own["q95"] < 3 * own["posterior_crb"])
    standard_error = 0.5 / (0.6355 * 256**0.5)  # of a median: the density of |N(0, 1)| there is 0.6355
    assert own["median"].to_numpy() / own["posterior_crb"].to_numpy() == pytest.approx(0.6745, abs=4 * standard_error)


def test_figures_show_the_paper_and_the_locks(made):
    assert made.figures == ("locks", "accuracy", "residuals")
    panels = made._figures_by_name["residuals"].panels
    assert len(panels) == 6
    assert [mark.label for mark in panels[1].marks] == ["median, 5 to 95 % of bursts", "3σ", "one burst"]


def test_the_burst_that_is_drawn_is_the_first_of_the_run():
    case = configs.load("discriminator").cases[0]
    plan = study.prepare(case)
    number = plan.axes.filters.index("cured")
    squares = plan.layout.unpack(study.simulate(plan, 0, 1))["error_all"][number, ..., 1]
    drawn = one_burst(case, number)
    windows = len(plan.axes.pulses[number])
    # A square and its root, and units there and back.
    np.testing.assert_allclose(
        drawn, (np.sqrt(squares) * plan.axes.exact_sigma[number])[:windows], rtol=rounding(operations=8)
    )


def test_swept_cases_are_drawn_against_their_key():
    swept = {"prior.scale": [0.01, 0.1], "burst.noise_variance": [2.25, 9.0]}
    base = configs.load("discriminator_pair").cases[0].spec
    config = {"study": "discriminator", "sweep": swept, "realisations": 64, "seed": 1} | _plain(base)
    done = run.run(config, threads=1)
    assert done.figures == ("lock_scale_noise_variance",)
    heat, border = (
        done._figures_by_name["lock_scale_noise_variance"].panels[0],
        done._figures_by_name["lock_scale_noise_variance"].panels[-1],
    )
    assert heat.marks[0].values.shape == (2, 2)
    assert all(isinstance(mark, Line) for mark in border.marks)


def _plain(spec):
    from radarsim.config.identity import all_keys

    return all_keys(spec)


def test_gains_are_left_to_studies_with_common_scans(made):
    assert made.gains.empty


def test_answer_names_every_estimator(made):
    first, others = answer_texts(answer, made.cases, made.tables)
    names = made.cases[0].axes.filters
    assert first.startswith(f"“{names[0]}” (")
    assert all(re.search(rf"(: |; ){re.escape(quote_name(name))}, \d+(\.\d\d)? % \[", others) for name in names[1:])


def test_claims_find_their_estimators(made):
    kinds = [measures.kind_of(e, 1.0) for e in made.cases[0].spec.estimators]
    assert kinds == ["sequence", "other", "other", "other", "narrow", "wide", "truth", "other", "cured"]
    dense = replace_estimator(made.cases[0].spec.estimators[0], main_lobe_threshold=0.5)
    assert measures.kind_of(dense, 1.0) == "other"


def test_the_fall_to_side_lobes_is_that_of_the_likelihood_itself(made):
    """Of the burst without noise: ln L at random phases and frequencies far from the true ones, sample by sample."""
    burst, rng = scenario.configured_burst(made.cases[0].spec), np.random.default_rng(1)
    t = sample_times(burst, burst.pulses).ravel()
    theta = np.array([0.0, *measures.DOPPLER])
    true = signal(burst, phase_turns(theta, t))
    falls = []
    for _ in range(40):
        aside = theta + np.array([rng.uniform(0, 2 * np.pi), rng.uniform(500, 4000), 0, 0, 0])
        falls.append(np.sum((true - signal(burst, phase_turns(aside, t))) ** 2) / (2 * burst.noise_variance))
    found = measures.Evidence(made.cases, made.tables, {}).span(measures.COMPUTED).value
    mu = 0.3 / (4 * burst.noise_variance * 1e-6) * 0.1
    assert found == pytest.approx(np.mean(falls) / (2 * mu), rel=0.005)


def test_what_a_design_allows_to_fail_is_a_share_of_each_hand_over(made):
    places = {"discriminator": {"estimators": range(len(made.cases[0].spec.estimators))}}
    evidence = measures.Evidence(made.cases, made.tables, places)
    lock = evidence.lock(measures.COMPUTED, "sequence")
    assert tuple(evidence.robust(measures.COMPUTED)) == pytest.approx(
        [part / 0.99**13 for part in lock], rel=rounding(operations=26)
    )


def replace_estimator(estimator, **change):
    return estimator.model_copy(update=change)


def test_a_case_is_found_by_its_interpretation(made):
    evidence = measures.Evidence(made.cases, made.tables, {})
    assert evidence.case(measures.COMPUTED) is made.cases[0]
    with pytest.raises(MissingEvidence):
        evidence.case(measures.PRINTED)


@pytest.mark.slow
def test_losses_are_told_beside_the_design_first():
    made = run.run("discriminator_rare", realisations=400)
    rows = made.tables["rare"].query("sought").set_index("case")
    designed = 1 - rows.index.str.rpartition("=").get_level_values(2).astype(float)
    times = rows["event_rate"] / designed
    first = made.answer[0]
    assert first.startswith("“exact tail” loses lock in ")
    assert f", {times.max():.3g} times the 10⁻⁶ of its design: the largest ratio of 4 cases (" in first
    alone = run.run("discriminator_rare", realisations=400, overrides=["sweep.estimators.0.lock_probability=[0.999]"])
    assert "of its design" not in alone.answer[0]
