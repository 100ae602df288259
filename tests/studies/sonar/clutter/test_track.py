"""`radarsim track` and `simulate` among false plots: several rows of one time, the shipped example, refusals."""

from pathlib import Path

import numpy as np
import pytest

from radarsim.api import load_experiments
from radarsim.errors import ConfigError
from radarsim.recordings import simulate_plots
from tests.recordings import plot_files
from tests.studies.sonar.precision import LINE, TERMS
from tests.tolerances import Z, assert_rounded

EXAMPLE = Path(__file__).parents[4] / "docs/examples/sonar_clutter.csv"
ONE = ("sweep.sensor.false_plots_per_km2=[0.03]",)


def loaded(name="sonar_clutter", overrides=ONE):
    return load_experiments.load_all([name], overrides)[0]


def written(path, rows):
    path.write_text("t_s,range_m,bearing_rad\n" + "".join(f"{t},{r},{b}\n" for t, r, b in rows))
    return path


def test_the_example_is_realisation_3_of_the_shipped_config():
    columns = simulate_plots.simulate_realisation(loaded(), 3)
    kept = np.genfromtxt(EXAMPLE, delimiter=",", names=True)
    assert list(columns) == list(kept.dtype.names)
    for name, values in columns.items():
        size = np.full(len(values), np.abs(kept[name]).max())
        assert_rounded(values, kept[name], size, operations=20)  # of a root, a polynomial and a normal number
    assert (np.diff(columns["t_s"]) == 0).any()
    assert set(columns["true_target"]) == {0.0, 1.0}


def test_the_target_of_the_example_is_found():
    """The track of the highest score is the target's, in every tracker; the one of known association is left out."""
    _, track = plot_files.track(loaded(), EXAMPLE)
    assert set(track.filters) == {"nearest", "PDA", "nearest, 4 of 6"}
    truth = np.genfromtxt(EXAMPLE, delimiter=",", names=True)
    for name in set(track.filters):
        own = [i for i, f in enumerate(track.filters) if f == name]
        best = max(own, key=lambda i: np.nanmax(track.score[i]))
        last = np.flatnonzero(np.isfinite(track.estimate[best, :, 0]))[-1]
        at = np.flatnonzero(truth["t_s"] == track.t_s[last])[0]
        for c, key in ((0, "true_range_m"), (2, "true_bearing_rad")):
            off = track.estimate[best, last, c] - truth[key][at]
            assert abs(off) < Z * track.sigma[best, last, c]


def test_columns_tell_the_tracks_apart(tmp_path):
    _, track = plot_files.track(loaded(), EXAMPLE)
    plot_files.write(track, tmp_path / "track.csv")
    header, first = (tmp_path / "track.csv").read_text().split("\n")[:2]
    assert header == "t_s,filter,component,unit,estimate,sigma,track,score"
    assert first.split(",")[6] == "1"


def test_one_plot_a_scan_is_the_plain_filter(tmp_path):
    """With the gate open the nearest plot is every plot, and the estimates are those of the filter alone."""
    rng = np.random.default_rng(7)
    rows = [(5.0 * k, 9000 - 20 * k + 30 * rng.normal(), 0.35 + 0.0175 * rng.normal()) for k in range(15)]
    path = written(tmp_path / "plots.csv", rows)
    base = {"study": "sonar", "target": "sonar_straight", "scans": 15, "realisations": 1}
    sensor = {"sigma_range_m": 30, "sigma_bearing_rad": 0.0175, "scan_period_s": 5}
    sector = {"range_m": [1e3, 2e4], "bearing_rad": [-1, 1]}
    rules = {"kind": "kalman", "manoeuvre_variance": 1e-4, "name": "a"}
    tracker = {**rules, "association": "nearest", "gate_probability": 1.0}
    (one,) = load_experiments.load_all([base | {"sensor": sensor, "filters": [rules]}])
    (other,) = load_experiments.load_all([base | {"sensor": sensor | {"sector": sector}, "filters": [tracker]}])
    _, plain = plot_files.track(one, path)
    _, found = plot_files.track(other, path)
    assert found.estimate.shape == plain.estimate.shape
    # Over the 15 scans the plots are 9 km away and less than 500 m apart, of σ 30 m; bearings are nearer, in σ.
    size = (LINE * 500 + 9e3) / 30 * plain.sigma
    assert_rounded(found.estimate, plain.estimate, size, operations=15 * TERMS)
    assert_rounded(found.sigma, plain.sigma, condition=LINE, operations=15 * TERMS)


def test_equal_times_are_for_trackers_alone(tmp_path):
    path = written(tmp_path / "plots.csv", [(0, 9e3, 0.3), (0, 8e3, 0.2), (5, 9e3, 0.3)])
    with pytest.raises(ConfigError, match="must be later than the row before, got 0 after 0"):
        plot_files.track(loaded("sonar_smoothing", ()), path)
    plot_files.track(loaded(), path)
    with pytest.raises(ConfigError, match="must not be earlier than the row before, got 4 after 5"):
        plot_files.track(loaded(), written(path, [(5, 9e3, 0.3), (4, 8e3, 0.2)]))


def test_a_scan_without_plots_and_no_track_at_all(tmp_path):
    path = written(tmp_path / "plots.csv", [(0, 9e3, 0.3), (5, "", ""), (10, 9e3, "")])
    _, track = plot_files.track(loaded(), path)
    assert track.estimate.shape == (0, 3, 4)


def test_an_oracle_alone_cannot_track(tmp_path):
    path = written(tmp_path / "plots.csv", [(0, 9e3, 0.3)])
    config = loaded("sonar_clutter", (*ONE, "filters=[{name: a, kind: kalman, association: known}]"))
    with pytest.raises(ConfigError, match="use nearest or pda"):
        plot_files.track(config, path)
