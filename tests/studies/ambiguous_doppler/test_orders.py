"""Filters of several orders: textbook twins, exact errors, bounds, and what the published experiment finds."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.physics import targets
from radarsim.studies.ambiguous_doppler import exact_errors, filter_design, study
from radarsim.studies.ambiguous_doppler.filter_design import Member
from radarsim.studies.ambiguous_doppler.kernels import layout, realisations
from tests.studies.ambiguous_doppler import naive
from tests.studies.ambiguous_doppler.conftest import RANGE_ONLY, make_case, plan_and_sums, tolerances
from tests.tolerances import Z, assert_rounded, rounding

ALL = {"orders": [0, 1, 2], "manoeuvre_variance": [9e4, 4.0, 1e-3]}
LIKELIHOOD = {"name": "likelihood", "combine": "likelihood"} | ALL
EXPECTED = {"name": "expected error", "combine": "expected_error"} | ALL
EXPECTED |= {"manoeuvres": {"acceleration_mps2": 20.0, "duration_s": 30.0}}
INTERSECTION = {"name": "intersection", "combine": "intersection"} | ALL
PULSE = {"kind": "acceleration_pulse", "coefficients": [100e3, -250.0], "acceleration_g": 2.0}
PULSE |= {"start_s": 60.0, "duration_s": 30.0}


def outputs(case):
    plan = study.prepare(case)
    plots, out = realisations.simulate_outputs(plan.world, plan.banks, 8)
    columns = plots[:, [layout.RANGE, layout.VELOCITY, layout.UNFOLDED, layout.DETECTED]]
    return plan, columns, out


def textbook_filters(case):
    """The textbook filters of the first filter's orders."""
    return [
        naive.Kalman(
            SimpleNamespace(orders=(m.order,), variances=(m.manoeuvre_variance,), doppler=m.doppler),
            case.spec.prior,
            (250.0, 15.0),
            10.0,
        )
        for m in filter_design.members(case.spec.filters[0])
    ]


@pytest.mark.slow_cases("folded-1.0")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize("doppler", ["none", "unfolded", "folded"])
def test_interacting_orders(doppler, detection):
    merged = {"merge": "each_scan"} if doppler == "folded" else {}
    case = make_case("RLS 2", [LIKELIHOOD | {"doppler": doppler} | merged], 12, PULSE, detection_probability=detection)
    plan, plots, out = outputs(case)
    for lane in range(4):
        lane_plots = plots[:, :, lane]
        x, mu = naive.interacting_states(
            textbook_filters(case), lane_plots, plan.world.spans, 0.95, 40 if doppler == "folded" else 0
        )
        has_started = np.cumsum(lane_plots[:, 3]) > 0
        of_estimates, of_weights = tolerances(case, lane_plots[:, 3])
        assert (np.abs(out[0, :, :3, lane] - x)[has_started] <= of_estimates).all()
        assert np.abs(out[0, :, layout.WEIGHTS :, lane] - mu)[has_started].max() < of_weights


@pytest.mark.slow_cases("two orders-1.0", "twelve-1.0")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize(
    ("max_hypotheses", "prune_below", "orders"),
    [
        pytest.param(12, 1e-6, [0, 1, 2], id="twelve"),
        pytest.param(40, 1e-4, [0, 1, 2], id="deep", marks=pytest.mark.slow),
        pytest.param(25, 0.0, [1, 2], id="two orders"),
        pytest.param(1, 1e-6, [1, 2], id="nearest fold"),
    ],
)
def test_orders_within_remembered_hypotheses(max_hypotheses, prune_below, orders, detection):
    """The IMM over orders and folds is its textbook twin: estimates, the best, what is right, weights of orders."""
    variances = [9e4, 4.0, 1e-3][-len(orders) :]
    options = {
        "hypotheses": max_hypotheses,
        "prune_below": prune_below,
        "orders": orders,
        "manoeuvre_variance": variances,
    }
    keys = {"detection_probability": detection, "repetition_rate_hz": [1000.0, 1200.0]}
    filters = [LIKELIHOOD | options | {"doppler": "folded", "name": how, "estimate": how} for how in ("mean", "best")]
    case = make_case("RLS 2", filters, 6, PULSE | {"start_s": 20.0, "duration_s": 10.0}, **keys)
    plan, plots, out = outputs(case)
    assert len(out) == 1  # the two filters share a list
    assert plan.banks.estimate_field.tolist() == [layout.MEAN, layout.BEST]
    for lane in range(2):
        lane_plots = plots[:, :, lane]
        expected = naive.interacting_hypothesis_outputs(
            textbook_filters(case), lane_plots, plan.world.spans, 0.95, max_hypotheses, prune_below, 24
        )
        has_started = np.cumsum(lane_plots[:, 3]) > 0
        exactly = [layout.RIGHT, layout.LISTED, layout.COUNT]
        if prune_below > 0:  # beyond twenty-four folds the twin has none
            assert np.array_equal(out[0][has_started][:, exactly, lane], expected[has_started][:, exactly])
        difference = (out[0, :, : layout.WEIGHTS, lane] - expected[:, : layout.WEIGHTS])[has_started]
        of_estimates, of_weights = tolerances(case, lane_plots[:, 3])
        assert (np.abs(difference[:, :6]) <= np.tile(of_estimates, 2)).all()
        assert np.abs(difference[:, layout.PROBABILITY]).max() < of_weights
        mu = out[0, :, layout.WEIGHTS :, lane][:, orders]
        assert np.abs(mu - expected[:, layout.WEIGHTS :])[has_started].max() < of_weights


