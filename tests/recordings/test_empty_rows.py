"""An empty row and no row are the same, for every filter of every study that takes recorded plots."""

from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from radarsim.api.load_experiments import load_all
from radarsim.recordings import simulate_plots
from radarsim.recordings.study_part import recording_interface
from radarsim.studies import authoring, step_tracker
from radarsim.studies.linear_recordings import LinearTracker
from radarsim.studies.missed_scans import with_missed_scans, without_empty_rows
from radarsim.studies.range_doppler import tracking as radial_tracking
from radarsim.studies.range_doppler.package_filters import GivenGains

CONFIGS = {
    "rls2": ("scans=40",),
    "multimodel_families": ("scans=40",),
    "sonar_smoothing": (),
    "sonar_correlated": ("sweep.sensor.error_correlation=[0.6]",),
    "sonar_conversion": ("sweep.sensor.sigma_bearing_deg=[1]", "sweep.frame=[cartesian]"),
    "sonar_manoeuvre": ("scans=60", "sweep.target.acceleration_mps2=[0.1]"),
    "ambiguous_rls2": ("scans=25",),
    "ambiguous_orders": ("scans=25",),
}


def loaded(config, *overrides):
    (one,) = load_all([config], overrides)
    return one.cases[0]


def recording(config, *overrides):
    (one,) = load_all([config], overrides)
    columns = simulate_plots.simulate_realisation(one, 3)
    return {name: column for name, column in columns.items() if not name.startswith("true_")}


def tracked(case, columns):
    return recording_interface(case).tracker(case).feed({name: column.copy() for name, column in columns.items()})


def with_and_without(columns, missed):
    """The columns with empty rows, and without them; and which rows are left."""
    kept = ~np.isin(np.arange(len(columns["t_s"])), missed)
    empty = {name: np.where(kept | (name == "t_s"), column, np.nan) for name, column in columns.items()}
    return empty, {name: column[kept] for name, column in columns.items()}, kept


def assert_same(first, second, kept):
    assert first.filters == second.filters
    for name in ("estimate", "sigma"):
        a, b = getattr(first, name)[:, kept], getattr(second, name)
        assert (np.isfinite(a) == np.isfinite(b)).all()
        scale = np.nan_to_num(first.sigma[:, kept], nan=1.0)
        assert np.nanmax(np.abs(a - b) / np.maximum(scale, 1e-300), initial=0.0) < 1e-6


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("missed", [[6, 9, 10, 11, 14], [0, 1, 6]], ids=["within", "before the first plot"])
def test_empty_rows_change_no_estimate(config, missed):
    case, columns = loaded(config, *CONFIGS[config]), recording(config, *CONFIGS[config])
    empty, without, kept = with_and_without(columns, missed)
    assert_same(tracked(case, empty), tracked(case, without), kept)
    interface = recording_interface(case)
    if 0 in missed:  # likelihoods are asked without empty rows
        empty = without_empty_rows(empty)
    for member in case.spec.members:
        one, other = (interface.likelihood(case, member.name, [track]) for track in (empty, without))
        if one is not None:
            assert one(one.stated) == pytest.approx(other(other.stated), rel=1e-9)


class Column(authoring.Model):
    sigma_m: authoring.Positive = authoring.key("σ", "σ of a position, m")
    scan_period_s: authoring.Positive = authoring.key("period", "time between two plots, s")


class Kind(authoring.Member):
    kind: str = authoring.key("kind", "kalman or steady")


class Pushed(authoring.LinearStudy):
    """Pushed at random once a scan, seen by two sensors in turn; a steady filter has its gains by the scan."""

    name, about, asks = "pushed_for_tests", "Pushed at random.", "How far does it go?"
    filters: ClassVar = {"kind": "kalman or steady"}
    components = (authoring.Component("x", "m", "$x$", "x"), authoring.Component("v", "m/s", "$v$", "v"))
    parts, Filter, scan_period = {"sensor": Column}, Kind, "sensor.scan_period_s"
    measured = (authoring.MeasuredColumn("x_m", "m", ("sensor.sigma_m",)),)

    def motion(self, spec):
        return authoring.Motion(
            F=lambda dt: [[1, dt], [0, 1]], Q=lambda dt: np.outer(*2 * [[dt * dt / 2, dt]]), mean=[0, 0],
            covariance=np.diag([1e4, 1e4]),
        )  # fmt: skip

    def plot(self, spec, filter_keys, k):
        return [1, 0], spec.sensor.sigma_m * (1 + k % 2)

    def own_gains(self, spec, filter_keys):
        return [[[0.5 + 0.1 * (k % 2), 0.1]] for k in range(spec.scans)] if filter_keys.kind == "steady" else None


