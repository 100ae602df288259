"""Floors under σ: equal to the exact errors of matched filters, to textbook twins, and below what is measured."""

import itertools

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api import configs
from radarsim.api.design.solve import TARGET_TOLERANCE
from radarsim.config.experiment import Case
from radarsim.config.find_files import SHIPPED
from radarsim.physics.motion import transition
from radarsim.physics.targets import fly_by_in_space
from radarsim.studies import registry
from radarsim.studies.floors import bound as floors_bound
from radarsim.studies.floors import floor_columns, missed_plots, moving, static
from radarsim.studies.floors.bound import ENUMERATION, LAGS, REDUCTION, Bound, Floor
from radarsim.studies.range_doppler.floor import derivatives
from radarsim.studies.sonar import target_motion
from radarsim.studies.sonar.floor import to_cartesian, to_polar
from radarsim.studies.sonar.least_squares import generalised_least_squares
from tests.tolerances import Z, assert_rounded, rounding, scaled_condition, sigma_error

EXACT = rounding(240, 15)  # κ of a parabola's information over fifteen scans, which are summed up; lines have 14


def of_case(config, *overrides: str):
    """Axes and floor of a config's only case."""
    (case,) = configs.load(config, overrides).cases
    return floor_of(case)


def floor_of(case: Case):
    study = registry.study(case.study)
    axes = study.prepare(case).axes
    return axes, study.floor(case.spec, axes)


def known(of: Floor, f: int) -> Bound:
    bound = of.below(f)
    assert bound is not None
    return bound


# ---- the matched linear case -----------------------------------------------------------------------------------------
def test_of_the_very_prior_the_kalman_filter_is_on_it_at_every_scan():
    """Range alone and range with unfolded velocity, of a target drawn from the filters' prior."""
    axes, floor = of_case("ambiguous_rls2", "filters.0.manoeuvre_variance=0", "filters.1.manoeuvre_variance=0")
    assert floor.kind == floors_bound.POSTERIOR
    for f in range(2):
        assert known(floor, f).is_attained
        assert known(floor, f).sigma == pytest.approx(axes.exact_sigma[f], rel=EXACT)
    assert not known(floor, list(axes.filters).index("memory")).is_attained


def test_of_a_polynomial_least_squares_is_on_it():
    """P1 where its start ends; growing memory, and both filters of correlated errors, at every scan."""
    axes, floor = of_case("rls2", "filters.0.initial_scans=9", "filters.1.initial_scans=9")
    assert floor.kind == floors_bound.CRB
    for f in range(2):
        assert known(floor, f).sigma[8] == pytest.approx(axes.exact_sigma[f, 8], rel=EXACT)
        assert (known(floor, f).sigma[9:] < axes.exact_sigma[f, 9:]).all()
    axes, floor = of_case("sonar_smoothing")
    own = axes.available[0]
    assert known(floor, 0).sigma[own] == pytest.approx(axes.exact_sigma[0][own], rel=EXACT)
    for case in configs.load("sonar_correlated").cases[::2]:
        axes, floor = floor_of(case)
        own = axes.available[1]
        # Errors correlated by up to 0.9: what is left of a difference is a tenth.
        tolerance = rounding(14 / (1 - 0.9), 20)
        assert known(floor, 1).sigma[own] == pytest.approx(axes.exact_sigma[1][own], rel=tolerance)


# ---- smoothing -------------------------------------------------------------------------------------------------------
def batch(rows: np.ndarray, sigma: np.ndarray, maps: np.ndarray, upto: int) -> np.ndarray:
    """σ (K, C) of components maps (K, C, p) by least squares on the plots of the first scans, rows (K, D, p)."""
    whitened = (rows / sigma[:, None])[:upto].reshape(-1, rows.shape[2])
    unit = np.linalg.norm(whitened, axis=0)
    inverse = np.linalg.pinv(whitened / unit)
    return np.linalg.norm(maps / unit @ inverse, axis=2)