def test_combinations_use_the_estimates_of_their_members():
    """`estimate: best` of a combination is that of its members."""
    options = INTERSECTION | {"doppler": "folded"}
    case = make_case("RLS 2", [options | {"estimate": how, "name": how} for how in ("mean", "best")], 6, PULSE)
    plan, _, out = outputs(case)
    for f, place in enumerate((layout.MEAN, layout.BEST)):
        bank = plan.banks.bank[f]
        parts = out[plan.banks.members[bank, :6]][:, :, place : place + 3]
        assert (np.abs(parts - out[bank][None, :, :3]).min(axis=0) == 0).all()
    assert np.abs(out[plan.banks.bank[0]] - out[plan.banks.bank[1]]).max() > 1


def test_intersection_of_intervals():
    case = make_case("RLS 2", [INTERSECTION | {"doppler": "unfolded"}], 15, PULSE)
    plan, _, out = outputs(case)
    options, widths = case.spec.filters[0], plan.banks.shares[plan.banks.bank[0]]
    members, member_outputs = filter_design.members(options), out[plan.banks.bank[0]]
    parts = out[plan.banks.members[plan.banks.bank[0], : len(members)]]
    chosen_orders = set()
    for k in range(15):
        for lane in range(8):
            for c in range(3):
                i = naive.smoothest_meeting(parts[:, k, c, lane], widths[k, : len(members), c])
                assert member_outputs[k, c, lane] == (0.0 if i is None else parts[i, k, c, lane])
                if c == 0:
                    assert member_outputs[k, layout.WEIGHTS + members[i].order, lane] == 1
                    chosen_orders.add(members[i])
    assert len(chosen_orders) > 2  # through a manoeuvre it changes


def test_expected_error_is_exact_and_above_the_best_combination():
    n = 50_000
    plan, summed = plan_and_sums(make_case("RLS 2", [RANGE_ONLY, EXPECTED | {"doppler": "unfolded"}], 15, PULSE), n)
    sigma = np.sqrt(summed.error[1, :, :, 1] / n)
    is_known = plan.axes.exact_sigma[1] > 0
    z = (sigma / np.where(is_known, plan.axes.exact_sigma[1], 1) - 1)[is_known] * np.sqrt(2 * n)
    assert np.abs(z).max() < Z
    summed_up = 1 + rounding(operations=100)  # at the first plot, whose range all orders take, errors are equal
    assert (plan.axes.best_combination[1] <= plan.axes.exact_sigma[1] * summed_up).all()
    assert (plan.axes.best_combination[1] <= plan.axes.best_order[1] * summed_up).all()


def test_best_shares():
    """Against the solution of the constrained problem by hand: two independent errors of variances 1 and 3."""
    E = np.broadcast_to(np.diag([1.0, 3.0]), (1, 3, 2, 2))
    expected = np.broadcast_to(np.array([0.75, 0.25])[None, :, None], (1, 2, 3))
    assert_rounded(exact_errors.best_shares(E, np.ones((2, 3), bool)), expected, condition=3, operations=5)
    single_shares = exact_errors.best_shares(E, np.array([[True, False, False], [True, True, False]]))
    assert_rounded(single_shares[0], [[0.75, 0, 0], [0.25, 1, 0]], condition=3, operations=5)
    certain = np.broadcast_to(np.diag([0.0, 3.0]), (1, 3, 2, 2))
    assert exact_errors.best_shares(certain, np.ones((2, 3), bool))[0, :, 0].tolist() == [1, 0]


def test_published_numbers_of_the_manoeuvre():
    """RLS 2, σ_r at 140 s after 2 g for 30 s, m, as two trials had it, with 20 m/s² for 2 g.

    Orders 1 and 2 with the velocity, and the best combination of both orders with the velocity and without.
    """
    spec, t = load("orders").cases[1].spec, np.arange(15) * 10.0
    members = [Member(order, how, {1: 4.0, 2: 1e-3}[order]) for how in ("unfolded", "none") for order in (1, 2)]
    gains = [exact_errors.kalman_gains(sigma_1, spec.prior, np.array([250.0, 15.0]), 10.0, 15) for sigma_1 in members]
    motion = targets.acceleration_pulse([100e3, -250.0], 20.0, 60.0, 30.0, t)
    bias, noise = exact_errors.linear_errors(gains, motion[None], np.array([250.0, 15.0]))
    E = exact_errors.joint_moments(bias, noise, np.ones(1))[-1, 0]
    assert np.sqrt(np.diag(E)[:2]) == pytest.approx([162, 347], abs=0.5)  # as printed
    assert 1 / np.sqrt(np.linalg.inv(E).sum()) == pytest.approx(155, abs=0.5)
    sigma_1, sigma_2 = np.sqrt([noise[-1, i, 0, i, 0] for i in range(2)])
    assert sigma_1 / sigma_2 == pytest.approx(1.01, abs=0.005)  # without a manoeuvre


def test_the_shipped_cases_of_orders():
    """The config's own 2 g are standard gravities, 19.6 m/s²; on the quadratic and the fly-by order 2 is best."""
    names = ("order 0", "order 1", "order 2")
    errors_by_case = {}
    for case in load("orders").cases:
        axes = study.prepare(case).axes
        errors_by_case[case.spec.target.kind] = [axes.exact_sigma[axes.filters.index(name), -1, 0] for name in names]
    assert errors_by_case["acceleration_pulse"] == pytest.approx([178.3, 161.5, 341.8], abs=0.05)  # as printed
    assert errors_by_case["polynomial"][2] < errors_by_case["polynomial"][1] < errors_by_case["polynomial"][0]
    assert errors_by_case["fly_by"][2] < errors_by_case["fly_by"][1] < errors_by_case["fly_by"][0]
