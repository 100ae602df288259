"""Velocities that are folded: noticed by `track`, `fit` and `import`, with the command that unfolds them."""

import re
import shlex

import numpy as np
import pytest

from radarsim.api.load_experiments import load_all
from radarsim.recordings import csv_output, simulate_plots, study_part, track
from radarsim.recordings.fit.folded_doppler import SPAN_SEARCH_STEPS, detect_folding, folding_message
from radarsim.recordings.fit.velocity_faults import VelocityFault, detect_velocity_fault
from radarsim.recordings.print_results import print_track
from radarsim.recordings.report.innovation_tests import FITS, FOLD_LOST, MAYBE_TOO_SMALL, innovation_tests
from tests.program import Terminal, command
from tests.tolerances import Z, mean_error

SPAN = 60.0  # m/s: 0.1 m at 1.2 kHz
RADAR = {"sigma_range_m": 60, "sigma_velocity_mps": 3, "scan_period_s": 4, "detection_probability": 0.9}
KNOWING = ("radar.wavelength_m=0.1", "radar.repetition_rate_hz=1200")
SCENARIOS = ("polynomial", "turn", "fly_by", "acceleration_start", "jerk_pulse")


def loaded(*overrides, config="rls2", radar=RADAR):
    (one,) = load_all([config], (*(f"radar.{key}={value}" for key, value in radar.items()), *overrides))
    return one


def measured(config, realisation=0):
    columns = simulate_plots.simulate_realisation(config, realisation)
    return {name: columns[name] for name in ("t_s", "range_m", "velocity_mps")}


def folded(columns, span=SPAN):
    """The velocities that a radar measures that is ambiguous by a span."""
    v = columns["velocity_mps"]
    return columns | {"velocity_mps": v - span * np.round(v / span)}


@pytest.fixture(scope="module")
def flown():
    """148 plots of an approach at 250 m/s, one in ten missed."""
    return measured(loaded("scans=148", "target={kind: polynomial, coefficients: [200e3, -250]}"))


def options(*overrides):
    return [part for one in (*(f"radar.{key}={value}" for key, value in RADAR.items()), *overrides)
            for part in ("--set", one)]  # fmt: skip


@pytest.mark.parametrize("span", [SPAN, None, 20.0], ids=["known", "not known", "known wrongly"])
def test_the_span_is_that_of_the_config_or_of_the_plots(flown, span):
    found = detect_folding([folded(flown)], span)
    assert found.is_configured == (span == SPAN)
    assert found.velocity_mps <= SPAN / 2
    assert 240 < found.rate_mps < 280
    # 250 m/s is four spans off: a span of 240 m/s, or a whole part of it.
    whole = found.span_mps / SPAN
    # The mean phase of velocities of σ 3 m/s less rates as good; spans are tried in steps of a 200th of a turn.
    phase = mean_error(0.9 * 148, 3 * np.sqrt(2) / SPAN, z=3) + 1 / (2 * SPAN_SEARCH_STEPS)
    assert whole == pytest.approx(round(whole), rel=0, abs=phase)