def test_fixed_lag_and_fixed_interval_are_least_squares_on_more_plots():
    axes, floor = of_case("rls2")
    bound, maps, scans = known(floor, 1), static.polynomial(axes.t_s, 3), len(axes.t_s)
    rows, sigma = maps[:, :2], np.array([250.0, 15.0])
    assert bound.smoothed == pytest.approx(batch(rows, sigma, maps, scans), rel=EXACT)
    for i, lag in enumerate(LAGS):
        for k in range(2, scans - lag):
            assert bound.lagged[i, k] == pytest.approx(batch(rows, sigma, maps, k + lag + 1)[k], rel=EXACT)
        assert np.isnan(bound.lagged[i, scans - lag :]).all()
    last = scans - 1 - LAGS[-1]  # a lag to the last scan is the whole interval, no lag is the filter
    assert bound.lagged[-1, last] == pytest.approx(bound.smoothed[last], rel=EXACT)
    assert bound.smoothed[-1] == pytest.approx(bound.sigma[-1], rel=EXACT)


def unit_normals(F, Q, P, scans: int) -> np.ndarray:
    """States (K, n, K n) by the unit normals that make them: of the start, and of each push; Q and P are diagonal."""
    n = len(F)
    states = np.zeros((scans, n, scans * n))
    for k in range(scans):
        states[k] = F @ states[k - 1]
        states[k, :, k * n : (k + 1) * n] = np.sqrt(Q if k else P)
    return states


def with_prior(states, H, R, upto: int) -> np.ndarray:
    """Rows of the least squares for these normals, over unit errors: what they are drawn as, and the first plots."""
    plots = (H @ states / np.sqrt(R)[:, :, None])[:upto]
    return np.vstack([np.eye(states.shape[2]), plots.reshape(-1, states.shape[2])])


def conditional(states, H, R, upto: int) -> np.ndarray:
    """σ (K, n) of all states given the plots of the first scans."""
    return np.linalg.norm(states @ np.linalg.pinv(with_prior(states, H, R, upto)), axis=2)


def test_states_that_noise_moves_are_those_of_least_squares_for_all_that_moves_them():
    """The filter, fixed lag, and the Rauch-Tung-Striebel smoother, of a first covariance that is singular."""
    F, Q = transition(2.0, 3), np.diag([0.1, 0.02, 0.003])
    P, H = np.diag([4.0, 0.0, 0.5]), np.tile(np.eye(2, 3), (12, 1, 1))
    R = np.tile([3.0, 0.7], (12, 1))
    F_all, Q_all = (np.broadcast_to(one, (12, 3, 3)) for one in (F, Q))
    bound = moving.driven_bound(P, F_all, Q_all, H, R, 1.0, 3)
    states = unit_normals(F, Q, P, 12)
    known = [conditional(states, H, R, upto) for upto in range(1, 13)]
    tolerance = rounding(np.linalg.cond(with_prior(states, H, R, 12)), 36)  # sums of as many products
    for k in range(12):
        assert bound.sigma[k] == pytest.approx(known[k][k], rel=tolerance)
        assert bound.smoothed[k] == pytest.approx(known[11][k], rel=tolerance)
        for i, lag in enumerate(LAGS):
            if k + lag < 12:
                assert bound.lagged[i, k] == pytest.approx(known[k + lag][k], rel=tolerance)
    # as information, from next to nothing known: nearly a flat prior
    wide = np.diag([1e10, 1e8, 1e6])
    gained = np.einsum("kdi,kdj,kd->kij", H, H, 1 / R)
    flat = moving.moving_bound(np.zeros((3, 3)), gained, F_all, Q_all, 3)
    # Half of what the prior adds to the information, in units of what there is: at most its trace.
    prior = (flat.sigma[1:] ** 2 / np.diag(wide)).sum(axis=1, keepdims=True) / 2
    apart = moving.driven_bound(wide, F_all, Q_all, H, R, 1.0, 3).sigma[1:] / flat.sigma[1:] - 1
    assert (np.abs(apart) < prior + EXACT).all()
    assert np.isnan(flat.sigma[0]).tolist() == [False, False, True]


