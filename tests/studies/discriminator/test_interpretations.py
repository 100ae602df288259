"""P4's interpretations: the shipped one is the config as printed; what is exact is what a prepared case has."""

from functools import partial
from itertools import chain, pairwise

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.bursts import fisher as bursts_fisher
from radarsim.bursts import schedule_design
from radarsim.engine.results import CaseResult
from radarsim.papers.discriminator.burst_versions import PRINTED_PRIOR
from radarsim.papers.discriminator.interpretations import ExactEvidence, Interpretations, windows
from radarsim.papers.interpretations import ImpossibleInterpretation
from radarsim.papers.study_claims import claims_of
from radarsim.papers.verdict_rule import CONFIRMED, REFUTED
from radarsim.papers.verdicts_by_interpretation import judge_claim
from radarsim.studies import registry
from radarsim.studies.discriminator import scenario
from tests.tolerances import rounding, scaled_condition

OF = Interpretations()
CLAIMS = {one.id: one for one in claims_of(registry.study("discriminator")).claims}


@pytest.fixture(scope="module")
def cases():
    return {case.spec.burst.noise_variance: case for case in load("discriminator_paper").cases}


def test_the_default_interpretation_is_the_config_as_printed(cases):
    changed = OF.changed_case(CLAIMS["P4.6"], cases[2.25], OF.interpretation())
    printed = cases[9.0].spec
    assert changed.spec.burst == printed.burst
    assert changed.spec.prior == printed.prior
    thresholds = [one.main_lobe_threshold for one in changed.spec.estimators if one.name in ("sequence", "wide")]
    assert thresholds == [0.5, 0.5]
    assert OF.changed_case(CLAIMS["P4.6"], cases[9.0], OF.interpretation()) is None  # one case an interpretation


@pytest.mark.slow
def test_exact_windows_are_those_that_a_run_designs(cases):
    for noise, taken in ((9.0, {}), (2.25, {"noise_variance": "2.25", "threshold": "1", "forecast": "multiples"})):
        axes = registry.study("discriminator").prepare(cases[noise]).axes
        designed = axes.duration_s[0][np.isfinite(axes.duration_s[0])]
        seen = ExactEvidence(OF.interpretation(**taken))
        np.testing.assert_allclose(seen.windows("computed"), designed, rtol=rounding(operations=2))


def test_the_probability_of_a_miss_is_that_of_the_prepared_case(cases):
    """By the covariances of many versions at once, and by the designer of a run: forms of their own, one law."""
    for noise, taken in ((9.0, {}), (2.25, {"noise_variance": "2.25", "threshold": "1", "forecast": "multiples"})):
        result = registry.study("discriminator").prepare(cases[noise])
        spec, axes = cases[noise].spec, result.axes
        burst = scenario.configured_burst(spec)
        fisher = partial(bursts_fisher.fisher, burst, 5)
        condition = schedule_design.Condition(threshold=float(taken.get("threshold", "0.5")))
        designer = schedule_design.Designer(burst, axes.prior_sigma, fisher, condition)
        times = burst.pulse_period_s * np.array(axes.pulses[0])
        forms = [designer.handover(before)(after).values for before, after in pairwise(times[:-1])]
        # Forms are of inverses; a tail of 0.02 changes by some four times the relative change of its weights.
        known = np.diag(bursts_fisher.phase_prior(axes.prior_sigma))
        allowed = 4 * rounding(max(scaled_condition(fisher(t) + known) for t in times), 25)
        wanted = max(schedule_design.tail_probability(form, condition.threshold) for form in forms)
        assert ExactEvidence(OF.interpretation(**taken)).worst_handover("any").value == pytest.approx(
            wanted, rel=allowed
        )
        assert 0.02 < wanted < 0.025


def test_other_windows_go_into_the_config(cases):
    interpretation = OF.interpretation(curvature="as printed")
    changed = OF.changed_case(CLAIMS["P4.4"], cases[2.25], interpretation)
    wanted = np.array(windows(ExactEvidence(interpretation)._version)) * 1e-5
    of = {one.name: one for one in changed.spec.estimators}
    np.testing.assert_allclose(of["sequence"].schedule, wanted, rtol=rounding(operations=2))
    np.testing.assert_allclose(of["wide"].schedule, wanted[:1], rtol=rounding(operations=2))
    assert of["narrow"].schedule == (0.3,)


