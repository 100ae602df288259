"""What is asked, in one phrase that every command reads; the long run against a recursion of its own."""

import numpy as np
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.api.design import objective
from radarsim.config.quantity_phrase import PhraseError, QuantityPhrase, parse_phrase
from radarsim.errors import ConfigError
from tests.program import command

RADAR = {"name": "mine", "wavelength_m": 0.032, "sigma_range_m": 15, "sigma_velocity_mps": 0.8, "scan_period_s": 2.5}
MINE = {
    "study": "range_doppler",
    "radar": RADAR,
    "target": "polynomial",
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
    ],
    "scans": 15,
    "realisations": 1000,
}
TURN = {"kind": "turn", "range_m": 8e3, "speed_mps": 12, "aspect_deg": 180, "start_s": 60}
BOAT = MINE | {"scans": 61, "target": TURN | {"acceleration_g": 0.2, "duration_s": 18}}
SIGMA_V = "radar.sigma_velocity_mps"


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("sigma r at 60 s", QuantityPhrase("sigma", "r", at_s=60.0)),
        ("worst sigma r", QuantityPhrase("sigma", "r", "worst")),
        ("worst sigma r from 60 s on", QuantityPhrase("sigma", "r", "worst", from_s=60.0)),
        ("mean sigma r from 60 s", QuantityPhrase("sigma", "r", "mean", from_s=60.0)),
        ("sigma r in the long run", QuantityPhrase("sigma", "r", "long run")),
        ("gain of Vr at the end", QuantityPhrase("gain", "Vr")),
        ("probability model 2 at k 3", QuantityPhrase("probability", "model 2", at_k=3)),
        ("false-tracks", QuantityPhrase("false_tracks")),
    ],
)
def test_a_phrase_says_quantity_component_and_scans(text, meaning):
    assert parse_phrase(text) == meaning


@pytest.mark.parametrize("text", ["sigma r at noon", "sigma r from 60 s", "worst sigma r at 3 s", "sigma r at 60", ""])
def test_what_is_no_phrase_is_refused(text):
    with pytest.raises(PhraseError, match="got"):
        parse_phrase(text)


def steady_sigma(sigma_v, variance=1e-3, dt=2.5, sigma_r=15.0):
    """σ of the range in the long run: Riccati's gain, then the errors of the plots alone, on a target as expected."""
    F, G = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]]), np.array([dt**3 / 6, dt**2 / 2, dt])
    H, R = np.eye(3)[:2], np.diag([sigma_r**2, sigma_v**2])
    P = S = np.diag([sigma_r**2, sigma_v**2, 1.0])
    for _ in range(4000):
        P = F @ P @ F.T + variance * np.outer(G, G)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        P = (np.eye(3) - K @ H) @ P
        A = (np.eye(3) - K @ H) @ F
        S = A @ S @ A.T + K @ R @ K.T
    return np.sqrt(S[0, 0])


def test_the_long_run_is_a_time_like_any_other():
    answer = radarsim.solve(
        MINE, SIGMA_V, wanted="sigma r in the long run", filter="r+Vr", equals=2.5877, between=(0.1, 1)
    )
    assert answer.exact
    assert steady_sigma(answer.value) == pytest.approx(2.5877, rel=1e-7)


@pytest.mark.slow
def test_sensitivity_in_the_long_run():
    found = radarsim.sensitivity(MINE, wanted="sigma r in the long run").table
    row = found[(found["key"] == SIGMA_V) & (found["filter"] == "r+Vr")].iloc[0]
    assert row["sigma"] == pytest.approx(steady_sigma(0.8), rel=1e-7)
    assert row["sigma_change_percent"] == pytest.approx(100 * (steady_sigma(0.88) / steady_sigma(0.8) - 1), rel=1e-6)


def test_a_refusal_names_its_time_and_what_the_long_run_allows():
    answer = radarsim.solve(MINE, SIGMA_V, sigma="r", filter="r+Vr", equals=2.926, between=(0.01, 1))
    assert answer.value is None
    assert "at the last scan (35 s): 2.926 m is not attainable" in answer.unattained[0]
    (note,) = [line for line in answer.unattained if "in the long run" in line]
    value = float(note.partition(" = ")[2].split()[0])
    assert steady_sigma(value) == pytest.approx(2.926, rel=1e-5)


