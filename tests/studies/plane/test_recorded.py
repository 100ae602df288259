"""Recorded plots of the plane: innovations against the twins, folded velocities."""

import numpy as np
import pandas as pd
import pytest

from radarsim.api.load_experiments import load_all
from radarsim.errors import ConfigError
from radarsim.recordings import simulate_plots
from radarsim.recordings.fit.fit import file_likelihoods
from radarsim.recordings.fit.velocity_faults import detect_case_velocity_fault
from radarsim.studies import plane
from radarsim.studies.registry import study
from tests.studies.plane import naive
from tests.studies.plane.cases import STRAIGHT, case_of, member, plots_of

NAMES = ("range_m", "bearing_rad", "velocity_mps")


def test_the_nis_of_each_number_of_a_plot_is_the_twins():
    """Of no velocity while its fold is not known; of none at missed plots."""
    filters = [member("extended"), member("unscented", doppler=False), member("imm", "turn")]
    case = case_of(filters, repetition_rate_hz=4000.0)
    t, (z,), _, _ = plots_of(case, 1)
    track = study("plane").tracker(case).feed({"t_s": t} | dict(zip(NAMES, z.T, strict=True)))
    assert track.tested == tuple((name, 1) for name in NAMES)
    for f, keys in enumerate(case.spec.filters[:2]):
        twin = naive.Filter(case.spec.radar, keys, False)
        twin.start(z[0])
        wanted = np.full((len(t), 3), np.nan)
        for k in range(1, len(t)):
            twin.predict(t[k] - t[k - 1])
            if np.isfinite(z[k, 0]):
                mean, S, _ = twin.law(twin.x[0], twin.P[0])
                wanted[k, : twin.m] = twin.apart(z[k], mean) ** 2 / np.diag(S)
                if twin.m == 3 and S[2, 2] * naive.RESOLVED**2 >= twin.span**2:
                    wanted[k, 2] = np.nan
                twin.update([z[k]])
        np.testing.assert_allclose(track.nis[f], wanted, rtol=1e-6)
    assert np.isnan(track.nis[0, 1, 2])
    assert np.isfinite(track.nis[0, -3:, 2]).any()
    assert np.isfinite(track.nis[2, 2:, 0]).any()


def test_folded_velocities_are_said_and_taken_with_the_rate_that_folds_them():
    plots = study("plane").recording_interface()
    folded = case_of([member("extended")], STRAIGHT, 40, repetition_rate_hz=4000.0, detection_probability=1.0)
    rows = plots.simulated(folded, 0)
    track = {name: rows[name] for name in ("t_s", *NAMES)}
    unfolded = case_of([member("extended")], STRAIGHT, 40)
    fault = detect_case_velocity_fault(unfolded, [track])
    assert fault.folding.span_mps == pytest.approx(200, rel=0.05)
    (setting,) = plots.unfolding(unfolded.spec, fault.folding.span_mps)
    key, _, value = setting.partition("=")
    assert key == "radar.repetition_rate_hz"
    assert float(value) == pytest.approx(4000, rel=0.05)
    assert detect_case_velocity_fault(folded, [track]).folding is None


@pytest.mark.parametrize(("name", "error", "row"), [("range_m", 6e4, 1), ("bearing_rad", 1.0, 20)])
def test_a_filter_that_merges_no_states_refuses_plots_where_the_target_cannot_be(
    tmp_path, monkeypatch, name, error, row
):
    """Its likelihood knows no outliers: σ of the range would be 8 km, of one plot of 40 that is 60 km off."""
    (experiment,) = load_all(["plane"], ("scans=40", "radar.detection_probability=1"))
    columns = simulate_plots.simulate_realisation(experiment, 0)
    columns[name] = columns[name] + error * (np.arange(40) == row)
    file = tmp_path / "plots.csv"
    pd.DataFrame(columns).to_csv(file, index=False)
    assert file_likelihoods(experiment, file).complete.rows == 40
    monkeypatch.setattr(plane.Tracking, "merge", None)
    with pytest.raises(ConfigError, match=rf"plots far off.* at {columns['t_s'][row]:g} s; .*knows no outliers"):
        file_likelihoods(experiment, file)


def test_sound_plots_of_a_target_that_turns_are_fitted(tmp_path):
    (experiment,) = load_all(["plane"], ("scans=60",))
    for i in range(10):
        file = tmp_path / f"{i}.csv"
        pd.DataFrame(simulate_plots.simulate_realisation(experiment, i)).to_csv(file, index=False)
        assert file_likelihoods(experiment, file).complete.rows > 40
