"""Tests that prove the study. Yours: a test for each way in which it could be wrong."""

import pytest
import radarsim
from radarsim.api.configs import load

from random_walk import STUDY

CASE = load("random_walk").cases[0]


def test_the_kernel_agrees_with_the_textbook():
    """A few lines independent of the kernel, over the kernel's own plots."""
    columns = STUDY.recording_interface().simulated(CASE, 7)
    plan = STUDY.prepare(CASE)
    error = plan.layout.unpack(STUDY.simulate(plan, 7, 1))["error"]
    x, P, q, R = 0.0, 100.0, 0.25, 1.0
    for k, z in enumerate(columns["x_m"]):
        P = P + q if k else P
        x, P = x + P / (P + R) * (z - x), P * R / (P + R)
        assert error[1, k, 0, 0] == pytest.approx(x - columns["true_x_m"][k], abs=1e-12)
    assert plan.axes.exact_sigma[1, -1, 0] ** 2 == pytest.approx(P, rel=1e-12)


def test_the_claims_are_confirmed():
    claims = radarsim.run("random_walk", realisations=20_000).tables["claims"]
    assert list(claims["as_shipped"]) == ["confirmed", "confirmed"]