def test_empty_rows_change_no_estimate_of_a_linear_study():
    study = Pushed()
    document = {"sensor": {"sigma_m": 5.0, "scan_period_s": 4.0}, "scans": 12,
                "filters": [{"name": kind, "kind": kind} for kind in ("kalman", "steady")]}  # fmt: skip
    spec = study.key_class.model_validate(document)
    columns = {"t_s": 4.0 * np.arange(40), "x_m": np.random.default_rng(2).normal(0, 5, 40)}
    empty, without, kept = with_and_without(columns, [6, 9, 10, 11, 14])
    tracks = [LinearTracker(study, spec).feed(track) for track in (empty, without)]
    assert_same(*tracks, kept)
    pieces = LinearTracker(study, spec)
    halves = [pieces.feed({name: column[rows] for name, column in without.items()}).estimate
              for rows in (slice(0, 7), slice(7, None))]  # fmt: skip
    np.testing.assert_array_equal(np.concatenate(halves, axis=1), tracks[1].estimate)


def test_empty_rows_change_no_estimate_of_a_step_study():
    """A state that grows at random once a scan, by the square of the time."""
    steps = SimpleNamespace(
        design=lambda spec, filter_keys: (),
        start=lambda z, u, c: (z[0], 1.0),
        predict=lambda s, dt, u, c: (s[0], s[1] + dt * dt),
        update=lambda s, z, u, c: (s[0] + s[1] / (s[1] + 25) * (z[0] - s[0]), s[1] * 25 / (s[1] + 25)),
        estimate=lambda s, u, c: (s[0],),
        covariance=lambda s, u, c: (s[1],),
        innovation=None,
    )
    study = SimpleNamespace(
        name="steps", kinds={"kalman": steps}, measured=(authoring.MeasuredColumn("x_m", "m", ()),), known_columns=(),
        components=(authoring.Component("x", "m", "$x$", "x"),), scan_period_s=lambda spec: 4.0,
        false_places=lambda spec: 0, columns=lambda spec, keys: ("x_m",),
    )  # fmt: skip
    spec = SimpleNamespace(filters=[SimpleNamespace(name="kalman", kind="kalman")])
    columns = {"t_s": 4.0 * np.arange(40), "x_m": np.random.default_rng(2).normal(0, 5, 40)}
    empty, without, kept = with_and_without(columns, [6, 9, 10, 11, 14])
    assert_same(*(step_tracker.Tracker(study, spec).feed(track) for track in (empty, without)), kept)


class Frozen(GivenGains):
    """The study's Kalman filter, with the gains of a scan from there on."""

    kind: str = authoring.key("kind", "of a package")

    def noise(self, dt_s):
        return authoring.process_noise("random_jerk", 1e-3, dt_s)

    def gains(self, scans):
        gains = scans.kalman(self.noise)
        gains[8:] = gains[7]
        return gains


@pytest.mark.parametrize("missed", [[6, 9, 10, 11, 14], [2, 3, 4]])
def test_empty_rows_change_no_estimate_of_a_package_filter(missed):
    columns = recording("rls2", "scans=40")
    empty, without, kept = with_and_without(columns, missed)
    frozen = Frozen.model_validate({"name": "frozen", "kind": "frozen", "observes": ["range", "velocity"]})
    case = SimpleNamespace(spec=SimpleNamespace(filters=[frozen], radar=loaded("rls2").spec.radar))
    tracks = [radial_tracking.Tracker(case).feed(track) for track in (empty, without)]
    assert np.isfinite(tracks[1].sigma[:, 3:]).all()
    assert_same(*tracks, kept)


def test_a_scan_without_plots_ends_tracks_among_false_plots_as_one_without_rows():
    overrides = "sweep.gate_probability=[0.99]", "sweep.sensor.detection_probability=[0.9]"
    case, columns = loaded("sonar_clutter_gate", *overrides), recording("sonar_clutter_gate", *overrides)
    t = np.unique(columns["t_s"])
    is_missed = np.isin(columns["t_s"], t[[8, 12, 13, 20]])
    without = {name: column[~is_missed] for name, column in columns.items()}
    empty = {name: np.where((name == "t_s") | ~is_missed, column, np.nan) for name, column in columns.items()}
    first, second = tracked(case, empty), tracked(case, without)
    kept = np.isin(first.t_s, second.t_s)
    assert_same(first, second, kept)
    np.testing.assert_array_equal(first.score[:, kept], second.score)


@pytest.mark.parametrize(("config", "gap_s"), [("rls2", 1e4), ("sonar_smoothing", 1e6)])
def test_a_long_gap_leaves_variances(config, gap_s):
    case, columns = loaded(config, *CONFIGS[config]), recording(config, *CONFIGS[config])
    columns["t_s"] = columns["t_s"] + np.where(np.arange(len(columns["t_s"])) > 12, gap_s, 0.0)
    track = tracked(case, columns)
    assert np.isfinite(track.sigma[:, 13:][np.isfinite(track.estimate[:, 13:])]).all()
    assert (track.sigma[np.isfinite(track.sigma)] >= 0).all()


def test_missed_scans_are_those_of_whole_periods():
    times, rows = with_missed_scans(np.array([0.0, 10.0, 40.001, 45.0, 70.0, 1e9]), 10.0)
    np.testing.assert_allclose(times[:10], [0, 10, 20.0003, 30.0007, 40.001, 45, 55, 70, 80, 90], rtol=1e-5)
    assert len(times) == rows[-1] + 1 == 8 + 100 + 1
