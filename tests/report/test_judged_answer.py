"""Sentences on a judged filter: one number for equal filters, no loss left unsaid, no number that says nothing."""

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.report.user_filters import answer, rival_comparison
from radarsim.studies import registry
from tests.api.test_judge import twin

DRAWN_TARGET = {  # σ has a posterior bound
    "kind": "turn", "range_m": 60e3, "speed_mps": 250, "aspect_deg": 180, "start_s": 50, "acceleration_g": 3,
    "duration_s": 20, "sigma_position_m": 3000, "sigma_velocity_mps": 60,
}  # fmt: skip


def judged(target, **options):
    return radarsim.judge("rls2", target, figures=False, threads=1, **({"realisations": 1000} | options))


def floor_sentence(answer):
    return next(line for line in answer if line.startswith("There the "))


def test_an_equal_filter_has_the_exact_number_and_no_other():
    answer = judged(twin).answer
    first, floor = answer[0], floor_sentence(answer)
    assert re.search(r"“mine” is equal to r\+Vr, .*, identical in all 1000 realisations: .* fewer than 0\.3 % ", first)
    assert first.endswith("; the RMS error of both is 154.7 m.")
    assert floor.endswith(": above it is r+Vr 5.18 %, and “mine” as far.")


def test_sigma_and_gain_of_one_sentence_agree():
    """Of a filter that errs otherwise, and of one that gives no number where its error is largest."""
    result = judged(lambda plots: plots["range_m"])
    gain = result.gains.query("baseline == 'r+Vr' and component == 'r'").iloc[-1]["gain_percent"]
    exact = result.curves.query("filter == 'r+Vr' and component == 'r'").iloc[-1]["exact_sigma"]
    assert f"its RMS error is {exact * (1 - gain / 100):.4g} m [" in result.answer[0]
    assert f"that of r+Vr {exact:.4g} m." in result.answer[0]

    def failing(plots):
        x = twin(plots)
        far = np.abs(x[..., 0] - twin_truth[: len(x)])
        x[far[:, -1] > 300] = np.nan
        return x

    twin_truth = radarsim.plots("rls2", n=1000).truth[..., 0]
    result = judged(failing)
    found = re.search(
        r"its RMS error is (\S+) m \[.*\], that of r\+Vr in the same realisations about (\S+) m\.",
        " ".join(result.answer[:3]),
    )
    assert found
    assert float(found[1]) == float(found[2])
    assert "m; above it is r+Vr 5.18 %. “mine”, which has an estimate in other" in floor_sentence(result.answer)


def test_a_loss_in_another_component_is_in_the_first_sentence():
    def rough_velocity(plots):
        x = twin(plots)
        x[..., 1] += 20 * plots.normals(1)[..., 0]
        return x

    first = judged(rough_velocity).answer[0]
    assert "is equal to r+Vr" in first
    assert ", but worse than r+Vr in Vr there: gain −" in first
    assert "but worse" not in judged(twin).answer[0]


def test_below_a_posterior_bound_is_nothing_that_sees_only_the_plots():
    plots = radarsim.plots("rls2", n=300, overrides={"target": DRAWN_TARGET})
    knowing = plots.truth[..., 0] + 0.1 * (plots["range_m"] - plots.truth[..., 0])
    result = judged(knowing, realisations=300, overrides={"target": DRAWN_TARGET})
    floor = floor_sentence(result.answer)
    assert "the posterior Cramér–Rao bound" in floor
    assert any("Below it no estimator can be, biased or not" in text for text in result.answer)
    assert "biased, or knows" not in floor
    assert re.search(r": “mine” is \d\d\.\d % \[\d\d\.?\d*, \d\d\.?\d*\] below it; above it is r\+Vr \d", floor)


def test_of_gains_over_all_scans_those_are_left_out_that_compare_nothing():
    curves = pd.DataFrame(
        {"case": "a", "filter": "best", "component": "x", "k": [1, 2, 3, 4], "sigma": [0.0, 1e-6, 2.0, 1.0]}
    )
    gains = pd.DataFrame(
        {"baseline": "best", "component": "x", "k": [1, 2, 3, 4], "gain_percent": [np.nan, -8e7, -3.0, -np.inf]}
    )
    kept = answer._comparable(gains, SimpleNamespace(name="a"), {"curves": curves})
    assert kept["k"].tolist() == [3]


