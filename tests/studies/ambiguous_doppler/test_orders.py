"""Filters of several orders: textbook twins, exact errors, bounds, and what the published experiment finds."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarsim import physics
from radarsim.app.configs import load
from radarsim.studies.ambiguous_doppler import filters, study
from radarsim.studies.ambiguous_doppler.filters import Member
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from tests.studies.ambiguous_doppler import naive
from tests.studies.ambiguous_doppler.conftest import RANGE_ONLY, made, summed, tolerances
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
    plots, out = sums.simulate_outputs(plan.world, plan.banks, 8)
    columns = plots[:, [records.RANGE, records.VELOCITY, records.UNFOLDED, records.DETECTED]]
    return plan, columns, out


def twins(case):
    """The textbook filters of the first filter's orders."""
    return [
        naive.Kalman(
            SimpleNamespace(orders=(m.order,), variances=(m.manoeuvre_variance,), doppler=m.doppler),
            case.spec.prior,
            (250.0, 15.0),
            10.0,
        )
        for m in filters.members(case.spec.filters[0])
    ]


@pytest.mark.slow_cases("folded-1.0")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize("doppler", ["none", "unfolded", "folded"])
def test_interacting_orders(doppler, detection):
    merged = {"merge": "each_scan"} if doppler == "folded" else {}
    case = made("RLS 2", [LIKELIHOOD | {"doppler": doppler} | merged], 12, PULSE, detection_probability=detection)
    plan, plots, out = outputs(case)
    for lane in range(4):
        own = plots[:, :, lane]
        x, mu = naive.interacting(twins(case), own, plan.world.spans, 0.95, 40 if doppler == "folded" else 0)
        there = np.cumsum(own[:, 3]) > 0
        of_estimates, of_weights = tolerances(case, own[:, 3])
        assert (np.abs(out[0, :, :3, lane] - x)[there] <= of_estimates).all()
        assert np.abs(out[0, :, records.WEIGHTS :, lane] - mu)[there].max() < of_weights


@pytest.mark.slow_cases("two orders-1.0", "twelve-1.0")
@pytest.mark.parametrize("detection", [1.0, 0.6])
@pytest.mark.parametrize(
    ("most", "prune_below", "orders"),
    [
        pytest.param(12, 1e-6, [0, 1, 2], id="twelve"),
        pytest.param(40, 1e-4, [0, 1, 2], id="deep", marks=pytest.mark.slow),
        pytest.param(25, 0.0, [1, 2], id="two orders"),
        pytest.param(1, 1e-6, [1, 2], id="nearest fold"),
    ],
)
def test_orders_within_remembered_hypotheses(most, prune_below, orders, detection):
    """The IMM over orders and folds is its textbook twin: estimates, the best, what is right, weights of orders."""
    variances = [9e4, 4.0, 1e-3][-len(orders) :]
    options = {"hypotheses": most, "prune_below": prune_below, "orders": orders, "manoeuvre_variance": variances}
    keys = {"detection_probability": detection, "repetition_rate_hz": [1000.0, 1200.0]}
    filters = [LIKELIHOOD | options | {"doppler": "folded", "name": how, "estimate": how} for how in ("mean", "best")]
    case = made("RLS 2", filters, 6, PULSE | {"start_s": 20.0, "duration_s": 10.0}, **keys)
    plan, plots, out = outputs(case)
    assert len(out) == 1  # the two filters share a list
    assert plan.banks.estimate_field.tolist() == [records.MEAN, records.BEST]
    for lane in range(2):
        own = plots[:, :, lane]
        found = naive.together(twins(case), own, plan.world.spans, 0.95, most, prune_below, 24)
        there = np.cumsum(own[:, 3]) > 0
        exactly = [records.RIGHT, records.LISTED, records.COUNT]
        if prune_below > 0:  # beyond twenty-four folds the twin has none
            assert np.array_equal(out[0][there][:, exactly, lane], found[there][:, exactly])
        apart = (out[0, :, : records.WEIGHTS, lane] - found[:, : records.WEIGHTS])[there]
        of_estimates, of_weights = tolerances(case, own[:, 3])
        assert (np.abs(apart[:, :6]) <= np.tile(of_estimates, 2)).all()
        assert np.abs(apart[:, records.PROBABILITY]).max() < of_weights
        mu = out[0, :, records.WEIGHTS :, lane][:, orders]
        assert np.abs(mu - found[:, records.WEIGHTS :])[there].max() < of_weights


def test_combinations_read_what_their_members_estimate():
    """`estimate: best` of a combination is that of its members."""
    options = INTERSECTION | {"doppler": "folded"}
    case = made("RLS 2", [options | {"estimate": how, "name": how} for how in ("mean", "best")], 6, PULSE)
    plan, _, out = outputs(case)
    for f, place in enumerate((records.MEAN, records.BEST)):
        bank = plan.banks.bank[f]
        parts = out[plan.banks.members[bank, :6]][:, :, place : place + 3]
        assert (np.abs(parts - out[bank][None, :, :3]).min(axis=0) == 0).all()
    assert np.abs(out[plan.banks.bank[0]] - out[plan.banks.bank[1]]).max() > 1


