"""Several tracks of one file, each followed by itself; and errors against the truth that stands beside the plots."""

import csv

import numpy as np
import pytest

from radarsim.api.load_experiments import load_all
from radarsim.errors import ConfigError
from radarsim.recordings import read_plots, rows_by_track, simulate_plots, track
from radarsim.recordings.report import sentences
from tests.tolerances import assert_rounded


def loaded(config="rls2"):
    (one,) = load_all([config], ("scans=60",))
    return one


@pytest.fixture(scope="module")
def realisations():
    return [simulate_plots.simulate_realisation(loaded(), i) for i in range(3)]


def written(path, tables, header=("t_s", "track", "range_m", "velocity_mps", "true_r_m", "true_Vr_mps", "note")):
    """Rows of several tables, interleaved by time."""
    rows = [
        (t, name, *(float(table[key][i]) for key in header[2:-1]), "text")
        for name, table in tables.items()
        for i, t in enumerate(table["t_s"].tolist())
    ]
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([("# a comment",), header, *sorted(rows, key=lambda row: row[0])])
    return path


def tracks_of(path, config="rls2"):
    """What was found, and the estimates (F, n, C) by track."""
    parts = {}
    followed = track.track_plots(loaded(config), path, lambda track, name: parts.setdefault(name, []).append(track))
    return followed, {name: rows_by_track.join_tracks(own).estimate for name, own in parts.items()}


def test_each_track_is_followed_by_itself(tmp_path, realisations):
    """As if it were alone in the file: interleaved with others, in pieces, and with rows of no track, in no order."""
    tables = dict(zip(("a", "b", ""), realisations, strict=True))
    path = written(tmp_path / "all.csv", tables)
    lines = path.read_text().splitlines()
    lines[4], lines[7] = lines[7], lines[4]
    path.write_text("\n".join(lines))
    followed, together = tracks_of(path)
    assert set(followed.tracks) == {"a", "b"}
    assert (followed.rows, followed.trackless_rows) == (120, 60)
    for name in ("a", "b"):
        alone, own = tracks_of(written(tmp_path / f"{name}.csv", {name: tables[name]}))
        np.testing.assert_array_equal(together[name], own[name])
        assert followed.tracks[name].tallies == alone.tallies
    for key, tally in followed.tallies.items():
        assert tally.count == sum(one.tallies[key].count for one in followed.tracks.values())


def test_times_must_rise_within_a_track_alone(tmp_path, realisations):
    path = written(tmp_path / "plots.csv", {"a": realisations[0], "b": realisations[1]})
    lines = path.read_text().splitlines()
    lines[2], lines[4] = lines[4], lines[2]  # two rows of track a
    path.write_text("\n".join(lines))
    with pytest.raises(
        ConfigError, match=r"plots.csv:\d+:1: t_s: must not be earlier than the row before, got 0 after 10 in track a"
    ):
        tracks_of(path)


def test_a_file_without_a_named_track_is_refused(tmp_path, realisations):
    with pytest.raises(ConfigError, match=r"track: must name the track of some rows, all 60 are empty"):
        tracks_of(written(tmp_path / "plots.csv", {"": realisations[0]}))


def test_errors_against_the_truth(tmp_path, realisations):
    """By hand from the estimates; the first ten of each filter, those of its start, are left out."""
    followed, estimates = tracks_of(written(tmp_path / "plots.csv", {"a": realisations[0]}))
    for f, name in enumerate(("r", "r+Vr")):
        for c, (component, column) in enumerate((("r", "true_r_m"), ("Vr", "true_Vr_mps"))):
            error = estimates["a"][f, :, c] - realisations[0][column]
            own = error[np.isfinite(error)][10:]
            found = followed.errors[name, component]
            assert found.count == len(own)
            assert_rounded(found.rms, np.sqrt(np.mean(own**2)), operations=len(own))
    assert ("r", "ar") not in followed.errors