def test_a_fluctuating_target_is_generalised_least_squares_with_its_motion_as_noise():
    """Of a line with random accelerations: what they do to the plots about the line is a covariance of the plots."""
    axes, floor = of_case("sonar_smoothing", "target=sonar_fluctuating", "scans=9")
    assert floor.kind == floors_bound.POSTERIOR
    t, walk, sigma = axes.t_s, 0.05, 30.0
    pushes = np.zeros((9, 9, 2))  # of the acceleration before scan i to the state at scan k
    for i in range(1, 9):
        dt = t[i] - t[i - 1]
        for k in range(i, 9):
            pushes[k, i] = walk * transition(t[k] - t[i], 2) @ [dt**2 / 2, dt]
    for k in range(1, 9):
        since = pushes[: k + 1, :, 0] - np.column_stack([np.ones(k + 1), t[: k + 1] - t[k]]) @ pushes[k].T
        C = sigma**2 * np.eye(k + 1) + since @ since.T  # of the plots about the line through the state at k
        _, P = generalised_least_squares(t[: k + 1], C, 2)
        tolerance = rounding(scaled_condition(P) * np.linalg.cond(C), 9)
        assert known(floor, 0).sigma[k, :2] == pytest.approx(np.sqrt(np.diag(P)), rel=tolerance)


# ---- missed plots ----------------------------------------------------------------------------------------------------
def histories(scans: int, chance: float, needed: int, rows, sigma, maps, alone) -> tuple[np.ndarray, float]:
    """Root of the mean variance at the last scan over all detection histories in which there is an estimate.

    And the greatest κ of their informations.
    """
    total, share, condition = np.zeros(3), np.zeros(3), 1.0
    for came in itertools.product([False, True], repeat=scans):
        weight = chance ** sum(came) * (1 - chance) ** (scans - sum(came))
        whitened = (rows / sigma[:, None])[list(came)].reshape(-1, 3)
        if len(whitened) >= 3:
            condition = max(condition, scaled_condition(whitened.T @ whitened))
        for c in range(3):
            given = sum(came) >= needed or (came[-1] and alone[c])
            if given and len(whitened) >= 3:
                variance = maps[-1, c] @ np.linalg.inv(whitened.T @ whitened) @ maps[-1, c]
            elif given:
                variance = sigma[c] ** 2
            else:
                continue
            total[c], share[c] = total[c] + weight * variance, share[c] + weight
    with np.errstate(invalid="ignore"):
        return np.sqrt(total / share), condition


@pytest.mark.parametrize(("f", "start"), [(0, 3), (1, 2), (1, 5)])
def test_missed_plots_are_averaged_over_detection_histories(f, start, monkeypatch):
    monkeypatch.setattr(missed_plots, "IGNORED_SHARE", 0.0)
    scans, chance = 7, 0.7
    axes, floor = of_case(
        "rls2", f"radar.detection_probability={chance}", f"scans={scans}", f"filters.{f}.initial_scans={start}"
    )
    bound, maps = known(floor, f), static.polynomial(axes.t_s, 3)
    rows, sigma = maps[:, : f + 1], np.array([250.0, 15.0])[: f + 1]
    for k in range(1, scans):
        own, condition = histories(k + 1, chance, start, rows[: k + 1], sigma, maps[: k + 1], (True, f == 1, False))
        tolerance = rounding(condition, scans)
        assert bound.sigma[k] == pytest.approx(own, rel=tolerance, nan_ok=True)
    assert set(bound.patterns) == {ENUMERATION}
    there = np.isfinite(axes.exact_sigma[f])
    assert (bound.sigma[there] <= axes.exact_sigma[f][there] * (1 + tolerance)).all()
    assert np.isnan(bound.smoothed).all()


