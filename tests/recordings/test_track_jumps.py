"""Jumps and alternations of recorded tracks, which end `track`'s advice and are refused by `fit`."""

import numpy as np
import pytest

from radarsim.api import load_experiments
from radarsim.errors import ConfigError
from radarsim.recordings import track as recordings_track
from radarsim.recordings.fit import advice
from radarsim.recordings.fit.fit import fit_plots
from radarsim.recordings.track_jumps import column_fault

N = 60


def course(speed_mps=95.0, first_m=30_000.0, seed=1, rows=N):
    rng = np.random.default_rng(seed)
    t = 4.0 * np.arange(rows)
    return t, first_m + speed_mps * t + rng.normal(0, 60, rows), speed_mps + rng.normal(0, 1, rows)


def faulty(kind):
    """Times, ranges and velocities of a recording with a fault."""
    t, r, v = course(speed_mps=12.0, first_m=8000.0) if kind == "boat" else course()
    if kind == "sensors":
        t, r, v = np.sort([*t, *(t + 1)]), np.stack([r, r + 5000], axis=1).ravel(), np.repeat(v, 2)
    elif kind == "counter":
        r = r % 32_768
    else:
        r = np.where(t < 120, r, r / {"km": 1000, "boat": 1000, "miles": 1852, "feet": 0.3048}[kind])
    return t, r, v


def write_plots(path, t, r, v, track=""):
    head, cell = (",track", f",{track}") if track else ("", "")
    rows = (f"{a}{cell},{b:.2f},{c:.3f}" for a, b, c in zip(t, r, v, strict=True))
    path.write_text("\n".join([f"t_s{head},range_m,velocity_mps", *rows]))
    return path


@pytest.mark.parametrize("track", ["", "7"])
@pytest.mark.parametrize("kind", ["km", "boat", "miles", "feet", "counter", "sensors"])
def test_track_and_fit_name_what_no_target_does(tmp_path, kind, track):
    path = write_plots(tmp_path / "plots.csv", *faulty(kind), track)
    (experiment,) = load_experiments.load_all(["rls2"], ("radar.scan_period_s=4",))
    named = {"sensors": f"the rows{' of track 7' * bool(track)} alternate between two places"}.get(
        kind, f"positions jump as no target does (rows: 1), first{' in track 7' * bool(track)} from"
    )
    advised = advice.advise(recordings_track.track_plots(experiment, path))
    assert advised.findings == []
    assert advised.course_fault.message().startswith(named)
    with pytest.raises(ConfigError) as caught:
        fit_plots(experiment, path)
    assert caught.value.lines[0].startswith(f"{path}: {named}")


@pytest.mark.parametrize("share", [0.01, 0.1])
@pytest.mark.parametrize("size_m", [600, 6e3, 6e4, 6e6])
def test_outliers_are_no_jumps(share, size_m):
    """Nor a target that turns, or irregular times."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t, r, _ = course(speed_mps=rng.uniform(-100, 250), seed=seed, rows=200)
        is_seen, is_wild = rng.random(t.size) < 0.8, rng.random(t.size) < share
        r = np.abs(r + is_wild * rng.choice([-size_m, size_m], t.size) * rng.random(t.size)) + 1
        t = t + rng.uniform(0, 3.9, t.size) * (seed % 2)
        assert column_fault({"": [{"t_s": t[is_seen], "range_m": r[is_seen]}]}) is None


@pytest.mark.parametrize("kind", ["plain", "sparse", "bearings"])
@pytest.mark.parametrize("size_m", [-12e3, 2e3, 5e3])
def test_a_zero_that_changes_is_named_for_all_sizes(kind, size_m):
    """Far faster than it and far slower, and where bearings tell the place."""
    for seed in range(10):
        t, r, _ = course(speed_mps=(-250, -20, 95)[seed % 3], first_m=120e3, seed=seed)
        if kind == "sparse":
            t = t + 4.0 * np.arange(N)
        columns = {"t_s": t, "range_m": r + size_m * (t >= t[N // 2])}
        if kind == "bearings":
            columns |= {"bearing_rad": 1.0 + np.random.default_rng(seed).normal(0, 1e-3, N)}
        fault = column_fault({"": [columns]})
        assert [jump.t_s for jump in fault.jumps] == [t[N // 2]], seed


@pytest.mark.parametrize("kind", ["turn", "passes", "cells"])
def test_what_a_target_does_is_no_change_of_zero(kind):
    """A turn of 5 g between plots and over several, a target that passes near, and cells of 300 m."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = 10.0 * np.arange(N) + rng.uniform(0, 10)
        speed, radius = 300.0, 300.0**2 / 50 * rng.uniform(1, 5)
        angle = np.clip((t - 300) * speed / radius, 0, rng.uniform(0.3, 2 * np.pi))
        x = 60e3 - speed * np.minimum(t - 300, 0) + radius * np.sin(angle)
        y = rng.uniform(-30e3, 30e3) - radius * (1 - np.cos(angle))
        after_s = np.maximum(t - 300 - angle.max() * radius / speed, 0) * speed
        x, y = x + after_s * np.cos(angle.max()), y - after_s * np.sin(angle.max())
        if kind == "passes":
            x, y = 250 * (t - 290), np.full(N, rng.uniform(100, 5000))
        r = np.hypot(x, y) + rng.normal(0, 60, N)
        r = 300 * np.round(r / 300) if kind == "cells" else r
        columns = {"t_s": t, "range_m": r} | ({"bearing_rad": np.arctan2(y, x)} if seed % 2 else {})
        assert column_fault({"": [columns]}) is None, seed