def test_a_cell_of_the_truth_that_is_no_number_is_missing(tmp_path, realisations):
    table = dict(realisations[0])
    path = written(tmp_path / "plots.csv", {"a": table})
    path.write_text(path.read_text().replace("true_Vr_mps", "true_target").replace("text", "more"))
    followed, _ = tracks_of(path)
    assert {component for _, component in followed.errors} == {"r"}


# ---- numbers used again, several plots of a scan ---------------------------------------------------------------------


def numbered(path, *parts):
    """A file of rows of one track number: of several tables, by time."""
    table = {key: np.concatenate([part[key] for part in parts]) for key in ("t_s", "range_m", "velocity_mps")}
    order = np.argsort(table["t_s"], kind="stable")
    rows = {key: column[order] for key, column in table.items()}
    return written(path, {"7": rows}, ("t_s", "track", "range_m", "velocity_mps", "note"))


@pytest.mark.parametrize("size", [7, 20_000])
def test_a_number_used_again_after_a_gap_is_another_track(tmp_path, monkeypatch, realisations, size):
    """Each as if it were alone; told once; a gap of ten scans is none."""
    monkeypatch.setattr(read_plots, "CHUNK_ROWS", size)
    first, second = ({key: one[key].copy() for key in ("t_s", "range_m", "velocity_mps")} for one in realisations[:2])
    second["t_s"] += first["t_s"][-1] + 3524.0
    second["range_m"] += 150e3
    followed, together = tracks_of(numbered(tmp_path / "again.csv", first, second))
    assert (list(followed.tracks), followed.reused_numbers) == (["7", "7 (2)"], 1)
    for name, one in (("7", first), ("7 (2)", second)):
        _, alone = tracks_of(numbered(tmp_path / "alone.csv", one))
        np.testing.assert_array_equal(together[name], alone["7"])
    (line,) = (line for line in sentences.plot_lines(followed) if line.startswith("again"))
    assert "1 track number used again after a gap: each begins a new track" in line
    hole = {key: np.delete(first[key], np.arange(20, 30)) for key in first}
    followed, _ = tracks_of(numbered(tmp_path / "hole.csv", hole))
    assert (list(followed.tracks), followed.reused_numbers, followed.gaps) == (["7"], 0, 1)


@pytest.mark.parametrize("size", [7, 20_000])
@pytest.mark.parametrize("late_s", [0.0, 3.0, -3.0])
def test_of_several_plots_of_a_scan_the_one_on_the_track_is_kept(tmp_path, monkeypatch, realisations, size, late_s):
    """Reflections 20 km off, at the plot's time or before or after it: as if they were not there, and counted."""
    monkeypatch.setattr(read_plots, "CHUNK_ROWS", size)
    sound = {key: realisations[0][key] for key in ("t_s", "range_m", "velocity_mps")}
    ghosts = {key: column[10::9].copy() for key, column in sound.items()}
    ghosts["range_m"] += 20e3
    ghosts["t_s"] += late_s
    parts = (ghosts, sound) if late_s <= 0 else (sound, ghosts)
    followed, kept = tracks_of(numbered(tmp_path / "ghosts.csv", *parts))
    _, alone = tracks_of(numbered(tmp_path / "alone.csv", sound))
    cut = late_s <= 0 and size == 7  # a scan that the end of a piece parts
    if cut:
        assert followed.doubles >= len(ghosts["t_s"]) - 1
    else:
        assert followed.doubles == len(ghosts["t_s"])
        np.testing.assert_array_equal(kept["7"], alone["7"])
        assert any(line.startswith("doubles") and f"{followed.doubles} plots left out" in line
                   for line in sentences.plot_lines(followed))  # fmt: skip


def test_plots_at_uneven_times_are_no_doubles(tmp_path, realisations):
    """As ships send them: intervals from a fifth of the usual one on."""
    rng = np.random.default_rng(6)
    one = {key: realisations[0][key].copy() for key in ("t_s", "range_m", "velocity_mps")}
    one["t_s"] = np.cumsum(rng.choice([2.0, 3.0, 6.0, 10.0], one["t_s"].size))
    followed, _ = tracks_of(numbered(tmp_path / "uneven.csv", one))
    assert (followed.doubles, followed.rows) == (0, 60)