@pytest.mark.parametrize("most", [1, 16, 200])
def test_fewer_patterns_and_less_information_are_lower_bounds(monkeypatch, most):
    config = "rls2", "radar.detection_probability=0.8", "scans=11"
    whole = of_case(*config)[1]
    monkeypatch.setattr(missed_plots, "MAX_PATTERNS", most)
    less = of_case(*config)[1]
    for f in range(2):
        few, all_of = known(less, f), known(whole, f)
        there = np.isfinite(all_of.sigma)
        summed_up = 1 + rounding(operations=1 << 11)  # patterns that are the same
        assert (few.sigma[there] <= all_of.sigma[there] * summed_up).all()
        assert (few.sigma[-1] < all_of.sigma[-1]).all()
        assert not all_of.is_attained
    if most == 1:
        assert REDUCTION in few.patterns


def test_patterns_that_do_not_determine_a_component_count_as_nothing(monkeypatch):
    """A sonar has a range from the first plot on, and extrapolates it; what its rate is, no plot has told yet."""
    monkeypatch.setattr(missed_plots, "IGNORED_SHARE", 0.0)
    chance = 0.7
    missing = "sensor.missed_scans=[]", f"sweep.sensor.detection_probability=[{chance}]", "scans=8"
    axes, floor = of_case("sonar_missed", *missing)
    for k in range(1, 8):
        total, condition = 0.0, 1.0
        for came in itertools.product([False, True], repeat=k):
            t = axes.t_s[np.flatnonzero((True, *came))] - axes.t_s[k]
            A = np.column_stack([np.ones_like(t), t]) / 30.0
            if len(t) > 1:
                condition = max(condition, scaled_condition(A.T @ A))
                total += chance ** sum(came) * (1 - chance) ** (k - sum(came)) * np.linalg.inv(A.T @ A)[0, 0]
        assert known(floor, 0).sigma[k, 0] == pytest.approx(np.sqrt(total), rel=rounding(condition, 8))


def test_the_worst_patterns_are_left_out_where_they_are_rare(monkeypatch):
    """One plot alone in six scans, of a target of unknown velocity: once in 10⁵, and three quarters of the mean."""
    given = "ambiguous_rls4", "radar.detection_probability=0.9", "scans=6"
    bound = known(of_case(*given)[1], 1)
    kept = (
        1 - missed_plots.IGNORED_SHARE / (0.1 * 0.9 / 0.99) - EXACT
    )  # at the second scan the worst are those of one plot: a tenth
    monkeypatch.setattr(missed_plots, "IGNORED_SHARE", 0.0)
    whole = known(of_case(*given)[1], 1)
    assert (bound.sigma <= whole.sigma).all()
    assert (bound.sigma[:2] ** 2 >= kept * whole.sigma[:2] ** 2).all()
    assert whole.sigma[5, 0] > 1.9 * bound.sigma[5, 0]
    share, variance = np.array([0.5, 0.4999, 6e-5, 4e-5]), np.array([[1.0, 2, 1e3, 1e9]]).T
    monkeypatch.undo()
    # Of shares that are differences of sums of one, weighted by 1e3.
    assert_rounded(missed_plots.pattern_mean(share, variance, 1.0), [0.5 + 0.9998], size=1e3, operations=5)
    assert_rounded(missed_plots.pattern_mean(share, variance, 0.5), [2 * (0.5 + 0.9998 + 0.05)], size=2e3, operations=5)