@pytest.mark.parametrize(("phrase", "of"), [("worst", np.max), ("mean", np.mean)])
@pytest.mark.parametrize(("since", "k"), [("", 24), (" from 100 s", 40)])
def test_over_scans_it_is_taken_from_the_manoeuvre_on_or_from_a_time(phrase, of, since, k):
    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load

    wanted = f"{phrase} sigma r{since}"
    answer = radarsim.solve(BOAT, SIGMA_V, wanted=wanted, filter="r+Vr", equals=9, between=(0.5, 5))
    (case,) = load(BOAT, [f"{SIGMA_V}={answer.value!r}"]).cases
    assert of(CaseWork(case).plan.axes.exact_sigma[1, k:, 0]) == pytest.approx(9, rel=1e-8)


@pytest.mark.slow
def test_tune_and_sensitivity_take_the_worst_error():
    tuned = radarsim.tune(BOAT, "worst sigma r", filter="r+Vr")
    assert tuned.exact
    assert tuned.keys[0].tuned == pytest.approx(0.1738, rel=0.02)  # as minimise finds it, with every plot
    table = radarsim.sensitivity(BOAT, wanted="worst sigma r").table
    assert table[table["filter"] == "r+Vr"]["sigma"].iloc[0] == pytest.approx(tuned.all.stated, rel=1e-12)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["solve", "rls2", SIGMA_V, "--for", "sigma r at 60 s", "--at", "3", "--equals", "3"],
            "stands in --for already",
        ),
        (["solve", "rls2", SIGMA_V, "--for", "sigma r", "--sigma", "r", "--equals", "3"], "got sigma, --for"),
        (["sensitivity", "rls2", "--for", "sigma r", "--component", "r"], "--component: stands in --for already"),
        (
            ["sensitivity", "multimodel", "--for", "sigma x in the long run"],
            "the run lasts as long as the target's flight",
        ),
    ],
)
def test_what_goes_against_a_phrase_is_refused(words, message):
    result = command(*words, code=2)
    assert message in result.output


def test_a_time_beyond_the_run_is_refused():
    with pytest.raises(ConfigError, match="from must be from 0 to 35 s"):
        radarsim.solve(MINE, SIGMA_V, wanted="worst sigma r from 99 s", filter="r+Vr", equals=3)


def test_a_judgement_of_the_worst_error_is_about_its_scan():
    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load
    from radarsim.api.design.tune import judged_point

    axes = CaseWork(load(BOAT).cases[0]).plan.axes
    best = axes.exact_sigma[:, :, 0].min(axis=0)
    assert judged_point(load(BOAT), "worst sigma r") == ("r", axes.t_s[24 + best[24:].argmax()])
    with pytest.raises(ConfigError, match="a judgement is about one scan"):
        judged_point(load(BOAT), "mean sigma r")


def test_a_precision_is_asked_of_a_phrase():
    """σ of the range at 60 s is known as every σ is; the gain of a component at the end by a wider interval."""
    from radarsim.api.configs import load
    from radarsim.api.precision_target import asked_table

    (case,) = load("rls2").cases
    result = radarsim.run("rls2", realisations=2000)
    every, at_60_s, late, last = (
        asked_table(case, text)(result.cases)
        for text in ("sigma", "sigma r at 60 s", "worst sigma r from 100 s", "gain of Vr at the end")
    )
    assert len(every) == len(result.curves)
    assert set(at_60_s["t_s"]) == {60.0}
    assert set(late["t_s"]) == {100.0, 110.0, 120.0, 130.0, 140.0}
    assert set(at_60_s["component"]) == set(late["component"]) == {"r"}
    assert (last["k"].tolist(), last["component"].tolist()) == ([15], ["Vr"])
    for text, message in (
        ("sigma q", "no component 'q'; there are: r, Vr, ar"),
        ("sigma r at 1e9 s", "must be from 0 to 140 s, the last scan's time, got 1e\\+09"),
        ("worst sigma r from 999 s", "must be from 0 to 140 s"),
        ("sigma r at k 99", "must be a scan of the tables, to 15, got 99"),
    ):
        with pytest.raises(ConfigError, match=message):
            asked_table(case, text)(result.cases)


