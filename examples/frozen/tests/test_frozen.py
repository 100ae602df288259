"""What proves the filter: the study's own where nothing is frozen, the textbook where it is, the exact σ in both."""

from pathlib import Path

import numpy as np
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.physics.motion import process_noise, transition
from radarsim.studies.range_doppler.study import prepare

CONFIG = Path(__file__).parents[1] / "frozen.yaml"
SIGMA = np.array([250.0, 15.0])
H, R = np.eye(2, 3), np.diag(SIGMA**2)


def of(table, name):
    return table[table["filter"] == name].reset_index(drop=True)


@pytest.mark.parametrize("worse", [[], ["radar.bias_range_m=100", "radar.sigma_bias_velocity_mps=5"]], ids=len)
def test_measured_errors_are_the_exact_ones(worse):
    """Within 5 standard errors at every scan, biases or none; the seed is fixed."""
    own = of(radarsim.run(CONFIG, realisations=20_000, overrides=worse).curves, "frozen")
    standard_error = (own["sigma_hi"] - own["sigma_lo"]) / 4
    assert len(own) == 40 + 40 + 39
    assert (abs(own["sigma"] - own["exact_sigma"]) < 5 * standard_error).all()


def test_frozen_past_the_end_it_is_the_filter_of_the_study():
    (case,) = load(CONFIG, ["filters.2.freeze_after=100"]).cases
    axes = prepare(case).axes
    np.testing.assert_allclose(axes.exact_sigma[2], axes.exact_sigma[1], rtol=1e-12)
    np.testing.assert_allclose(axes.exact_nees[2], axes.exact_nees[1], rtol=1e-9)


def textbook(t, z, last):
    """Estimates after a start from the first two plots, by Kalman's gains up to a row, from then on by its gain."""
    rows = np.concatenate([H @ transition(at - t[1]) / SIGMA[:, None] for at in t[:2]])
    x, P = np.linalg.lstsq(rows, (z[:2] / SIGMA).ravel(), rcond=None)[0], np.linalg.inv(rows.T @ rows)
    for k in range(2, len(t)):
        dt = t[k] - t[k - 1]
        x, P = transition(dt) @ x, transition(dt) @ P @ transition(dt).T + process_noise("random_jerk", 1e-3, dt)
        there = np.isfinite(z[k])
        if k < last:
            K = np.zeros((3, 2))
            K[:, there] = P @ H[there].T @ np.linalg.inv(H[there] @ P @ H[there].T + R[there][:, there])
        used = np.where(there, K, 0.0)
        x, P = x + used @ np.where(there, z[k] - H @ x, 0.0), (np.eye(3) - used @ H) @ P
        yield x


@pytest.mark.parametrize(("uneven", "last"), [(False, 4), (True, 4), (True, 15)])
def test_recorded_plots_are_filtered_as_a_textbook_does(uneven, last):
    plots = radarsim.simulate(CONFIG)
    if uneven:
        plots["t_s"] += np.sin(np.arange(len(plots)))
        plots.loc[plots.index[5::7], "velocity_mps"] = np.nan
        plots.loc[plots.index[9::11], "range_m"] = np.nan
    own = of(radarsim.track(CONFIG, plots, [f"filters.2.freeze_after={last}"]), "frozen")
    wanted = np.array(list(textbook(plots["t_s"].to_numpy(), plots[["range_m", "velocity_mps"]].to_numpy(), last)))
    for c, name in enumerate(("r", "Vr", "ar")):
        made = own[own["component"] == name]
        made = made[made["t_s"] > plots["t_s"].iloc[1]]
        np.testing.assert_allclose(made["estimate"], wanted[:, c], rtol=1e-10)


def test_keys_are_those_of_the_filter():
    with pytest.raises(radarsim.ConfigError, match=r"freeze_at.*: unknown key; did you mean freeze_after"):
        load(CONFIG, ["filters.2.freeze_at=3"])
    with pytest.raises(radarsim.ConfigError, match=r"detection_probability.*: must be 1 with filter frozen"):
        load(CONFIG, ["radar.detection_probability=0.9"])
