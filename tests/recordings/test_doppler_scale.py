"""Velocities in another unit, or of the other sign, are told by the ranges of the same plots."""

import numpy as np
import pytest

import radarsim
from radarsim.errors import ConfigError
from radarsim.recordings.doppler_scale import DopplerScale, detect_doppler_scale, doppler_scale_message
from radarsim.recordings.fit.folded_doppler import folding_message
from radarsim.recordings.fit.velocity_faults import detect_velocity_fault
from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.time_spans import TimeSpan, meeting_text
from tests.recordings.formats.example_files import imported

KNOT_MPS = 1852 / 3600


def recording(kind, speed_mps, multiple, seed, rows=60, sigma_m=30.0, sigma_mps=1.0):
    """Plots every 4 s of a target that flies straight away, past, or in a turn; velocities are a multiple of the
    rates."""
    rng, t = np.random.default_rng(seed), 4.0 * np.arange(rows)
    course = {"away": np.zeros(rows), "turn": np.clip(t - 60, 0, 120) * 0.02, "past": np.zeros(rows)}[kind]
    if kind == "past":
        x = speed_mps * (t - t[-1] / 2)
        r, v = np.hypot(x, 9000.0), speed_mps * x / np.hypot(x, 9000.0)
    else:
        v = speed_mps * np.cos(course)
        r = 20_000 + np.concatenate([[0.0], np.cumsum(2.0 * (v[1:] + v[:-1]))])
    velocity = multiple * (v + rng.normal(0, sigma_mps, rows))
    return {"t_s": t, "range_m": r + rng.normal(0, sigma_m, rows), "velocity_mps": velocity}


@pytest.mark.parametrize("kind", ["away", "past", "turn"])
@pytest.mark.parametrize(
    ("multiple", "cause"),
    [
        (1 / KNOT_MPS, "in knots"), (3.6, "in km/h"), (KNOT_MPS, "not in knots"), (1e3, "thousand times smaller"),
        (1e6, "in µs"), (-1.0, "opposite sign"), (-3.6, "in km/h"), (1 / 0.3048, "feet per second"),
    ],
)  # fmt: skip
def test_the_multiple_names_the_unit(kind, multiple, cause):
    for seed in range(5):
        scale = detect_doppler_scale([recording(kind, 150.0, multiple, seed)])
        assert scale is not None
        message = doppler_scale_message(scale)
        assert cause in message
        assert ("--doppler-towards" in message) == (multiple < 0)
        assert " or " not in message.partition("smaller")[0].replace("or without", "")


def lost_sign_tracks(kind, seed):
    """Sizes of the velocities of one that passes, or of two that come and go."""
    if kind == "past":
        tracks = [recording("past", 150.0, 1.0, seed)]
    else:
        tracks = [recording("away", speed, 1.0, seed + k) for k, speed in enumerate((120.0, -80.0))]
    return [track | {"velocity_mps": np.abs(track["velocity_mps"])} for track in tracks]


@pytest.mark.parametrize("kind", ["past", "two"])
def test_velocities_without_sign_are_not_taken_for_folded(kind):
    for seed in range(10):
        tracks = lost_sign_tracks(kind, seed)
        fault = detect_velocity_fault(tracks)
        assert fault.folding is None
        assert "one sign where the ranges rise and where they fall" in doppler_scale_message(fault.scale)
        towards = [track | {"velocity_mps": -track["velocity_mps"]} for track in tracks]
        assert detect_velocity_fault(towards).scale == fault.scale
        signed = recording("past", 150.0, 1.0, seed)
        folded = signed | {"velocity_mps": np.mod(signed["velocity_mps"], 70.0)}
        for track in (signed, folded):
            assert "one sign" not in doppler_scale_message(
                detect_velocity_fault([track]).scale or DopplerScale(2, 0, ())
            )


def test_sound_and_folded_velocities_are_left_alone():
    """Of any speed, σ, interval and course; and of constant speeds folded into 19.2 m/s."""
    rng = np.random.default_rng(7)
    for seed in range(300):
        kind, rows = ("away", "past", "turn")[seed % 3], int(rng.integers(20, 150))
        plots = recording(kind, 10 ** rng.uniform(-1, 2.5), 1.0, seed, rows, 10 ** rng.uniform(0, 2.6),
                          10 ** rng.uniform(-1, 1.3))  # fmt: skip
        assert detect_doppler_scale([plots]) is None
    for speed in (11.0, 12.0, 14.0, 15.0, 18.0, 22.0, 28.0, 40.0):
        for seed in range(8):
            plots = recording("away", -speed, 1.0, seed, sigma_m=15.0, sigma_mps=0.8)
            plots["velocity_mps"] = (plots["velocity_mps"] + 9.6) % 19.2 - 9.6
            assert detect_velocity_fault([plots], 19.2).folding is not None


def test_a_constant_speed_by_which_two_causes_fit_is_told_with_both():
    """Ranges in feet: 120 m/s is 394 ft/s less a span of 274."""
    plots = recording("away", 120.0, 1.0, 4) | {}
    plots["range_m"] = plots["range_m"] / 0.3048
    fault = detect_velocity_fault([plots])
    assert fault.scale is None
    assert "; or the ranges are in feet, not in m" in folding_message(fault.folding)
    # A turn tells them apart, whatever span a config states.
    plots = recording("turn", 120.0, 1.0, 4)
    plots["range_m"] = plots["range_m"] / 0.3048
    assert detect_velocity_fault([plots], 1e3).scale.causes == ("the ranges are in feet, not in m",)