@pytest.mark.slow
def test_a_long_run_without_a_formula_extends_the_horizon_until_it_has_settled():
    """The σ of folded Doppler's oracle, a Kalman filter, is the fixed point of its covariance, here by a recursion."""
    answer = radarsim.solve(
        "ambiguous_rls4", "radar.sigma_velocity_mps", wanted="sigma r in the long run", filter="oracle", equals=16
    )
    radar = load("ambiguous_rls4").cases[0].spec.radar
    variance = load("ambiguous_rls4").cases[0].spec.filters[1].variances[0]
    limit = steady_sigma(answer.value, variance, radar.scan_period_s, radar.sigma_range_m)
    assert limit == pytest.approx(16, rel=2e-3)
    assert f"in the long run (settled; with the keys as stated at {answer.last_s:g} s)" in answer.lines[1][1]
    assert answer.last_s > 140


@pytest.mark.slow
def test_a_filter_that_never_settles_has_no_long_run():
    with pytest.raises(ConfigError, match="errors of growing do not settle"):
        radarsim.solve(
            "sonar_smoothing", "sensor.sigma_range_m", wanted="sigma r in the long run", filter="growing", equals=9
        )


@pytest.mark.parametrize(("scans", "words"), [(15, "(35 s, not settled)"), (61, "(150 s)")])
def test_every_answer_of_solve_says_its_time_and_whether_the_filter_has_settled(scans, words):
    answer = radarsim.solve(
        *(MINE | {"scans": scans}, "radar.sigma_velocity_mps"), wanted="gain r", filter="r+Vr", equals=50
    )
    assert f"at the last scan {words}: 50 %" in answer.lines[1][1]


def test_an_exact_long_run_is_solved_once(monkeypatch):
    from radarsim.studies.range_doppler import long_run

    calls, steady = [], long_run.steady_sigma
    monkeypatch.setattr(long_run, "steady_sigma", lambda case: calls.append(case) or steady(case))
    objective.steady_sigma.cache_clear()
    radarsim.sensitivity(MINE, wanted="sigma r in the long run")
    assert len(calls) == len(set(calls))


@pytest.mark.slow
def test_a_sampled_gain_is_solved_where_a_further_quantity_has_no_column():
    answer = radarsim.solve(
        *("ambiguous_rls4", "radar.sigma_velocity_mps"),
        **{"wanted": "gain r", "filter": "no memory", "equals": 30, "between": (1, 3), "realisations": 60},
    )
    assert not answer.exact


def test_a_precision_of_the_long_run_extends_the_run_until_its_filters_have_settled(tmp_path):
    """The case that its config.yaml describes: the same σ at its last scan as Riccati's."""
    result = radarsim.run(
        MINE | {"name": "mine"},
        precision=20,
        of="sigma r in the long run",
        realisations=4000,
        out=tmp_path,
        figures=False,
    )
    last = result.curves[result.curves["component"] == "r"].groupby("filter").last().loc["r+Vr"]
    assert last["exact_sigma"] == pytest.approx(steady_sigma(0.8), rel=1e-6)
    assert last["k"] > MINE["scans"]
    written = load(str(tmp_path / "mine" / "config.yaml"))
    assert [case.spec for case in written.cases] == [case.spec for case in result.experiment.cases]
    assert result.facts["command"] == "radarsim run config.yaml"


def test_cases_of_a_long_run_last_equally_long():
    from radarsim.api.long_experiment import long_experiment, long_run_notes

    both = long_experiment(load(MINE | {"sweep": {"manoeuvre_variance": [1e-5, 1e-1]}}))
    (scans,) = {case.spec.scans for case in both.cases}
    assert both.content["include" if "include" in both.content else "scans"]
    assert long_run_notes([both]) == [
        f"{both.stem}: the long run is {scans} scans without a manoeuvre, to {2.5 * (scans - 1):g} s"
    ]


def test_the_exact_gain_of_a_config_needs_no_realisations():
    """Its baseline has none: that is no gap."""
    found = radarsim.sensitivity(MINE, wanted="gain r", realisations=2)
    assert found.table["exact"].all()
    assert found.without_estimate == ()


@pytest.mark.parametrize("verb", ["solve", "tune"])
def test_a_quantity_without_its_component_is_refused_with_those_there_are(verb):
    words = [SIGMA_V, "--equals", "3"] if verb == "solve" else []
    result = command(verb, "rls2", *words, "--for", "sigma", "--filter", "r", code=2)
    assert "--for: σ is of a component: name one, such as sigma r; there are: r, Vr, ar" in result.output
    values = ["sensor.sigma_range_m", "--equals", "3"] if verb == "solve" else []
    result = command(verb, "multimodel", *values, "--for", "probability", "--filter", "MMA2-11", "-n", "2", code=2)
    assert "name one, such as probability 1; there are: 1, 2" in result.output