@pytest.mark.parametrize("shift_m", [400, 1500, 6000])
def test_two_sensors_of_another_zero_are_named_though_the_target_moves_farther(shift_m):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        t, r, _ = course(speed_mps=(-250, 200)[seed % 2], first_m=120e3, seed=seed)
        t = t + (3 * (np.arange(N) % 2) if seed % 3 else rng.uniform(0, 2, N))
        r = r + (t - 4.0 * np.arange(N)) * (-250, 200)[seed % 2]
        columns = {"t_s": t, "range_m": r + shift_m * (np.arange(N) % 2)}
        assert abs(column_fault({"": [columns]}).alternation.distance_m - shift_m) < 0.25 * shift_m
        noise = {"t_s": t, "range_m": 30e3 + rng.standard_t(2, N) * shift_m}
        assert column_fault({"": [noise]}) is None


def manoeuvre(kind, scan_s, speed_mps, rng):
    """Ranges of a target that turns at 9 g after half of the recording: a loop, or aside and back within a scan."""
    step_s = 0.02
    t = np.arange(round(N * scan_s / step_s)) * step_s
    rate, begin_s = 9 * 9.81 / speed_mps, scan_s * (N // 2 + (rng.uniform() if kind == "loop" else 0.0))
    duration_s = 2 * np.pi / rate if kind == "loop" else rng.uniform(0.4, 0.5) * scan_s
    is_turn, is_back = (np.abs(t - begin_s - (k + 0.5) * duration_s) < duration_s / 2 for k in range(2))
    heading = rng.uniform(0, 2 * np.pi) + rate * step_s * np.cumsum(is_turn - 1.0 * is_back * (kind == "aside"))
    x, y = (np.cumsum(f(heading)) * speed_mps * step_s for f in (np.cos, np.sin))
    rows = np.arange(N) * round(scan_s / step_s)
    return t[rows], np.hypot(80e3 + x[rows], y[rows]) + rng.normal(0, 30, N)


@pytest.mark.parametrize(("kind", "scan_s", "speed_mps"), [("aside", 10, 300), ("aside", 12, 600), ("loop", 10, 150)])
def test_a_turn_of_9_g_by_ranges_alone_is_no_change_of_zero(kind, scan_s, speed_mps):
    for seed in range(40):
        t, r = manoeuvre(kind, scan_s, speed_mps, np.random.default_rng(seed))
        assert column_fault({"": [{"t_s": t, "range_m": r}]}) is None, seed


def test_a_slow_target_does_not_change_its_range_by_kilometres_within_a_scan():
    """Half a minute is long enough for a fast one."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        t = 30.0 * np.arange(N)
        r = 20e3 + rng.uniform(-10, 10) * t + rng.normal(0, 20, N) + 2000 * (t >= t[N // 2])
        fault = column_fault({"": [{"t_s": t, "range_m": r}]})
        assert [jump.t_s for jump in fault.jumps] == [t[N // 2]], seed


@pytest.mark.parametrize("track", ["", "7"])
def test_track_and_fit_name_a_clock_that_was_set_forward(tmp_path, track):
    """A gap of over a minute gives the track another name."""
    t, r, v = course()
    (experiment,) = load_experiments.load_all(["rls2"], ("radar.scan_period_s=4",))
    path = write_plots(tmp_path / "plots.csv", t + 3600 * (t >= 120), r, v, track)
    named = "the clock was set forward by 3600 s at 116 s, as the targets go on from where they were: radarsim import"
    advised = advice.advise(recordings_track.track_plots(experiment, path))
    assert advised.course_fault.message().startswith(named)
    with pytest.raises(ConfigError) as caught:
        fit_plots(experiment, path)
    assert caught.value.lines[0].startswith(f"{path}: {named}")
    path = write_plots(tmp_path / "gap.csv", t + 3600 * (t >= 120), r + 95 * 3600 * (t >= 120), v, track)
    assert advice.advise(recordings_track.track_plots(experiment, path)).course_fault is None


def test_track_and_fit_name_the_track_whose_velocities_have_the_other_sign(tmp_path):
    (experiment,) = load_experiments.load_all(["rls2"], ("radar.scan_period_s=4",))
    t, r, v = course()
    _, other, w = course(speed_mps=-120.0, first_m=90_000.0, seed=2)
    rows = [f"{a},1,{b:.2f},{c:.3f}\n{a},2,{d:.2f},{-e:.3f}" for a, b, c, d, e in zip(t, r, v, other, w, strict=True)]
    path = tmp_path / "plots.csv"
    path.write_text("\n".join(["t_s,track,range_m,velocity_mps", *rows]))
    named = "in track 2 alone: the velocities have the opposite sign of the change of the range"
    (message,) = advice.advise(recordings_track.track_plots(experiment, path)).velocity_faults
    assert message.startswith(named)
    with pytest.raises(ConfigError, match=named):
        fit_plots(experiment, path)
