"""P4's readings: the shipped one is the config as printed; what is exact is what a prepared case has."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from radarsim.app.configs import load
from radarsim.bursts import fisher as exact
from radarsim.bursts import schedule
from radarsim.report.claims.readings import Unreadable
from radarsim.studies import registry
from radarsim.studies.discriminator import study
from radarsim.studies.discriminator.readings import PRINTED_PRIOR, ExactEvidence, Readings, windows

OF = Readings()
CLAIMS = {one.id: one for one in registry.study("discriminator").claims().claims}


@pytest.fixture(scope="module")
def cases():
    return {case.spec.burst.noise_variance: case for case in load("discriminator_paper").cases}


def test_the_default_reading_is_the_config_as_printed(cases):
    changed = OF.changed(CLAIMS["P4.6"], cases[2.25], OF.reading())
    printed = cases[9.0].spec
    assert changed.spec.burst == printed.burst
    assert changed.spec.prior == printed.prior
    thresholds = [one.main_lobe_threshold for one in changed.spec.estimators if one.name in ("sequence", "wide")]
    assert thresholds == [0.5, 0.5]
    assert OF.changed(CLAIMS["P4.6"], cases[9.0], OF.reading()) is None  # one case a reading


def test_exact_windows_are_those_that_a_run_designs(cases):
    for noise, taken in ((9.0, {}), (2.25, {"noise_variance": "2.25", "threshold": "1", "forecast": "multiples"})):
        axes = registry.study("discriminator").prepare(cases[noise]).axes
        designed = axes.duration_s[0][np.isfinite(axes.duration_s[0])]
        seen = ExactEvidence(OF.reading(**taken))
        np.testing.assert_allclose(seen.windows("computed"), designed, rtol=1e-12)


def test_the_probability_of_a_miss_is_that_of_the_prepared_case(cases):
    """By the covariances of many versions at once, and by the designer of a run: forms of their own, one law."""
    for noise, taken in ((9.0, {}), (2.25, {"noise_variance": "2.25", "threshold": "1", "forecast": "multiples"})):
        result = registry.study("discriminator").prepare(cases[noise])
        spec, axes = cases[noise].spec, result.axes
        burst = study.burst_of(spec)
        fisher = partial(exact.fisher, burst, 5)
        condition = schedule.Condition(threshold=float(taken.get("threshold", "0.5")))
        designer = schedule.Designer(burst, axes.prior_sigma, fisher, condition)
        times = burst.pulse_period_s * np.array(axes.pulses[0])
        forms = [designer.handover(before)(after).values for before, after in pairwise(times[:-1])]
        wanted = max(schedule.tail_probability(form, condition.threshold) for form in forms)
        assert ExactEvidence(OF.reading(**taken)).worst_handover("any").value == pytest.approx(wanted, rel=1e-6)
        assert 0.02 < wanted < 0.025


def test_other_windows_go_into_the_config(cases):
    reading = OF.reading(curvature="as printed")
    changed = OF.changed(CLAIMS["P4.4"], cases[2.25], reading)
    wanted = np.array(windows(ExactEvidence(reading)._version)) * 1e-5
    of = {one.name: one for one in changed.spec.estimators}
    np.testing.assert_allclose(of["sequence"].schedule, wanted)
    np.testing.assert_allclose(of["wide"].schedule, wanted[:1])
    assert of["narrow"].schedule == (0.3,)


def test_a_window_that_does_not_exist_says_why():
    with pytest.raises(Unreadable, match="no root"):
        ExactEvidence(OF.reading(first_phase="kept")).windows("computed")


def test_the_sweeps_follow_the_readings_noise():
    cases = load("discriminator_maps").cases
    kept = [OF.changed(CLAIMS["P4.9"], case, OF.reading()) for case in cases]
    noises = sorted(case.spec.burst.noise_variance for case in kept if case is not None)
    assert noises == [9.0, 288.0]  # 2.25 and 72, four times
    assert all(case.spec.prior.sigma == PRINTED_PRIOR for case in kept if case is not None)


def test_what_is_exact_by_reading():
    say = {name: ExactEvidence(OF.reading(noise_variance=name)) for name in ("9", "2.25")}
    assert say["9"].shortest_window("any", 1.17).value == pytest.approx(1.315, abs=5e-4)
    for component, printed in (("phi0", 0.061), ("f0", 0.45), ("f1", 12.2)):
        ratio = say["9"].potential("any", component).value / say["2.25"].potential("any", component).value
        assert ratio == pytest.approx(2.0)
        assert say["2.25"].potential("any", component).value == pytest.approx(printed, rel=5e-3)
