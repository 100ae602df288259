"""Tests that prove the study. Yours: a test for each way in which it could be wrong."""

import numpy as np
import pytest
import radarsim
from radarsim.app.configs import load

from random_walk import STUDY, filters

CASE = load("random_walk").cases[0]


def test_errors_are_the_exact_ones():
    """Within 5 standard errors at every scan; the seed is fixed, so this holds or fails for good."""
    curves = radarsim.run("random_walk", realisations=20_000).curves
    standard_error = (curves["sigma_hi"] - curves["sigma_lo"]) / 4
    assert (abs(curves["sigma"] - curves["exact_sigma"]) < 5 * standard_error).all()


def test_the_kernel_agrees_with_the_textbook():
    """A few lines of NumPy independent of the kernel, over the kernel's own plots."""
    for i in (0, 4099):
        columns = STUDY.recorded().simulated(CASE, i)
        plan = STUDY.prepare(CASE)
        error = plan.layout.unpack(STUDY.simulate(plan, i, 1))["error"]
        x, P, q, R = columns["x_m"][0], 1.0, 0.25, 1.0
        for k, z in enumerate(columns["x_m"]):
            if k:
                P += q
                x, P = x + P / (P + R) * (z - x), P * R / (P + R)
            assert error[1, k, 0, 0] == pytest.approx(x - columns["true_x_m"][k], abs=1e-12)
    assert plan.axes.exact_sigma[1, -1, 0] ** 2 == pytest.approx(P, rel=1e-12)


def test_a_realisation_is_itself_in_any_block():
    plan = STUDY.prepare(CASE)
    together = STUDY.simulate(plan, 5, 3)
    apart = sum(STUDY.simulate(plan, i, 1) for i in (5, 6, 7))
    np.testing.assert_allclose(together, apart, rtol=1e-12)


def test_the_error_tends_to_its_steady_value():
    variance = filters.error_variance(np.array([1.0, *[0.2] * 200]), 1.0, 0.5)
    assert variance[-1] == pytest.approx(filters.steady_variance(0.2, 1.0, 0.5), rel=1e-12)


def test_the_claim_is_confirmed():
    claims = radarsim.run("random_walk", realisations=20_000).tables["claims"]
    assert list(claims["overall"]) == ["confirmed"]


def test_a_missing_gain_is_a_fault_with_its_place():
    with pytest.raises(radarsim.ConfigError, match=r"filters\.0\.gain: is needed"):
        load("random_walk", ["filters.0={name: fixed, kind: fixed_gain}"])
