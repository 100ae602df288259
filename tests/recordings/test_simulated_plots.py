"""Plots of many realisations at once: those of one after the other, of every study that has plots."""

import sys
import tracemalloc

import numpy as np
import pytest

import radarsim
from radarsim.studies.recording_interface import RecordingInterface
from tests.tolerances import rounding

CASES = {  # config and what picks a case of it: every study, missed plots, folds, random targets, several plots a scan
    "rls2": (),
    "rls2 missed": ("radar.detection_probability=0.8", "radar.sigma_bias_range_m=50"),
    "rls2_manoeuvres": (
        "sweep.target=[{kind: fly_by, distance_m: 3e4, speed_mps: 200, start_range_m: 6e4, "
        "sigma_position_m: 500, sigma_velocity_mps: 20}]",
    ),
    "ambiguous_rls2": (),
    "ambiguous_missed": ("sweep.radar.detection_probability=[0.7]",),
    "multimodel_1hz": ("sensor.detection_probability=0.9",),
    "sonar_smoothing": (),
    "sonar_missed": ("sweep.sensor.detection_probability=[0.7]",),
    "sonar_fluctuating": ("sweep.target=[sonar_fluctuating]",),
    "sonar_conversion": ("sweep.frame=[cartesian]", "sweep.sensor.sigma_bearing_deg=[2]"),
    "sonar_asynchronous": (),
    "sonar_manoeuvre": ("sweep.target.acceleration_mps2=[0.8]",),
    "sonar_clutter": ("sweep.sensor.false_plots_per_km2=[0.3]",),
}
FIRST, N = 1003, 21  # not whole eights
CLUTTER = "sonar_clutter", CASES["sonar_clutter"]


@pytest.mark.parametrize("config", CASES)
def test_plots_in_bulk_are_those_of_one_realisation_after_the_other(config):
    """Which the tests of each study hold against its run."""
    stem, overrides = config.split()[0], CASES[config]
    made = radarsim.plots(stem, n=N, first=FIRST, overrides=overrides)
    assert made.n == N
    for i in (0, 4, 5, 20):
        one, row = radarsim.simulate(stem, FIRST + i, overrides), made.rows(i)
        assert list(row) == list(one)
        for name, column in one.items():
            np.testing.assert_array_equal(row[name], column)
    parts = list(radarsim.plots(stem, n=N, first=FIRST, overrides=overrides, chunk=8))
    assert [part.first for part in parts] == [FIRST, FIRST + 8, FIRST + 16]
    for name, column in made.table().items():
        np.testing.assert_array_equal(np.concatenate([part.table()[name] for part in parts]), column)


def test_a_part_of_a_chunk_of_a_kernel_has_the_same_numbers():
    for config in ("rls2", "rls2 missed", "rls2_manoeuvres", "sonar_missed", "sonar_fluctuating"):
        stem, overrides = config.split()[0], CASES[config]
        whole, part = (radarsim.plots(stem, n, first, overrides) for n, first in ((1100, 0), (700, 300)))
        for name, column in part.arrays().items():
            np.testing.assert_array_equal(column, whole.arrays()[name][300:1000])


def test_a_filter_of_numpy_over_the_plots_has_the_errors_of_the_run():
    """r+Vr of RLS 2 as in a textbook: least squares on two scans, then Kalman's formulas, with a random jerk."""
    n, dt, H, R = 3000, 10.0, np.eye(3)[:2], np.diag([250.0**2, 15.0**2])
    F, g = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]]), np.array([dt**3 / 6, dt**2 / 2, dt])
    made = radarsim.plots("rls2", n)
    z = np.stack([*made.columns.values()], axis=-1)
    A, W = np.concatenate([H @ np.linalg.inv(F), H]), np.linalg.inv(np.kron(np.eye(2), R))
    P = np.linalg.inv(A.T @ W @ A)
    x = z[:, :2].reshape(n, 4) @ (P @ A.T @ W).T
    sigma = [np.sqrt(((x - made.truth[:, 1]) ** 2).mean(axis=0))]
    for k in range(2, 15):
        x, P = x @ F.T, F @ P @ F.T + 1e-3 * np.outer(g, g)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + (z[:, k] - x @ H.T) @ K.T, P - K @ H @ P
        sigma.append(np.sqrt(((x - made.truth[:, k]) ** 2).mean(axis=0)))
    curves = radarsim.run("rls2", realisations=n).curves.query("filter == 'r+Vr' and k > 1")
    measured = curves.pivot(index="k", columns="component", values="sigma")[["r", "Vr", "ar"]]
    # Ten operations a scan on ranges, of errors in the plots' σ.
    allowed = rounding(np.abs(z[..., 0]).max() / 250.0, 10 * 15)
    np.testing.assert_allclose(measured, sigma, rtol=allowed)


