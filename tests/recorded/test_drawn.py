"""Plots of many realisations at once: those of one after the other, of every study that has plots."""

import numpy as np
import pytest

import radarsim
from radarsim.app.run import load_all
from radarsim.recorded import follow
from radarsim.studies.interface import RecordedPlots

CASES = {  # config and what picks a case of it: every study, missed plots, folds, random targets, several plots a scan
    "rls2": (),
    "ambiguous_rls2": (),
    "multimodel_1hz": (),
    "sonar_smoothing": (),
    "sonar_missed": ("sweep.sensor.detection_probability=[0.7]",),
}


@pytest.mark.parametrize("config", CASES)
def test_plots_in_bulk_are_those_of_one_realisation_after_the_other(config):
    made = radarsim.plots(config, n=21, first=1003, overrides=CASES[config])
    (case,) = load_all([config], CASES[config])[0].cases
    for i in (0, 4, 5, 20):
        one, row = follow.recorded_of(case).simulated(case, 1003 + i), made.rows(i)
        assert list(row) == list(one)
        for name, column in one.items():
            np.testing.assert_array_equal(row[name], column)


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


class _Own(RecordedPlots):
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
    made = _Own().drawn(None, 4, 2)
    assert made.components == (("x", "m"), ("Vr", "m/s"))
    np.testing.assert_array_equal(made.columns["x_m"], [[4.5, 5.5, 6.5], [5.5, 6.5, 7.5]])
    np.testing.assert_array_equal(made.truth_of((("Vr", "m/s"),))[..., 0], [[8, 10, 12], [10, 12, 14]])
    with pytest.raises(TypeError, match="must have `drawing` or `simulated`"):
        type("Neither", (RecordedPlots,), {})