def test_intersection_of_intervals():
    case = made("RLS 2", [INTERSECTION | {"doppler": "unfolded"}], 15, PULSE)
    plan, _, out = outputs(case)
    one, widths = case.spec.filters[0], plan.banks.shares[plan.banks.bank[0]]
    members, own = filters.members(one), out[plan.banks.bank[0]]
    parts = out[plan.banks.members[plan.banks.bank[0], : len(members)]]
    seen = set()
    for k in range(15):
        for lane in range(8):
            for c in range(3):
                i = naive.intersected(parts[:, k, c, lane], widths[k, : len(members), c])
                assert own[k, c, lane] == (0.0 if i is None else parts[i, k, c, lane])
                if c == 0:
                    assert own[k, records.WEIGHTS + members[i].order, lane] == 1
                    seen.add(members[i])
    assert len(seen) > 2  # through a manoeuvre it changes


def test_expected_error_is_exact_and_never_beats_the_clairvoyant():
    n = 50_000
    plan, found = summed(made("RLS 2", [RANGE_ONLY, EXPECTED | {"doppler": "unfolded"}], 15, PULSE), n)
    sigma = np.sqrt(found.error[1, :, :, 1] / n)
    known = plan.axes.exact_sigma[1] > 0
    z = (sigma / np.where(known, plan.axes.exact_sigma[1], 1) - 1)[known] * np.sqrt(2 * n)
    assert np.abs(z).max() < Z
    summed_up = 1 + rounding(operations=100)  # at the first plot, whose range all orders take, errors are equal
    assert (plan.axes.best_combination[1] <= plan.axes.exact_sigma[1] * summed_up).all()
    assert (plan.axes.best_combination[1] <= plan.axes.best_order[1] * summed_up).all()


def test_shares_of_least_error():
    """Against the solution of the constrained problem by hand: two independent errors of variances 1 and 3."""
    E = np.broadcast_to(np.diag([1.0, 3.0]), (1, 3, 2, 2))
    expected = np.broadcast_to(np.array([0.75, 0.25])[None, :, None], (1, 2, 3))
    assert_rounded(filters.best_shares(E, np.ones((2, 3), bool)), expected, condition=3, operations=5)
    alone = filters.best_shares(E, np.array([[True, False, False], [True, True, False]]))
    assert_rounded(alone[0], [[0.75, 0, 0], [0.25, 1, 0]], condition=3, operations=5)
    certain = np.broadcast_to(np.diag([0.0, 3.0]), (1, 3, 2, 2))
    assert filters.best_shares(certain, np.ones((2, 3), bool))[0, :, 0].tolist() == [1, 0]


def test_published_numbers_of_the_manoeuvre():
    """RLS 2, σ_r at 140 s after 2 g for 30 s, m, as two trials had it, with 20 m/s² for 2 g.

    Orders 1 and 2 with the velocity, and the best combination of both orders with the velocity and without.
    """
    spec, t = load("orders").cases[1].spec, np.arange(15) * 10.0
    members = [Member(order, how, {1: 4.0, 2: 1e-3}[order]) for how in ("unfolded", "none") for order in (1, 2)]
    of = [filters.kalman_gains(one, spec.prior, np.array([250.0, 15.0]), 10.0, 15) for one in members]
    motion = physics.acceleration_pulse([100e3, -250.0], 20.0, 60.0, 30.0, t)
    bias, noise = filters.linear_errors(of, motion[None], np.array([250.0, 15.0]))
    E = filters.joint_moments(bias, noise, np.ones(1))[-1, 0]
    assert np.sqrt(np.diag(E)[:2]) == pytest.approx([162, 347], abs=0.5)  # as printed
    assert 1 / np.sqrt(np.linalg.inv(E).sum()) == pytest.approx(155, abs=0.5)
    one, two = np.sqrt([noise[-1, i, 0, i, 0] for i in range(2)])
    assert one / two == pytest.approx(1.01, abs=0.005)  # without a manoeuvre


def test_the_shipped_cases_of_orders():
    """The config's own 2 g are standard gravities, 19.6 m/s²; on the quadratic and the fly-by order 2 is best."""
    names = ("order 0", "order 1", "order 2")
    found = {}
    for case in load("orders").cases:
        axes = study.prepare(case).axes
        found[case.spec.target.kind] = [axes.exact_sigma[axes.filters.index(name), -1, 0] for name in names]
    assert found["acceleration_pulse"] == pytest.approx([178.3, 161.5, 341.8], abs=0.05)  # as printed
    assert found["polynomial"][2] < found["polynomial"][1] < found["polynomial"][0]
    assert found["fly_by"][2] < found["fly_by"][1] < found["fly_by"][0]