def test_memory_is_that_of_a_chunk():
    def peak(n):
        tracemalloc.start()
        for part in radarsim.plots("rls2", n=n, chunk=1000):
            assert part.n == 1000
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(1000)
    assert peak(40_000) < 1.5 * peak(4000)


def test_several_plots_of_a_scan_come_first_and_the_targets_is_known():
    made = radarsim.plots(*CLUTTER[:1], n=200, overrides=CLUTTER[1])
    r, b, own = made.columns["range_m"], made.columns["bearing_rad"], made.further_columns["true_target"]
    there = np.isfinite(r)
    assert made.several
    assert there[..., -1].any()  # as wide as needed
    assert (there[..., :-1] >= there[..., 1:]).all()
    assert (np.isfinite(b) == there).all()
    assert (np.isfinite(own) == there).all()
    assert (np.nansum(own, axis=-1) <= 1).all()
    errors = (r - made.further_columns["true_range_m"][..., None])[own == 1]
    assert abs(errors.mean()) < 5 * errors.std() / np.sqrt(errors.size)
    np.testing.assert_array_equal(made.truth_of((("b", "rad"),))[..., 0], made.further_columns["true_bearing_rad"])


def test_a_study_without_plots_says_so():
    for config in ("discriminator", "pulses"):
        with pytest.raises(radarsim.ConfigError, match="draws no plots: its filters take bursts of pulses"):
            radarsim.plots(config)


def test_what_no_run_has_is_refused():
    for given, words in (
        ({"n": 0}, "n: must be a whole number >= 1, got 0"),
        ({"n": 1.5}, "n: must be a whole number >= 1, got 1.5"),
        ({"n": "ten"}, "n: must be a whole number >= 1, got 'ten'"),
        ({"n": True}, "got True"),
        ({"n": 10, "first": -1}, "first: must be a whole number >= 0, got -1"),
        ({"n": 10, "first": 10**12}, "first + n: must be at most 1000000000000, got 1000000000010"),
        ({"n": 10, "chunk": 0}, "chunk: must be a whole number >= 1, got 0"),
    ):
        with pytest.raises(radarsim.ConfigError) as told:
            radarsim.plots("rls2", **given)
        assert words in str(told.value)


class _Own(RecordingInterface):
    """Of a study that has one realisation at a time."""

    def columns(self, spec):
        return (("t_s", "x_m"),)

    def sigmas(self, spec):
        return {}

    def scan_period_s(self, spec):
        return 1.0

    def tracker(self, case):
        raise NotImplementedError

    def simulated(self, case, realisation):
        x = np.arange(3.0) + realisation
        return {"t_s": np.arange(3.0), "x_m": x + 0.5, "true_x_m": x, "true_Vr_mps": 2 * x}


def test_a_study_of_one_realisation_at_a_time_has_several_too():
    made = _Own().draw_plots(None, 4, 2)
    assert made.components == (("x", "m"), ("Vr", "m/s"))
    np.testing.assert_array_equal(made.columns["x_m"], [[4.5, 5.5, 6.5], [5.5, 6.5, 7.5]])
    np.testing.assert_array_equal(made.truth_of((("Vr", "m/s"),))[..., 0], [[8, 10, 12], [10, 12, 14]])
    with pytest.raises(TypeError, match="must have `drawing` or `simulated`"):
        type("Neither", (RecordingInterface,), {})


def test_as_a_dataset_of_xarray():
    made = radarsim.plots("rls2", n=3, first=4)
    data = made.to_xarray()
    assert (dict(data.sizes)["realisation"], data["realisation"].values.tolist()) == (3, [4, 5, 6])
    np.testing.assert_array_equal(data["t_s"], made.t_s)
    assert data["true_Vr_mps"].attrs == {"units": "m/s"}
    np.testing.assert_array_equal(data["range_m"].sel(realisation=5), made.columns["range_m"][1])


def test_without_xarray_the_error_names_what_adds_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(radarsim.ConfigError, match=r"pip install 'radarsim\[xarray\]'"):
        radarsim.plots("rls2", n=3).to_xarray()