def test_missed_plots_of_moving_states_are_averaged_too(monkeypatch):
    monkeypatch.setattr(missed_plots, "IGNORED_SHARE", 0.0)
    F, Q = transition(2.0, 2), np.diag([0.1, 0.02])
    H, R, P = np.tile(np.eye(1, 2), (6, 1, 1)), np.full((6, 1), 3.0), np.diag([4.0, 1.0])
    moves = np.broadcast_to(F, (6, 2, 2)), np.broadcast_to(Q, (6, 2, 2))
    bound, total = moving.driven_bound(P, *moves, H, R, 0.6, 2), np.zeros(2)
    for came in itertools.product([False, True], repeat=6):
        S = P
        for k, plot in enumerate(came):
            S = F @ S @ F.T + Q if k else S
            S = S - np.outer(S[:, 0], S[0]) / (S[0, 0] + 3.0) if plot else S
        total += 0.6 ** sum(came) * 0.4 ** (6 - sum(came)) * np.diag(S)
    assert_rounded(bound.sigma[-1], np.sqrt(total), condition=scaled_condition(S), operations=60)  # ten a scan
    monkeypatch.setattr(missed_plots, "MAX_PATTERNS", 1)
    less = moving.driven_bound(P, *moves, H, R, 0.6, 2)
    assert (less.sigma[-1] < bound.sigma[-1]).all()
    assert less.patterns[-1] == REDUCTION


# ---- random flights --------------------------------------------------------------------------------------------------
SPREAD = "sigma_position_m: 300, sigma_velocity_mps: 10"
FLY_BY = f"target={{kind: fly_by, distance_m: 9e3, speed_mps: 200, start_range_m: 20e3, {SPREAD}}}"


def test_derivatives_of_a_flight_are_differences():
    t = np.arange(6) * 10.0
    path = fly_by_in_space(9e3, 200.0, 20e3, t)
    from radarsim.studies.range_doppler.scenario import displaced_motion

    shifts = np.array([[300.0, -200, 50, 7, -4, 2], [-100, 150, 20, -5, 9, 1]])
    found = derivatives(path, shifts, t)
    for i in range(6):
        assert_derivative(
            found[..., i], lambda moved, i=i: displaced_motion(path, shifts + moved * np.eye(6)[i], t), 1.0
        )


def assert_derivative(found, value, step: float) -> None:
    """Differences of values (…, C) err by a third of what twice the step changes, and by rounding over the step."""
    near, far = ((value(h) - value(-h)) / (2 * h) for h in (step, 2 * step))
    axes = tuple(range(near.ndim - 1))
    rounded = rounding(operations=10) * np.abs(value(step)).max(axes) / step
    assert (np.abs(found - near) <= np.abs(far - near).max(axes) + rounded).all()


def test_an_estimator_that_knows_the_law_of_drawn_flights_is_just_above_their_floor():
    """Maximum a posteriori by Gauss-Newton of flights of one's own: the bound of Van Trees holds, and is nearly met."""
    axes, floor = of_case("rls2", FLY_BY)
    assert floor.kind == floors_bound.POSTERIOR
    bound = known(floor, 1)
    from radarsim.studies.range_doppler.scenario import displaced_motion

    rng, n, t = np.random.default_rng(5), 3000, axes.t_s
    path, spread = fly_by_in_space(9e3, 200.0, 20e3, t), np.array([300.0, 300, 0, 10, 10, 0])
    drawn = np.flatnonzero(spread)
    theta = rng.normal(size=(n, 6)) * spread
    truth = displaced_motion(path, theta, t)
    z = truth[..., :2] + rng.normal(size=(n, len(t), 2)) * [250.0, 15.0]
    found = np.zeros((n, 6))
    for _ in range(5):
        A = derivatives(path, found, t)[..., :2, :][..., drawn] / np.array([250.0, 15.0])[:, None]
        rest = (z - displaced_motion(path, found, t)[..., :2]) / [250.0, 15.0]
        J = np.einsum("mkdi,mkdj->mij", A, A) + np.diag(spread[drawn] ** -2.0)
        b = np.einsum("mkdi,mkd->mi", A, rest) - found[:, drawn] * spread[drawn] ** -2.0
        found[:, drawn] += np.linalg.solve(J, b[..., None])[..., 0]
    sigma = np.sqrt(np.mean((displaced_motion(path, found, t) - truth) ** 2, axis=0))
    least = 1 - sigma_error(n)
    assert (sigma[:, :2] / bound.smoothed[:, :2] > least).all()
    assert (sigma[:, :2] / bound.smoothed[:, :2] < 1.1).all()  # noise turns the line of sight little here
    assert (axes.exact_sigma[1, 2:] > bound.sigma[2:]).all()