def test_folds_by_the_stated_span_are_no_other_unit():
    """A turning boat, whose course makes V - D a third of V for a while."""
    for seed in range(12):
        plots = recording("turn", 14.4, 1.0, seed, sigma_m=15.0, sigma_mps=0.8)
        plots["velocity_mps"] = (plots["velocity_mps"] + 9.6) % 19.2 - 9.6
        assert detect_velocity_fault([plots], 19.2).folding is not None


@pytest.mark.parametrize("per_second", [10.0, 100.0, 128.0, 1e3])
def test_times_in_a_smaller_unit_are_told_though_they_make_long_gaps(per_second):
    plots = recording("past", 230.0, 1.0, 5)
    scale = detect_doppler_scale([plots | {"t_s": per_second * plots["t_s"]}])
    assert scale is not None
    assert scale.multiple == pytest.approx(per_second, rel=0.02)


def test_wild_plots_do_not_hide_the_unit():
    plots = recording("away", 150.0, 3.6, 1)
    plots["range_m"][[3, 30, 31]] += [60e3, -9e3, 600e3]
    scale = detect_doppler_scale([plots])
    assert scale is not None
    assert scale.multiple == pytest.approx(3.6, rel=0.01)


def test_import_tells_the_unit(tmp_path):
    plots = recording("away", 120.0, 1 / KNOT_MPS, 2)
    text = "Time,Track,Range [m],Radial velocity\n" + "".join(
        f"{t},7,{r:.1f},{v:.2f}\n" for t, r, v in zip(*plots.values(), strict=True)
    )
    done, *_ = imported(tmp_path, text.encode())
    expected = ": they are in knots (--column velocity_kn=NAME)"
    assert [expected in note for note in done.notes] == [False, True]
    (tmp_path / "plots.csv").unlink()
    done, columns, _ = imported(tmp_path, text.encode(), Options(columns={"velocity_kn": "Radial velocity"}))
    assert done.notes == []
    assert np.median(columns["velocity_mps"]) == pytest.approx(120.0, rel=0, abs=1.0)


@pytest.mark.parametrize(("multiple", "expected"), [(-1.0, "opposite sign"), (3.6, "in km/h")])
def test_fit_and_track_ask_before_they_advise(tmp_path, multiple, expected, capsys):
    plots = recording("away", 120.0, multiple, 3)
    path = tmp_path / "plots.csv"
    path.write_text(
        "t_s,range_m,velocity_mps\n" + "".join(f"{t},{r},{v}\n" for t, r, v in zip(*plots.values(), strict=True))
    )
    with pytest.raises(ConfigError, match=expected):
        radarsim.fit("rls2", str(path))
    fitted = radarsim.fit("rls2", str(path), filter="r")  # the ranges are sound
    assert fitted["key"].tolist() == ["radar.sigma_range_m", "manoeuvre_variance"]
    from radarsim.cli.command_group import main

    main(["track", "rls2", str(path), "-o", str(tmp_path / "track.csv")], standalone_mode=False)
    advice = [line for line in capsys.readouterr().out.splitlines() if line.startswith("advice")]
    assert len(advice) == 1
    assert expected in advice[0]


def test_impossible_speeds_are_told_before_advice(tmp_path):
    """A recording whose times are in hours."""
    plots = recording("away", 120.0, 1.0, 3)
    path = tmp_path / "plots.csv"
    path.write_text(
        "t_s,range_m,velocity_mps\n" + "".join(f"{t / 3600},{r},{v}\n" for t, r, v in zip(*plots.values(), strict=True))
    )
    with pytest.raises(ConfigError, match="if they are in hours"):
        radarsim.fit("rls2", str(path))


DAY = 1_795_824_000.0  # 28 November 2026


@pytest.mark.parametrize(
    ("positions", "expected"),
    [
        ((DAY + 3600, DAY + 4100), "they meet if the positions are 1 h earlier (another time zone)"),
        ((DAY - 1024 * 604_800.0, DAY - 1024 * 604_800.0 + 500), "they meet if the positions are 1024 weeks later"),
        ((DAY + 1e7, DAY + 1e7 + 9), ": they do not meet"),
        ((DAY + 200, DAY + 900), ""),
        ((86_300.0, 86_390.0), "they do not meet"),
        ((7300.0, 7400.0), "they meet if the positions are 2 h earlier"),
    ],
)
def test_spans_that_do_not_meet_are_shown(positions, expected):
    text = meeting_text(TimeSpan(DAY, DAY + 480), TimeSpan(*positions))
    assert expected in text
    assert ("the plots are from 2026-11-28 00:00:00 to 00:08:00" in text) == bool(expected)


@pytest.mark.parametrize("name", ["a range that stands", "an angle for a velocity"])
def test_velocities_of_another_column_are_told(name):
    t, rng = 4.0 * np.arange(60), np.random.default_rng(5)
    moving = 20e3 + 120 * t + rng.normal(0, 30, 60)
    range_m, velocity = {
        "a range that stands": (120e3 + rng.normal(0, 800, 60), moving / 1000),
        "an angle for a velocity": (20e3 - 12 * t + rng.normal(0, 30, 60), 200 + 0.1 * t + rng.normal(0, 0.5, 60)),
    }[name]
    fault = detect_velocity_fault([{"t_s": t, "range_m": range_m, "velocity_mps": velocity}])
    message = doppler_scale_message(fault.scale)
    assert "a column may be swapped" in message or message.endswith("or a column is swapped")