@pytest.mark.parametrize("point", [(("y", 20.0),), (("y", 20.0), ("x", 30.0))])
def test_a_filter_is_judged_at_the_worst_point_of_the_studys_own_answer(point):
    rows = [
        {"baseline": "best", "component": c, "k": k, "t_s": 10.0 * k, "gain_percent": gain}
        for (c, k, gain) in (("x", 2, 5.0), ("x", 3, -7.0), ("y", 2, -4.0), ("y", 3, 9.0))
    ]
    curves = [
        {"case": "a", "filter": name, "component": c, "k": k, "sigma": 1.0, "exact_sigma": np.nan}
        for name in ("best", "mine")
        for c in "xy"
        for k in (2, 3)
    ]
    axes = SimpleNamespace(components=(("x", "m"), ("y", "m")), filters=("best",), answer_at=None, answer_points=point)
    axes.dependent = ()
    result = SimpleNamespace(name="a", axes=axes, user_filters=SimpleNamespace(axes=axes))
    worst = rival_comparison.worst_comparison(result, "mine", pd.DataFrame(rows), {"curves": pd.DataFrame(curves)})
    row = worst.row_against("best")
    assert (row["component"], row["k"]) == (("x", 3) if len(point) > 1 else ("y", 2))


def test_a_flight_is_judged_by_the_height_at_the_end_of_each_stage():
    stages = [SimpleNamespace(name=name) for name in ("start", "manoeuvre", "after")]
    target = SimpleNamespace(stages=stages, stage_ends_s=(20.0, 45.0))
    axes = SimpleNamespace(t_s=np.arange(3.0, 70.0, 10.0), stage_scans=np.array([2, 3, 2]))
    flight = SimpleNamespace(spec=SimpleNamespace(target=target), axes=axes)
    points = registry.study("multimodel").answer_points(flight)
    assert points == [("y", 13.0), ("y", 43.0), ("y", 63.0)]


def late(plots):
    x = twin(plots)
    x[:, 1:] = x[:, :-1].copy()
    return x


def bold(plots):
    """The config's filter, with a covariance that is far too small."""
    x = twin(plots)
    return x, np.broadcast_to(np.eye(3) * (1.0, 0.1, 1e-4), (*x.shape, 3))


def main_sentences(target, **options):
    result = judged(target, **options)
    return result.answer[: result._answer.main_count]


def test_a_recognised_fault_comes_first_then_the_verdict_and_the_next_step():
    fault, verdict, next_step = main_sentences(late)
    assert "stand too late" in fault or "stand a scan too late" in fault
    assert verdict.startswith("“mine” is worse than r+Vr")
    assert next_step.startswith("Next: mend this")
    assert "read as r (m), Vr (m/s)" in next_step


def test_the_judgement_is_verdict_consistency_and_next_step():
    verdict, consistency, next_step = main_sentences(twin)
    assert verdict.startswith("“mine” is equal to r+Vr")
    assert "gives no covariances" in consistency
    assert "--against tuned" in next_step
    _, consistency, _ = main_sentences(bold)
    assert "(1 is right): its errors are larger than its covariance says." in consistency
    *_, next_step = main_sentences(lambda plots: plots["range_m"])
    assert "tune it" in next_step


def test_an_undecided_judgement_says_how_many_realisations_decide(monkeypatch):
    def disturbed(plots):
        x = twin(plots)
        x[..., 0] += 10 * plots.normals(1)[..., 0]
        return x

    verdict, _, next_step = main_sentences(disturbed, realisations=300)
    assert "cannot be distinguished" in verdict
    needed = int(re.search(r"about ([\d,]+) realisations", next_step)[1].replace(",", ""))
    gain, low, high = (float(end) for end in re.search(r"gain −(\S+) % \[−?(\S+), −?(\S+)\]", verdict).groups())
    assert needed == pytest.approx(300 * ((high + low) / 2 / gain) ** 2, rel=0.1)
    monkeypatch.setattr(answer, "MAX_SUGGESTED_REALISATIONS", needed - 100)
    assert "decides nothing" in main_sentences(disturbed, realisations=300)[-1]