# ---- the other frame -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("there", [to_polar, to_cartesian])
def test_derivatives_between_frames_are_differences(there):
    """Of a target's states with respect to its coefficients, against those of the world itself."""
    t = np.arange(5) * 20.0
    coefficients = [[9e3, -4.0], [0.35, 1e-3]] if there is to_cartesian else [[6e3, -4.0], [2e3, 7.0]]
    transform = target_motion.cartesian_states if there is to_cartesian else target_motion.polar_states
    own = np.zeros((5, 2, 3, 4))
    own[:, 0, :, :2] = own[:, 1, :, 2:] = static.polynomial(t, 2)
    states = np.stack(target_motion.polynomial_states(coefficients, t), axis=1)
    polar = states if there is to_cartesian else np.stack(transform(states[:, 0], states[:, 1]), axis=1)
    found = there(own, polar)
    for i in range(4):
        step = np.zeros(4)
        step[i] = [1.0, 1e-3, 1e-5, 1e-8][i] if there is to_cartesian else [1.0, 1e-3, 1.0, 1e-3][i]

        def moved(times, step=step / step[i]):
            at = (np.ravel(coefficients) + times * step).reshape(2, 2)
            return np.stack(transform(*target_motion.polynomial_states(at, t)), axis=1)[:, :, :2].reshape(len(t), 4)

        assert_derivative(found[:, :, :2, i].reshape(len(t), 4), moved, step[i])


# ---- what may lie below, and where there is none ---------------------------------------------------------------------
def test_a_biased_filter_lies_below_the_bound_of_unbiased_ones():
    """Its prior draws the estimates towards zero: least after few plots, where it knows what the bound does not."""
    (case,) = [one for one in configs.load("orders").cases if "polynomial" in one.name]
    axes, floor = floor_of(case)
    f = list(axes.filters).index("order 2 range only")
    below = axes.exact_sigma[f] < known(floor, f).sigma
    assert floor.kind == floors_bound.CRB
    assert below.any()
    spread = np.sqrt(axes.exact_sigma[f] ** 2 - axes.exact_bias[f] ** 2)
    assert (np.abs(axes.exact_bias[f][below]) > 0.01 * spread[below]).all()


def test_plain_conversion_lies_below_it():
    """Bearings that err by 8 degrees draw y = r sin e towards zero: E y² = (r² + σ²)(1 − exp(−2 σ_b²)) / 2."""
    given = "sweep.sensor.sigma_bearing_deg=[8]", "sweep.frame=[cartesian, cartesian_unbiased]", "scans=5"
    result = radarsim.run("sonar_conversion", realisations=40_000, overrides=given)
    both = result.curves.query("filter == 'growing' and component == 'y'")
    plain, unbiased = (rows.iloc[0] for _, rows in both.groupby("case"))
    spread = np.deg2rad(8)
    assert_rounded(plain["floor"], 15e3 * spread, operations=10)
    assert plain["sigma_hi"] < plain["floor"]
    expected, half = np.hypot(15e3, 30) * np.sqrt(-np.expm1(-2 * spread**2) / 2), plain["sigma_hi"] - plain["sigma"]
    assert plain["sigma"] == pytest.approx(expected, abs=Z / 1.96 * half)
    assert unbiased["sigma_hi"] > unbiased["floor"]


@pytest.mark.slow_cases("sonar_manoeuvre")
@pytest.mark.parametrize(
    "config", ["multimodel", "sonar_manoeuvre", "sonar_clutter", "ambiguous_orders", "discriminator_profile"]
)
def test_where_no_floor_is_defined_there_is_none(config):
    for case in configs.load(config).cases[:2]:
        study = registry.study(case.study)
        assert study.floor(case.spec, study.prepare(case).axes) is None


