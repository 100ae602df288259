"""Several tracks of one file, each followed by itself; and errors against the truth that stands beside the plots."""

import csv

import numpy as np
import pytest

from radarsim.app.run import load_all
from radarsim.errors import ConfigError
from radarsim.recorded import follow


def loaded(config="rls2"):
    (one,) = load_all([config], ("scans=60",))
    return one


@pytest.fixture(scope="module")
def realisations():
    return [follow.simulated(loaded(), i) for i in range(3)]


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
    followed = follow.follow(loaded(config), path, lambda track, name: parts.setdefault(name, []).append(track))
    return followed, {name: follow.joined(own).estimate for name, own in parts.items()}


def test_each_track_is_followed_by_itself(tmp_path, realisations):
    """As if it were alone in the file: interleaved with others, in pieces, and with rows of no track, in no order."""
    tables = dict(zip(("a", "b", ""), realisations, strict=True))
    path = written(tmp_path / "all.csv", tables)
    lines = path.read_text().splitlines()
    lines[4], lines[7] = lines[7], lines[4]
    path.write_text("\n".join(lines))
    followed, together = tracks_of(path)
    assert set(followed.tracks) == {"a", "b"}
    assert (followed.rows, followed.passed_over) == (120, 60)
    for name in ("a", "b"):
        alone, own = tracks_of(written(tmp_path / f"{name}.csv", {name: tables[name]}))
        np.testing.assert_array_equal(together[name], own[name])
        assert followed.tracks[name].tallies == alone.tallies
    for key, tally in followed.tallies.items():
        assert tally.count == sum(one.tallies[key].count for one in followed.tracks.values())


def test_what_advice_is_asked_of_is_the_beginning_of_each_track(tmp_path, monkeypatch, realisations):
    """However many pieces of the file it lies in."""
    monkeypatch.setattr(follow.plots, "CHUNK", 7)
    monkeypatch.setattr(follow, "HEAD", 40)
    followed, _ = tracks_of(written(tmp_path / "plots.csv", dict(zip("ab", realisations, strict=False))))
    for name, table in zip("ab", realisations, strict=False):
        np.testing.assert_array_equal(followed.tracks[name].head["range_m"], table["range_m"][:40])


def test_times_must_rise_within_a_track_alone(tmp_path, realisations):
    path = written(tmp_path / "plots.csv", {"a": realisations[0], "b": realisations[1]})
    lines = path.read_text().splitlines()
    lines[2], lines[4] = lines[4], lines[2]  # two rows of track a
    path.write_text("\n".join(lines))
    with pytest.raises(
        ConfigError, match=r"plots.csv:\d+:1: t_s: must be later than the row before, got 0 after 10 in track a"
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
            assert found.rms == pytest.approx(np.sqrt(np.mean(own**2)), rel=1e-12)
    assert ("r", "ar") not in followed.errors


def test_a_cell_of_the_truth_that_is_no_number_is_missing(tmp_path, realisations):
    table = dict(realisations[0])
    path = written(tmp_path / "plots.csv", {"a": table})
    path.write_text(path.read_text().replace("true_Vr_mps", "true_target").replace("text", "more"))
    followed, _ = tracks_of(path)
    assert {component for _, component in followed.errors} == {"r"}
