"""What proves the study: the limit by Riccati's equation, a filter of a few lines over its plots, the claims."""

import numpy as np
import pytest
import radarsim
from radarsim.api.configs import load
from scipy.linalg import solve_discrete_are

from chirp import STUDY

CASE = load("chirp").cases[0]


def test_steady_errors_are_those_of_riccatis_equation():
    F, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), 25 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    limits = STUDY.limits(CASE.spec)
    for row, coupling in ((0, -0.3), (1, 0.3), (3, 0.0)):
        H = np.array([[1.0, coupling]])
        P = solve_discrete_are(F.T, H.T, Q, [[50.0**2]])
        P -= P @ H.T @ H @ P / (H @ P @ H.T + 50.0**2)
        np.testing.assert_allclose(limits[row], np.sqrt(np.diag(P)), rtol=1e-9)
    assert np.isnan(limits[4]).all()  # of the filter that ignores the coupling the error depends on the truth


def test_a_filter_of_a_few_lines_makes_the_same_errors_of_the_same_plots():
    columns = STUDY.recording_interface().simulated(CASE, 7)
    plan = STUDY.prepare(CASE)
    error = plan.layout.unpack(STUDY.simulate(plan, 7, 1))["error"][..., 0]
    for f, name in enumerate(("down", "up")):
        h, x, P = np.array([1.0, (-0.3, 0.3)[f]]), np.array([1e5, -300.0]), np.diag([500.0**2, 300.0**2])
        for k, z in enumerate(columns[f"z_{name}_m"]):
            if k:
                x, P = np.array([x[0] + x[1], x[1]]), np.array([[1, 1], [0, 1]]) @ P @ np.array([[1, 0], [1, 1]])
                P = P + 25 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
            K = P @ h / (h @ P @ h + 50.0**2)
            x, P = x + K * (z - h @ x), P - np.outer(K, h @ P)
            assert error[f, k] == pytest.approx(x - [columns["true_r_m"][k], columns["true_v_mps"][k]], abs=1e-7)


def test_a_filter_that_ignores_the_coupling_is_off_by_what_it_shifts():
    axes = STUDY.prepare(CASE).axes
    assert axes.exact_bias[4, -1, 0] == pytest.approx(0.3 * -300, rel=1e-5)


def test_the_claims_are_confirmed():
    table = radarsim.run("chirp_slopes", realisations=2000).tables["claims"]
    assert set(table["claim"]) == {f"chirp.{n}" for n in range(1, 6)}
    assert set(table["as_shipped"]) == {"confirmed"}


def test_a_filter_from_outside_is_judged():
    """The plots without coupling as they are: their σ is that of a plot, 50 m, and gains are against every filter."""
    judged = radarsim.judge("chirp", lambda plots: plots["z_none_m"], realisations=400)
    assert set(judged.gains.query("filter == 'mine'")["baseline"]) == {one.name for one in CASE.spec.filters}
    last = judged.curves.query("filter == 'mine'").iloc[-1]
    assert last["sigma_lo"] < 50 < last["sigma_hi"]