def test_track_and_fit_notice_folded_velocities(flown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    csv_output.write_columns(folded(flown), "folded.csv")
    for config, span in (
        (options(*KNOWING), "the config's unambiguous interval is 60.0 m/s"),
        (options(), "the plots suggest an unambiguous interval of"),
    ):
        text = command("track", "rls2", "folded.csv", "-o", "track.csv", *config).stdout
        assert "the velocities are folded: none is beyond ±" in text
        assert span in text
        assert "advice   --set" not in text
        told = command("fit", "rls2", "folded.csv", *config, code=2)
        assert span in told.stderr
        assert "to use the fitted values" not in told.output
    # A filter of ranges alone has no folds.
    assert "to use the fitted values" in command("fit", "rls2", "folded.csv", "--filter", "r", *options()).stdout


@pytest.mark.parametrize("known", [KNOWING, KNOWING[:1]], ids=["rate known", "rate not known"])
def test_the_settings_that_are_named_unfold_them(flown, tmp_path, monkeypatch, known):
    monkeypatch.chdir(tmp_path)
    csv_output.write_columns({name: column[:40] for name, column in folded(flown).items()}, "folded.csv")
    words = ["track", "rls2", "folded.csv", "-o", "track.csv", *options(*known)]
    (settings,) = re.findall(r"the same command with (.*)$", command(*words).stdout, re.M)
    assert ("repetition_rate_hz" in settings) == (known != KNOWING)
    command(*words, *shlex.split(settings), "-q")
    rows = [line.split(",") for line in (tmp_path / "track.csv").read_text().splitlines()]
    *_, (last, sigma) = (map(float, row[4:6]) for row in rows if row[1:3] == ["r+Vr", "Vr"])
    assert last == pytest.approx(-250, rel=0, abs=Z * sigma)  # and not 10


def test_of_what_cannot_be_carried_over_no_settings_are_named(flown):
    (one,) = loaded("radar.bias_range_m=3").cases
    message = folding_message(detect_folding([folded(flown)], SPAN), one)
    assert message.endswith("the config's unambiguous interval is 60.0 m/s")


def test_a_filter_that_lost_its_fold_is_not_taken_for_inaccurate_plots(tmp_path, monkeypatch):
    """The nearest fold of realisation 0 is wrong; beside filters that fit it is known, alone it is one of three."""
    monkeypatch.setenv("COLUMNS", "80")
    (config,) = load_all(["ambiguous_rls2"])
    csv_output.write_columns(simulate_plots.simulate_realisation(config), tmp_path / "plots.csv")
    found = track.track_plots(config, tmp_path / "plots.csv")
    verdicts = {one.filter: one.verdict for one in innovation_tests(found) if one.tests}
    assert verdicts.pop("nearest fold") == FOLD_LOST
    assert set(verdicts.values()) == {FITS}
    for stderr in (False, True):
        screens = {name: Terminal() for name in ("stdout", "stderr")}
        for name, screen in screens.items():
            monkeypatch.setattr(f"sys.{name}", screen)
        print_track(found, innovation_tests(found), None, stderr)
        own, other = (screens[name].getvalue() for name in (("stderr", "stdout") if stderr else ("stdout", "stderr")))
        assert other == ""
        lines = [re.sub(r"\x1b\[\d*m", "", line) for line in own.splitlines()]
        assert max(map(len, lines)) <= 80
        assert any(re.fullmatch(r" nearest fold +range_m +14 +93 +0\.401 +1\.87 +fold lost", line) for line in lines)
    lone = "filters=[{name: nearest, doppler: folded, manoeuvre_variance: 1e-3, hypotheses: 1}]"
    (config,) = load_all(["ambiguous_rls2"], (lone,))
    (one, *_) = innovation_tests(track.track_plots(config, tmp_path / "plots.csv"))
    assert one.verdict == MAYBE_TOO_SMALL


def test_import_notices_them_where_the_recording_does_not_say_by_what(flown, tmp_path):
    rows = [",".join(["time,range_m,doppler_mps,track"])]
    for t, r, v in zip(*folded(flown).values(), strict=True):
        rows += [f"{t},{r},{v},a"] if np.isfinite(r) else []
    (tmp_path / "log.csv").write_text("\n".join(rows))
    told = command("import", tmp_path / "log.csv", "-o", tmp_path / "plots.csv").stderr
    assert "the velocities are folded" in told
    assert "`radarsim track` names the settings" in told
    spans = [f"{rows[0]},span", *(f"{row},{SPAN}" for row in rows[1:])]
    (tmp_path / "spans.csv").write_text("\n".join(spans))
    assert "are folded" not in command("import", tmp_path / "spans.csv", "-o", tmp_path / "two.csv").stderr


def test_velocities_of_the_other_sign_are_not_taken_for_folded(flown):
    assert detect_folding([flown | {"velocity_mps": -flown["velocity_mps"]}]) is None


BOAT = {"D": 19.2, "scans": 61, "period_s": 2.5}  # of an X-band radar at 1.2 kHz


def boat(spans, seed, turned=False):
    """Plots of a boat that comes at so many spans of speed, 15 % missed; turned: of the other sign and not folded."""
    rng, D = np.random.default_rng(seed), BOAT["D"]
    t = BOAT["period_s"] * np.flatnonzero(rng.random(BOAT["scans"]) < 0.85)
    v = -spans * D + rng.normal(0, 0.8, t.size)
    r = 8000 - spans * D * t + rng.normal(0, 15, t.size)
    return {"t_s": t, "range_m": r, "velocity_mps": -v if turned else v - D * np.round(v / D)}


@pytest.mark.parametrize("spans", [0.55, 0.6, 0.7, 0.75, 0.9, 1.0, 1.5, 2.0, 5.0])
def test_a_fold_at_any_speed_is_noticed_and_taken_for_no_turned_sign(spans):
    """In 10 of 10, with the span known; without it the sign explains what is folded by nearly twice the speed."""
    recordings = [boat(spans, seed) for seed in range(10)]
    assert all(detect_folding([columns], BOAT["D"]) for columns in recordings)
    if spans >= 0.6:
        assert all(detect_folding([columns]) for columns in recordings)


@pytest.mark.parametrize("velocity_mps", [0.0, 0.004])
@pytest.mark.parametrize("spans", [1, 2, 5])
def test_velocities_of_next_to_nothing_are_folded_by_whole_spans_or_none(spans, velocity_mps):
    """An aircraft that shows 0, all of its plots: the span is the rate of the range, or a whole part of it."""
    t, rng = 4.0 * np.arange(60), np.random.default_rng(spans)
    aircraft = {"t_s": t, "range_m": 50e3 + 75.0 * spans * t + rng.normal(0, 60, 60),
                "velocity_mps": np.full(60, velocity_mps)}  # fmt: skip
    fault = detect_velocity_fault([aircraft])
    assert 60 < fault.folding.rate_mps / spans < 90
    assert "or they are no radial velocities in m/s" in folding_message(fault.folding)
    assert detect_velocity_fault([aircraft], 75.0).folding.is_configured


@pytest.mark.slow
@pytest.mark.parametrize(
    "spans", [0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0]
)
def test_a_fold_is_noticed_in_40_of_40(spans):
    """With the span of the config and without."""
    for seed in range(40):
        columns = boat(spans, seed)
        assert detect_velocity_fault([columns], BOAT["D"]).folding is not None
        assert detect_velocity_fault([columns]).folding is not None


def sound(seed):
    """A recording without folds: of any speed, accuracy and rate, rounded or not; and a span that holds, or none."""
    rng = np.random.default_rng(seed)
    t = rng.choice([1, 2.5, 4, 10]) * np.flatnonzero(rng.random(rng.choice([12, 30, 60, 150])) < 0.9)
    speed, acceleration = (
        rng.choice([0, 0.3, 1, 3, 8, 20, 60, 150, 250]) * rng.choice([-1, 1]),
        rng.choice([0, 0, 0.05, -0.3]),
    )
    v = speed + acceleration * t + rng.normal(0, rng.choice([0.05, 0.5, 3, 15]), t.size)
    step = rng.choice([0, 0, 0.5, 1])
    r = 50e3 + speed * t + acceleration * t**2 / 2 + rng.normal(0, rng.choice([1, 15, 60, 250]), t.size)
    columns = {"t_s": t, "range_m": r, "velocity_mps": step * np.round(v / step) if step else v}
    return columns, rng.choice([None, 4 * max(np.abs(v).max(), 1.0)])


@pytest.mark.parametrize("first", [0, pytest.param(20, marks=pytest.mark.slow)])
def test_sound_velocities_of_any_accuracy_are_not_noticed(first):
    """20 of them, and 980 more."""
    for seed in range(first, 1000 if first else 20):
        columns, span = sound(seed)
        assert detect_velocity_fault([columns], span) == VelocityFault()


@pytest.mark.parametrize("spans", [0.1, 0.3, 0.45])
def test_a_turned_sign_is_no_fold(spans):
    for span in (BOAT["D"], None):
        assert not any(detect_folding([boat(spans, seed, turned=True)], span) for seed in range(10))


@pytest.mark.parametrize("size_m", [600.0, 60e3, 6e6])
def test_wrong_ranges_are_no_folds(flown, size_m):
    wild = np.random.default_rng(1).random(len(flown["t_s"])) < 0.1
    assert detect_folding([flown | {"range_m": flown["range_m"] + size_m * wild}]) is None


def noticed(config, realisations, span, fold):
    """Of how many realisations the velocities are said to be folded."""
    seen = (measured(config, i) for i in range(realisations))
    return sum(detect_folding([folded(one, span) if fold else one], span) is not None for one in seen)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_unfolded_velocities_are_not_noticed(scenario):
    config = loaded(f"target={scenario}", radar={})
    assert noticed(config, 5, 75.0, fold=False) == 0


@pytest.mark.slow
@pytest.mark.parametrize("radar", range(1, 6))
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_no_unfolded_recording_of_any_shipped_target_is_noticed(scenario, radar):
    """Of 100 each, with the span of the config and without."""
    config = loaded(f"target={scenario}", config=f"rls{radar}", radar={})
    span = config.cases[0].spec.radar.wavelength_m * 500
    for known in (span, None):
        assert noticed(config, 100, known, fold=False) == 0


@pytest.mark.slow
def test_folded_velocities_are_noticed_in_99_of_100():
    """60 scans of RLS 2 at 1 kHz, whose σ of velocity is a fifth of the span."""
    config = loaded("scans=60", "target={kind: polynomial, coefficients: [200e3, 250]}", radar={})
    assert noticed(config, 100, 75.0, fold=True) >= 99


def test_a_remainder_needs_no_range():
    """Of two velocities it is known without either's range; as measured, it would be wrong by whole spans."""
    slow = "target={kind: random_polynomial, range_m: 2e5, sigma_velocity_mps: 15, sigma_acceleration_mps2: 0.05}"
    (one,) = load_all(["ambiguous_turns"], ("radar.sigma_velocity_mps=0.1", slow))
    case = one.cases[0]
    columns = dict(study_part.recording_interface(case).simulated(case, 0))
    columns["range_m"][7] = np.nan
    measured = {name: column for name, column in columns.items() if not name.startswith("true_")}
    track = study_part.recording_interface(case).tracker(case).feed(measured)
    found, true = track.estimate[track.filters.index("remainder"), 2:, 1], columns["true_Vr_mps"][2:]
    assert abs(columns["velocity_mps"][7] - columns["true_Vr_mps"][7]) > 14
    np.testing.assert_allclose(found, true, rtol=0, atol=Z * 0.1)  # a velocity's σ