def test_check_takes_a_phrase_too():
    assert "known from" in command("check", "rls2", "--precision", "1", "--for", "gain of Vr at the end").output
    outlook = radarsim.check(MINE, realisations=4000, precision=1, of="sigma r in the long run")
    assert outlook.cases[0].scans > MINE["scans"]


def test_a_long_run_is_never_shorter_than_the_config():
    """Keys may name scans of it, as the uses of a manoeuvre detector do."""
    from radarsim.studies import registry

    (case,) = load("plane_aspect").cases[:1]
    scans = registry.study(case.study).in_the_long_run(case).spec.scans
    assert scans >= case.spec.scans


def test_noise_is_common_at_the_same_scan_or_the_same_time():
    from radarsim.api.design.objective import have_common_noise

    assert have_common_noise({(15, 140.0), (15, 154.0)})  # a longer period
    assert have_common_noise({(25, 0.3), (21, 0.3)})  # other windows over the same burst
    assert not have_common_noise({(15, 140.0), (17, 160.0)})  # a longer run


PHRASES = (
    *("sigma r at 60 s", "worst sigma r", "mean sigma r from 60 s", "sigma r in the long run"),
    "gain of Vr at the end",
)
REFUSED = {  # what a command cannot answer, and what it says instead
    ("judge", "mean sigma r from 60 s"): "a judgement is about one scan",
    ("minimise", "sigma r in the long run"): "in the long run, without a manoeuvre, 0 is best",
    ("minimise", "gain of Vr at the end"): "must be an error, such as 'sigma Vr at the end'",
}


def ask(verb, phrase):
    """Ask a command for a phrase in the cheapest way that reads all of it."""
    from radarsim.api.design.tune import judged_point
    from radarsim.api.precision_target import asked_table, with_long_run

    if verb == "solve":
        radarsim.solve(BOAT, SIGMA_V, wanted=phrase, filter="r+Vr", equals=5, between=(0.5, 1.5))
    elif verb == "tune":
        radarsim.tune(BOAT, phrase, filter="r+Vr", free={"initial_scans": (2, 3)})
    elif verb == "sensitivity":
        radarsim.sensitivity(BOAT, wanted=phrase)
    elif verb == "judge":
        (experiment,), of = with_long_run([load(BOAT)], phrase)
        judged_point(experiment, of)
    elif verb == "minimise":
        load(BOAT, [f"manoeuvre_variance={{minimise: {phrase}}}"])
    else:
        (experiment,), of = with_long_run([load(BOAT)], phrase)
        asked_table(experiment.cases[0], of)


@pytest.mark.slow_cases("sensitivity-worst sigma r")
@pytest.mark.parametrize("phrase", PHRASES)
@pytest.mark.parametrize("verb", ["solve", "tune", "judge", "sensitivity", "run --precision", "minimise"])
def test_every_command_takes_every_phrase(verb, phrase):
    if (verb, phrase) in REFUSED:
        with pytest.raises(ConfigError, match=REFUSED[verb, phrase]):
            ask(verb, phrase)
    else:
        ask(verb, phrase)


def test_the_variance_that_minimises_at_a_time_is_the_one_that_tune_finds():
    (case,) = load(BOAT, ["manoeuvre_variance={minimise: sigma r at 80 s}"]).cases
    from radarsim.studies.range_doppler.designed_case import design_case

    tuned = radarsim.tune(BOAT, "sigma r at 80 s", filter="r+Vr").keys[0]
    assert tuned.lo < design_case(case).variances[1] < tuned.hi


@pytest.mark.slow
def test_a_judgement_of_the_long_run_is_about_a_run_until_it_has_settled():
    result = radarsim.judge(MINE, lambda plots: plots["range_m"], wanted="sigma r in the long run", realisations=200)
    last_s = result.curves["t_s"].max()
    assert last_s > 2.5 * MINE["scans"]
    assert f"in r at {last_s:g} s" in result.answer[0]
    assert any("without a manoeuvre" in line for line in result.warnings)