def test_a_window_that_does_not_exist_says_why():
    with pytest.raises(ImpossibleInterpretation, match="no root"):
        ExactEvidence(OF.interpretation(first_phase="kept")).windows("computed")


def test_the_sweeps_follow_the_interpretations_noise():
    cases = load("discriminator_maps").cases
    kept = [OF.changed_case(CLAIMS["P4.9"], case, OF.interpretation()) for case in cases]
    noises = sorted(case.spec.burst.noise_variance for case in kept if case is not None)
    assert noises == [9.0, 288.0]  # 2.25 and 72, four times
    assert all(case.spec.prior.sigma == PRINTED_PRIOR for case in kept if case is not None)


def test_what_is_exact_by_interpretation():
    say = {name: ExactEvidence(OF.interpretation(noise_variance=name)) for name in ("9", "2.25")}
    assert say["9"].shortest_window("any", 1.17).value == pytest.approx(1.315, abs=5e-4)
    for component, printed in (("phi0", 0.061), ("f0", 0.45), ("f1", 12.2)):
        ratio = say["9"].potential("any", component).value / say["2.25"].potential("any", component).value
        assert ratio == pytest.approx(2.0, rel=rounding(2.1e5, 5))  # κ of five powers of time
        assert say["2.25"].potential("any", component).value == pytest.approx(printed, rel=5e-3)


def classes(claim):
    """The outcomes of an exact claim by threshold and lobe, over noise and forecast."""
    found = {}
    varied = [choice for choice in OF.choices if choice.key in ("noise_variance", "threshold", "lobe", "forecast")]
    for interpretation in OF.combinations(varied):
        seen = judge_claim(OF, CLAIMS[claim], interpretation, ExactEvidence(interpretation))
        found.setdefault((interpretation["threshold"], interpretation["lobe"]), set()).add(seen.outcome.kind)
    return found


def test_a_design_by_11_for_the_lobe_of_10_keeps_its_promise():
    """Two numbers are printed for c: the design may take one and the lobe the other, and only 0.5 for 1 holds."""
    assert classes("P4.12") == {
        ("0.5", "one c"): {REFUTED},
        ("1", "one c"): {REFUTED},
        ("0.5", "two"): {CONFIRMED},
        ("1", "two"): {REFUTED},
    }
    worst = {name: ExactEvidence(OF.interpretation(lobe=name)).worst_handover("any").value for name in ("one c", "two")}
    # By another program, with 400 000 draws of the form.
    assert worst["one c"] == pytest.approx(0.0224, abs=5e-4)
    assert worst["two"] == pytest.approx(0.00125, abs=1e-4)


def test_the_phase_is_searched_for_once():
    """The forecast's phase is anywhere; at the hand-overs it is as near as the form's rank-one error leaves it."""
    assert set(chain(*classes("P4.20").values())) == {CONFIRMED}
    for noise, c in (("9", "0.5"), ("2.25", "1")):
        offsets = ExactEvidence(OF.interpretation(noise_variance=noise, threshold=c)).phase_offsets("any")
        assert offsets[0] > np.pi / 2
        assert 0.1 < offsets[1:].max() < 0.5


def test_offsets_of_the_phase_are_those_of_the_prepared_case(cases):
    """Of many versions at once, in scaled units, and by the designer of a run."""
    evidence = claims_of(registry.study("discriminator")).evidence
    for noise, taken in ((9.0, {}), (2.25, {"noise_variance": "2.25", "threshold": "1", "forecast": "multiples"})):
        result = registry.study("discriminator").prepare(cases[noise])
        case, own = cases[noise], {"estimators": set(range(len(result.axes.filters)))}
        seen = evidence(
            [CaseResult(case.name, "discriminator", case.spec, (), 0, {}, result.axes)], {}, {case.name: own}
        )
        wanted = seen.phase_offsets("printed" if noise == 9 else "computed")
        np.testing.assert_allclose(
            ExactEvidence(OF.interpretation(**taken)).phase_offsets("any"), wanted, rtol=rounding(2.1e5, 100)
        )