# ---- table, solve ----------------------------------------------------------------------------------------------------
def test_curves_have_the_floor_of_each_row_where_it_is_known():
    result = radarsim.run("rls2", realisations=50)
    curves, floors = result.curves, registry.study("range_doppler").floors(result.cases)
    assert (curves["floor"] <= curves["exact_sigma"] * (1 + EXACT)).all()
    assert set(curves["floor_kind"]) == {"CRB"}
    keys = ["case", "filter", "component", "unit", "k", "t_s", "floor"]
    assert floors[keys].equals(curves[keys])
    assert floors["reached"].all()


def test_rows_keep_their_order_and_notes_where_floors_are_joined():
    keys = {"case": "a", "filter": ["f", "g", "f"], "component": "r", "k": [2, 1, 1]}
    curves = pd.DataFrame({**keys, "sigma": [3.0, 2.0, 1.0], "note": ["", "few", ""]})
    known = pd.DataFrame(
        {"case": "a", "filter": "f", "component": "r", "k": [1, 2], "floor": [0.5, 0.25], "kind": "CRB"}
    )
    both = floor_columns.with_floors(curves, known)
    assert list(both["floor"].fillna(0)) == [0.25, 0, 0.5]
    assert list(both["floor_kind"]) == ["CRB", "", "CRB"]
    assert list(both.columns)[-4:] == ["believed_sigma", "floor", "floor_kind", "note"]
    assert both[curves.columns].equals(curves)
    assert floor_columns.with_floors(curves, known[:0])["floor"].isna().all()


def test_solve_answers_what_accuracy_a_floor_takes():
    found = radarsim.solve("rls2", "radar.sigma_velocity_mps", filter="r+Vr", at_s=60, equals=140, floor="r")
    assert found.exact
    _, floor = of_case("rls2", f"radar.sigma_velocity_mps={found.value!r}")
    assert known(floor, 1).sigma[6, 0] == pytest.approx(140, rel=TARGET_TOLERANCE)


def test_a_filter_from_outside_has_the_floor_of_all_plots():
    result = radarsim.judge("rls2", lambda plots: plots["range_m"], name="raw", realisations=200)
    rows = result.curves
    own, best = (rows[rows["filter"].eq(name) & rows["component"].eq("r")] for name in ("raw", "r+Vr"))
    assert np.array_equal(own["floor"], best["floor"])
    assert any(line.startswith("There the ") and "“raw” is" in line for line in result.answer)


# ---- all configs -----------------------------------------------------------------------------------------------------
FEW = {"discriminator": 300, "pulses_to_tracks": 500}
MISSED = {"ambiguous_missed": 50_000, "sonar_missed": 50_000}  # with fewer, rare patterns of plots are not seen
STEMS = [path.stem for path in (SHIPPED / "configs").glob("*.yaml")]
BIASED = {"orders"}  # the filters have a prior about zero: see above
MIXED = rounding(1e5, 20)  # κ of the worst patterns of missed plots, extrapolated over twenty scans


@pytest.mark.slow
@pytest.mark.parametrize("stem", sorted(set(STEMS) - BIASED))
def test_below_every_measured_sigma(stem):
    """But for chance: Z standard errors of σ, of the realisations that count."""
    experiment = configs.load(stem)
    result = radarsim.run(experiment, realisations=MISSED.get(stem) or FEW.get(experiment.study, 2000))
    both = result.curves.dropna(subset="floor")
    assert len(both) == len(registry.study(experiment.study).floors(result.cases))
    exact = both["exact_sigma"].notna() & (experiment.study != "discriminator")
    assert (both["exact_sigma"][exact] >= both["floor"][exact] * (1 - MIXED)).all()
    counted = both[both["n_eff"].fillna(0) >= 50]
    ratio = counted["sigma"] / counted["floor"]
    assert len(counted) > len(both) / 2 or not len(both)
    assert (ratio > 1 - Z / np.sqrt(4 * counted["n_eff"])).all(), counted[ratio < 1]
