"""Tests that prove the study. Yours: a test for each way in which it could be wrong."""

import math

import pytest
from random_walk import STUDY

import radarsim
from radarsim.api.configs import load

CASE = load("random_walk").cases[0]


def test_the_kernel_agrees_with_the_textbook():
    """A few lines independent of the kernel, over the kernel's own plots."""
    columns = STUDY.recording_interface().simulated(CASE, 7)
    plan = STUDY.prepare(CASE)
    error = plan.layout.unpack(STUDY.simulate(plan, 7, 1))["error"]
    x, P, h, q, R = 100.0, 25.0, 100.0, 0.25, 0.49
    for k, z in enumerate(columns["range_m"]):
        P = P + q if k else P
        H = x / math.hypot(x, h)
        K = P * H / (H * P * H + R)
        x, P = x + K * (z - math.hypot(x, h)), P - K * H * P
        assert error[1, k, 0, 0] == pytest.approx(x - columns["true_x_m"][k], abs=1e-10)


def test_the_claim_is_confirmed_and_the_filter_believes_what_is_true():
    tables = radarsim.run("random_walk", realisations=20_000).tables
    assert list(tables["claims"]["as_shipped"]) == ["confirmed"]
    filtered = tables["curves"].dropna(subset="believed_sigma")
    assert (filtered["sigma"] / filtered["believed_sigma"]).to_numpy() == pytest.approx(1, abs=0.05)
