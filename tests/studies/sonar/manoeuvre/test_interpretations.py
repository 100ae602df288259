"""P3's interpretations about manoeuvres: single tests and short memories exactly, the rest by changed cases."""

import pytest

from radarsim.api.configs import load
from radarsim.papers.sonar.manoeuvre.interpretations import Interpretations
from radarsim.papers.study_claims import claims_of
from radarsim.studies import registry

OF = Interpretations()
STUDY = registry.study("sonar")
CLAIMS = {one.id: one for one in claims_of(STUDY).claims}


def values(claim, **taken):
    interpretation = OF.interpretation(**taken)
    assert OF.is_exact(CLAIMS[claim], interpretation)
    seen = OF.evidence(CLAIMS[claim], interpretation, None, claims_of(STUDY))
    return [part.measure(seen).value for part in OF.parts(CLAIMS[claim], interpretation)]


def test_the_probability_of_a_single_test_hangs_on_the_manoeuvre():
    assert values("P3.9") == [pytest.approx(0.523, abs=5e-4)]
    assert values("P3.9", strength="1.456 σ_a") == [pytest.approx(0.683, abs=5e-4)]
    assert values("P3.9", strength="two σ_a") == [pytest.approx(0.8427, abs=5e-5)]


def test_how_many_plots_are_enough_hangs_on_what_is_enough():
    """By the table of σ/σ_x at n = 2…8: 1, .913, .837, .775, .724, .681, .646; a scan ahead 1.049, .931 at 5, 6."""
    assert values("P3.3") == [6]
    assert values("P3.3", high_accuracy="half the variance") == [7]  # .724 > √½ > .681
    assert values("P3.3", high_accuracy="two thirds") == [8]
    assert values("P3.3", high_accuracy="under 5 % more") == [8]  # 0.6146 at nine plots


def test_a_part_is_called_what_it_is_under_its_interpretation():
    def named(claim, **taken):
        return [part.what for part in OF.parts(CLAIMS[claim], OF.interpretation(**taken))]

    for claim in ("P3.3", "P3.8", "P3.9", "P3.10"):
        assert named(claim) == [part.what for part in CLAIMS[claim].parts if part.asserted]
    assert named("P3.3", high_accuracy="two thirds") == ["fewest plots that smooth to two thirds of a plot's σ"]
    assert named("P3.9", strength="half σ_a")[0].endswith("acceleration of 0.5 σ_a")
    assert named("P3.10", memory="six plots")[0].endswith("degree switched by six plots")
    late = named("P3.8", false_alarms="0.01", seen="beginning")
    assert (
        "mean time to detect the beginning of the weakest manoeuvre at 0.01 false alarms a test, 8 plots over 5" in late
    )
    assert not any("k = 1" in what for what in late)


def test_switching_within_the_papers_own_six_plots():
    found = values("P3.10", memory="six plots")
    assert found == pytest.approx([0.975, 1.188, 1.867, 1.101], abs=5e-4)


def test_cases_are_changed_as_a_interpretation_says():
    cases = load("sonar_manoeuvre").cases
    assert not OF.is_exact(CLAIMS["P3.8"], OF.interpretation())
    taken = OF.interpretation(tests="batches", manoeuvre="80 s")
    changed = [one for one in (OF.changed_case(CLAIMS["P3.8"], case, taken) for case in cases) if one is not None]
    assert sorted(abs(one.spec.target.acceleration_mps2) for one in changed) == [0.1, 0.8]
    for one in changed:
        assert one.spec.target.end_s - one.spec.target.start_s == 80
        own = [d for d in one.spec.detectors if d.name == f"{d.plots} plots"]
        assert own
        assert all(d.test_every == d.plots for d in own)
    faster = OF.changed_case(CLAIMS["P3.10"], cases[-1], OF.interpretation(switching_false_alarms="0.1"))
    rates = {f.name: f.detector.false_alarm_probability for f in faster.spec.filters if f.detector}
    assert set(rates.values()) == {0.1}


def test_a_part_on_delays_asks_for_the_interpretations_rate():
    parts = OF.parts(CLAIMS["P3.8"], OF.interpretation(false_alarms="0.01", seen="beginning"))
    assert all(part.asserted for part in parts)
    assert {part.statement for part in parts} == {"threshold", "time", "not worth while"}


@pytest.mark.slow
def test_more_plots_can_be_worth_while_under_a_interpretation(tmp_path, monkeypatch):
    """At 0.01 false alarms eight plots see the weakest manoeuvre sooner than four or five; in %, as the words want."""
    from radarsim.papers.judge_interpretations import judge_requests
    from radarsim.papers.open_papers import judging_requests

    taken = OF.interpretation(false_alarms="0.01", manoeuvre="80 s", seen="beginning", tests="sliding")
    monkeypatch.setattr(type(OF), "of_claim", lambda self, claim: [self.interpretation(), taken])
    done = judge_requests(judging_requests(["P3.8"]), out=tmp_path, realisations=200, figures=False)
    shipped, other = done.papers[0].claims[0].verdicts
    weak = [one.parts[4][1] for one in (shipped, other)]
    assert all(one.parts[4][0].unit == "%" for one in (shipped, other))
    assert -100 < weak[1].measured < -10 < weak[0].measured < 100
    assert other.outcome.kind == "refuted"
