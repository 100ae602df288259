"""Velocities that stand for none, as -999, in plots given to `track` and `fit` without `import`."""

import numpy as np
import pytest

from radarsim.api import load_experiments
from radarsim.recordings import track as recordings_track
from radarsim.recordings.fit.fit import fit_plots
from radarsim.recordings.report import sentences

N = 60
FILLED = "velocities that stand for none, as 0 or -999 among others: {} of {}; they are left out"


def write_plots(path, fills, tracks=("",)):
    """Plots of targets that leave at 95 m/s, with some of the velocities as texts, '' for none."""
    rows = []
    for k, track in enumerate(tracks):
        rng = np.random.default_rng(k)
        t = 10.0 * np.arange(N)
        r = 30_000 + 95 * t + rng.normal(0, 250, N)
        v = [fills.get(i, f"{95 + rng.normal(0, 15):.3f}") for i in range(N)]
        rows += [(a, f"{a},{track},{b:.2f},{c}") for a, b, c in zip(t, r, v, strict=True)]
    header = "t_s,track,range_m,velocity_mps" if any(tracks) else "t_s,none,range_m,velocity_mps"
    path.write_text("\n".join([header, *(text for _, text in sorted(rows, key=lambda row: row[0]))]))
    return path


def tracked(experiment, path):
    estimates = []
    followed = recordings_track.track_plots(experiment, path, lambda track, name: estimates.append(track.estimate))
    return followed, estimates


@pytest.mark.parametrize("tracks", [("",), ("a", "b")])
@pytest.mark.parametrize("fill", ["0", "-999", "9999", "-327.68"])
def test_they_are_read_as_empty_cells(tmp_path, fill, tracks):
    (experiment,) = load_experiments.load_all(["rls2"])
    rows = range(0, N, 4)
    filled = write_plots(tmp_path / "filled.csv", dict.fromkeys(rows, fill), tracks)
    empty = write_plots(tmp_path / "empty.csv", dict.fromkeys(rows, ""), tracks)
    (followed, estimates), (_, expected) = tracked(experiment, filled), tracked(experiment, empty)
    for estimate, other in zip(estimates, expected, strict=True):
        np.testing.assert_array_equal(estimate, other)
    count = len(rows) * len(tracks)
    note = FILLED.format(count, N * len(tracks))
    assert [text for label, text in sentences.plot_statements(followed) if not label] == [note]
    fitted, other = (fit_plots(experiment, path, allowing=()) for path in (filled, empty))
    assert fitted.keys == other.keys
    assert (fitted.fills["velocity_mps"], other.fills["velocity_mps"]) == (count, 0)


def test_a_target_that_stops_has_a_velocity_of_zero(tmp_path):
    (experiment,) = load_experiments.load_all(["rls2"])
    t = 10.0 * np.arange(N)
    v = np.where((t > 100) & (t < 400), 0.0, 20.0)
    r = 5000 + np.concatenate([[0.0], np.cumsum(10 * v[1:])])
    path = tmp_path / "plots.csv"
    path.write_text("\n".join(["t_s,range_m,velocity_mps", *(f"{a},{b},{c}" for a, b, c in zip(t, r, v, strict=True))]))
    followed, _ = tracked(experiment, path)
    assert (sum(followed.fills.values()), followed.missing["velocity_mps"]) == (0, 0)


def test_ranges_of_a_number_that_repeats_are_read_as_empty_cells(tmp_path):
    (experiment,) = load_experiments.load_all(["rls2"])
    path = write_plots(tmp_path / "plots.csv", {})
    rows = path.read_text().split("\n")
    empty_rows = rows.copy()
    for k in range(5, N, 6):
        t, name, _, velocity = rows[k].split(",")
        rows[k], empty_rows[k] = (f"{t},{name},{r},{velocity}" for r in ("65535", ""))
    empty = tmp_path / "empty.csv"
    path.write_text("\n".join(rows)), empty.write_text("\n".join(empty_rows))
    (followed, (estimate,)), (_, (expected,)) = tracked(experiment, path), tracked(experiment, empty)
    np.testing.assert_array_equal(estimate, expected)
    assert dict(followed.fills) == {"range_m": 10, "velocity_mps": 0}
    statements = [text for label, text in sentences.plot_statements(followed) if not label]
    assert statements == ["ranges that stand for none, as 65535 again and again: 10 of 60; they are left out"]
