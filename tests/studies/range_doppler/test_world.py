"""P1's world beyond the paper: missed plots, biases, drawn starts, other targets and process noises, D_M looked for.

Exact values against textbook filters over every pattern of plots; the kernel against a textbook filter over its own
plots; then the sums of many realisations against the exact values.
"""

import itertools

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.kernels.kalman_algebra import pack
from radarsim.kernels.random import fill_normal_pairs
from radarsim.physics.motion import process_noise
from radarsim.studies.range_doppler import best_variance, missed_plot_means, missed_plot_patterns, scenario, study
from radarsim.studies.range_doppler.error_recursion import Plots
from radarsim.studies.range_doppler.kernels import missed_block
from tests.studies.range_doppler import naive
from tests.tolerances import Z, assert_rounded, rounding, scaled_condition, share_error

TURN = {
    "kind": "turn",
    "range_m": 6e4,
    "speed_mps": 250,
    "aspect_deg": 180,
    "start_s": 35,
    "acceleration_g": 1,
    "duration_s": 20,
}
DRAWN = {"sigma_position_m": 2000, "sigma_velocity_mps": 25}
FLY_BY = {"kind": "fly_by", "distance_m": 15e3, "speed_mps": 300, "start_range_m": 40e3}
SIGMA, DT, VARIANCE = np.array([60.0, 2.0]), 10.0, 0.05
STARTS = ((1, 3), (2, 2))


def precision_of(P, observes, Q, scans=9, dt=DT):
    """Of σ of a filter that believes covariances P (n, 3, 3), over all scans."""
    return naive.precision(P, scans, naive.update_loss(P, Q, SIGMA[:observes], dt))


# Where every plot comes.
PRECISION = max(
    precision_of(naive.kalman(np.zeros((9, 2)), *of, VARIANCE, SIGMA, DT)[1][2:], of[0], naive.manoeuvre(VARIANCE, DT))
    for of in STARTS
)


def prepared(**changes):
    """The plan of a case of an S-band radar."""
    return study.prepare(case_of(**changes))


def case_of(**changes):
    """A case of an S-band radar."""
    radar = {"wavelength_m": 0.1, "sigma_range_m": SIGMA[0], "sigma_velocity_mps": SIGMA[1], "scan_period_s": DT}
    filters = [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": VARIANCE},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": VARIANCE},
    ]
    made = {"study": "range_doppler", "radar": radar, "target": TURN, "filters": filters, "scans": 9}
    made["realisations"] = 1000
    for key, value in changes.items():
        if key == "every_filter":
            made["filters"] = [one | value for one in filters]
        else:
            made[key] = made[key] | value if key == "radar" else value
    return load(made).cases[0]


def sums_of(plan, count, first=0):
    """Sums of `count` realisations by name."""
    values = [study.simulate(plan, i, min(plan.block, count - i)) for i in range(0, count, plan.block)]
    return plan.layout.unpack(np.sum(values, axis=0) if not first else study.simulate(plan, first, count))


# ---- one realisation ------------------------------------------------------------------------------------------------


def textbook(plots, observes, start, Q, dt=DT, sigma=SIGMA):
    """A filter over plots (K, 2), not-a-number where missed: estimates (K, 3) and covariances (K, 3, 3)."""
    B, H, R = naive.transition(dt), np.eye(3)[:observes], np.diag(sigma[:observes] ** 2)
    x, P, held = None, None, []
    estimates, covariances = np.full((len(plots), 3), np.nan), np.full((len(plots), 3, 3), np.nan)
    for k, z in enumerate(plots):
        came = np.isfinite(z[0])
        if x is not None:
            x, P = B @ x, B @ P @ B.T + Q
            if came:
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
                x, P = x + K @ (z[:observes] - H @ x), P - K @ H @ P
        elif came:
            held.append((k, z[:observes]))
            estimates[k, :observes] = z[:observes]
            if len(held) == start:
                A = np.concatenate([H @ naive.transition((at - k) * dt) for at, _ in held])
                W = np.kron(np.eye(start), np.linalg.inv(R))
                P = np.linalg.inv(A.T @ W @ A)
                x = P @ A.T @ W @ np.concatenate([value for _, value in held])
        if x is not None:
            estimates[k], covariances[k] = x, P
    return estimates, covariances


@pytest.mark.parametrize(
    "changes",
    [
        {"radar": {"detection_probability": 0.7}},
        {"radar": {"detection_probability": 0.6}, "every_filter": {"initial_scans": 4, "process_noise": "white_jerk"}},
        {"radar": {"bias_range_m": 100, "sigma_bias_velocity_mps": 3, "sigma_bias_range_m": 50}},
        {"radar": {"detection_probability": 0.5, "scan_period_s": 0.01}, "scans": 30},
        {"target": TURN | DRAWN, "radar": {"detection_probability": 0.7}},
        {"target": FLY_BY | DRAWN},
    ],
)
def test_each_realisation_is_that_of_a_textbook_filter(changes):
    plan = prepared(**changes)
    problem, dt = plan.problem, plan.problem.dt
    assert isinstance(problem, missed_block.Problem)
    Q = np.zeros((2, 3, 3))
    Q[:, *np.triu_indices(3)] = problem.Q
    Q = Q + np.triu(Q[0], 1).T
    for realisation in (1, 1030):
        (plots,), (truth,) = missed_block.simulate_plots(problem, realisation, 1)
        sums = sums_of(plan, 1, realisation)
        for f, observes in enumerate(problem.observes):
            x, P = textbook(plots, observes, problem.start[f], Q[f], dt)
            e = x - truth
            there = np.isfinite(e)
            np.testing.assert_array_equal(sums["estimates"][f] == 1, there)
            scale = np.sqrt(np.nanmax(np.diagonal(P, axis1=1, axis2=2), axis=0))
            found, wanted = sums["error"][f, ..., 0] / scale, np.where(there, e, 0) / scale
            started = np.isfinite(P[:, 0, 0])
            tolerance = precision_of(P[started], observes, Q[f], len(P), dt)
            rounded = (
                tolerance * np.abs(truth[:, 0]).max() / scale[0]
            )  # estimates are of the size of ranges, errors of σ
            np.testing.assert_allclose(found, wanted, rtol=0, atol=rounded)
            q = np.array([e[k] @ np.linalg.solve(P[k], e[k]) / 3 for k in np.flatnonzero(started)])
            crossed = 2 * rounded * np.sqrt(q.max() * scaled_condition(P[started]).max())  # |P^(-1/2) e| |P^(-1/2) δe|
            np.testing.assert_allclose(sums["nees"][f, started, 1], q, rtol=tolerance, atol=crossed)
            own = np.diagonal(P, axis1=1, axis2=2)[started]
            np.testing.assert_allclose(sums["believed"][f, started], own, rtol=tolerance)
            e_f, e_b = sums["error"][f, ..., 0], sums["error"][problem.baseline, ..., 0]
            both = there & (sums["estimates"][problem.baseline] == 1)
            pairs = np.stack([both, e_f**2, e_f**4, e_b**2, e_b**4], axis=-1) * both[..., None]
            assert_rounded(sums["both"][f], pairs, operations=4)
            assert_rounded(sums["paired"][f], both * e_f**2 * e_b**2, operations=4)
            crossed = np.stack([e_f[:, 0] * e_f[:, 1], e_f[:, 0] * e_f[:, 2], e_f[:, 1] * e_f[:, 2]], axis=-1)
            assert_rounded(sums["cross"][f], crossed, operations=1)


# ---- exact values ---------------------------------------------------------------------------------------------------


def over_all_patterns(truth, observes, start, Q, plots, scans):
    """Probability of an estimate, means of e, e², e⁴ and of eᵀP⁻¹e/3 by brute force: each pattern's textbook filter.

    Last to what rounding σ is known, of the pattern in which least so.

    The error is linear in the plots' errors, so that its covariance follows from the answers to one error each.
    """
    p, sums = plots.detection, [np.zeros((scans, 3)) for _ in range(4)]
    nees, started, precision = np.zeros(scans), np.zeros(scans), 0.0
    exact_plots = truth[:, :2] + plots.bias
    for pattern in itertools.product((True, False), repeat=scans):
        came = np.array(pattern)
        weight = p ** came.sum() * (1 - p) ** (~came).sum()

        def errors(z, came=came):
            return textbook(np.where(came[:, None], z, np.nan), observes, start, Q)

        x, P = errors(exact_plots)
        answers = []
        for m, k in itertools.product(range(observes), np.flatnonzero(came)):
            z = exact_plots.copy()
            z[k, m] += 1000 * plots.sigma[m]
            answers.append((errors(z)[0] - x) / 1000)
        for m in np.flatnonzero(plots.sigma_bias):
            z = exact_plots.copy()
            z[:, m] += 1000 * plots.sigma_bias[m]
            answers.append((errors(z)[0] - x) / 1000)
        b, S = x - truth, np.zeros((scans, 3, 3))
        for answer in answers:
            S += answer[:, :, None] * answer[:, None, :]
        there = np.isfinite(b)
        b, v = np.where(there, b, 0), np.where(there, np.diagonal(S, axis1=1, axis2=2), 0)
        for total, value in zip(sums, (1.0, b, v + b**2, 3 * v**2 + 6 * v * b**2 + b**4), strict=True):
            total += weight * there * value
        begun = np.flatnonzero(np.isfinite(P[:, 0, 0]))
        updated = P[begun[:-1][came[begun[1:]]]]
        precision = max(precision, precision_of(updated, observes, Q, scans)) if len(updated) else precision
        for k in begun:
            started[k] += weight
            M = S[k] + np.outer(b[k], b[k])
            nees[k] += weight * np.trace(np.linalg.solve(P[k], M)) / 3
    with np.errstate(invalid="ignore"):
        return sums[0], *(total / sums[0] for total in sums[1:]), nees / started, precision


@pytest.fixture(scope="module")
def seven():
    """Both filters over every pattern of seven scans, by brute force."""
    plan = prepared(radar={"detection_probability": 0.75, "bias_velocity_mps": 1, "sigma_bias_range_m": 30}, scans=7)
    plots = Plots(SIGMA, np.array([0.0, 1.0]), np.array([30.0, 0.0]), 0.75)
    Q = process_noise("random_jerk", VARIANCE, DT)
    truth = plan.problem.truth
    return plan, [over_all_patterns(truth, observes, start, Q, plots, 7) for observes, start in ((1, 3), (2, 2))]


def test_exact_values_are_the_means_over_all_patterns(seven):
    plan, known = seven
    for f, (available, bias, moment, _, nees, precision) in enumerate(known):
        there = available > 0
        np.testing.assert_array_equal(plan.axes.available[f], there)
        # Responses are differences of estimates of ranges, of up to 60 km, by moves of a thousand σ, which are as many.
        np.testing.assert_allclose(plan.axes.exact_sigma[f][there], np.sqrt(moment[there]), rtol=precision)
        biases = (plan.axes.exact_bias[f] - bias) * [1, DT, DT**2]
        assert np.abs(biases[there]).max() < precision * plan.problem.truth[:, 0].max()
        np.testing.assert_allclose(plan.axes.exact_nees[f], nees, rtol=precision)


def test_missed_plots_as_often_as_the_exact_values_say(seven):
    plan, known = seven
    count = 60_000
    sums = sums_of(plan, count)
    for f, (available, _, moment, fourth, *_) in enumerate(known):
        share = sums["estimates"][f] / count
        assert (np.abs(share - available) <= share_error(available.clip(0, 1), count)).all()
        there = available > 0
        n = sums["estimates"][f][there]
        sigma = np.sqrt(sums["error"][f, ..., 1][there] / n)
        # Errors of many patterns have heavier tails than a Gaussian's: (m₄/m₂² − 1)/4n in place of 1/2n.
        spread = np.sqrt((fourth[there] / moment[there] ** 2 - 1) / (4 * n))
        assert (np.abs(sigma / np.sqrt(moment[there]) - 1) < Z * spread).all()


def test_gain_is_of_those_that_have_both_estimates(seven):
    """At the second scan: of realisations in which it came, of which some had the first as well."""
    from types import SimpleNamespace

    from radarsim.engine.results import CaseResult
    from radarsim.report import tables
    from radarsim.studies.range_doppler.filter_design import least_squares_start

    plan, _ = seven
    spec = SimpleNamespace(radar=SimpleNamespace(detection_probability=0.75))
    result = CaseResult("a", "range_doppler", spec, (), 60_000, sums_of(plan, 60_000), plan.axes)
    rows = tables.gains([result])
    row = rows[(rows["component"] == "r") & (rows["k"] == 2)].iloc[0]
    # With one plot both have σ² + 30²; with two the filter with Doppler has its start, which the velocity's bias moves.
    weights, P = least_squares_start(2, 2, SIGMA, DT)
    S = P[0, 0] + weights[0, 1].sum() ** 2 + 30.0**2
    expected = 100 * (1 - np.sqrt((0.75 * S + 0.25 * (SIGMA[0] ** 2 + 30**2)) / (SIGMA[0] ** 2 + 30**2)))
    assert_rounded(row["exact_percent"], expected, size=100, condition=scaled_condition(P), operations=20)
    assert abs(row["gain_percent"] - expected) < Z / 1.96 * (row["gain_hi"] - row["gain_lo"]) / 2


@pytest.mark.parametrize("detection", [0.8, 0.5])
def test_means_over_merged_patterns_are_those_over_all(detection, monkeypatch):
    for module in (missed_plot_means, missed_plot_patterns):
        monkeypatch.setattr(module, "FOLLOWED_PATTERNS", 1 << 15)
    monkeypatch.setattr(missed_plot_means, "RECENT_MEANS", {})
    plan = prepared(scans=16, radar={"detection_probability": detection, "sigma_bias_range_m": 10})
    plots, axes, later = Plots(SIGMA, np.zeros(2), np.array([10.0, 0.0]), detection), plan.axes, slice(3, None)
    Q = pack(process_noise("random_jerk", VARIANCE, DT))
    designs = [missed_plot_patterns.Design(observes, start, Q) for observes, start in ((1, 3), (2, 2))]
    whole = [missed_plot_patterns.mixture(one, plots, plan.problem.truth, DT, 1 << 16, designs) for one in designs]
    near = {"rtol": missed_plot_patterns.MAX_CHANGE / 3}
    for f, mean in enumerate(whole):
        np.testing.assert_allclose(axes.exact_sigma[f, later], np.sqrt(mean.moment)[later], **near)
        np.testing.assert_allclose(axes.exact_nees[f, later], mean.nees[later], rtol=missed_plot_patterns.MAX_CHANGE)
    left = 1 - np.sqrt(whole[1].companion_moment[0] / whole[0].companion_moment[1])
    np.testing.assert_allclose(1 - axes.exact_gain[1, later] / 100, 1 - left[later], **near)


@pytest.mark.parametrize("most", [8, 300])
@pytest.mark.parametrize("from_k", [0, 12])
def test_patterns_followed_to_the_end_piece_by_piece_are_those_side_by_side(most, from_k):
    """From 8 on at once, in pieces smaller than PIECE and of several; only the order of the sums is another.

    They are of up to 2¹³ patterns, those of errors of both signs, whose size is their root mean square.
    """
    truth = prepared(scans=13).problem.truth
    plots = Plots(SIGMA, np.array([30.0, 1.0]), np.array([10.0, 0.5]), 0.6)
    designs = [
        missed_plot_patterns.Design(observes, start, pack(process_noise("white_jerk", VARIANCE, DT)))
        for observes, start in STARTS
    ]
    for design in designs:
        given = design, plots, truth, DT
        beside = missed_plot_patterns.mixture(*given, 1 << 13, designs, from_k=from_k)
        pieces = missed_plot_patterns.mixture(*given, most, designs, from_k=from_k, follow_all=True)
        for name in ("started", "available", "bias", "moment", "believed", "nees", "companion_moment"):
            size = np.sqrt(beside.moment) if name == "bias" else None
            assert_rounded(getattr(pieces, name), getattr(beside, name), size=size, operations=1 << 13)


def test_a_shortened_case_has_the_same_exact_errors_where_it_is_asked():
    case = case_of(scans=16, radar={"detection_probability": 0.6})
    whole = study.prepare(case).axes
    for at, k in (({"at_s": 127.0, "at_k": None}, (13, 14)), ({"at_s": None, "at_k": 12}, (12,))):
        short = study.prepare(study.shorten_case(case, **at)).axes
        assert len(short.k) == k[-1]
        for one in k:
            found, wanted = short.exact_sigma[:, one - 1], whole.exact_sigma[:, one - 1]
            np.testing.assert_allclose(found, wanted, rtol=missed_plot_patterns.MAX_CHANGE)
            assert np.isfinite(found).all()


def test_where_patterns_are_too_many_nothing_is_called_exact(monkeypatch):
    monkeypatch.setattr(missed_plot_means, "PATTERN_SCANS", 8)
    assert np.isnan(prepared(radar={"detection_probability": 0.75}).axes.exact_sigma).all()


def test_a_biased_range_moves_the_range_alone():
    """No filter can tell a range that is too long from a target that is farther away."""
    plain, biased = prepared(), prepared(radar={"bias_range_m": 70})
    shift = biased.axes.exact_bias[..., 0] - plain.axes.exact_bias[..., 0]
    np.testing.assert_allclose(shift, 70, rtol=0, atol=PRECISION * (70 + np.abs(plain.axes.exact_bias[..., 0]).max()))
    for c in (1, 2):
        there = plain.axes.available[..., c]
        np.testing.assert_allclose(
            biased.axes.exact_sigma[..., c][there], plain.axes.exact_sigma[..., c][there], rtol=PRECISION
        )


WORLDS = {
    "biases": {"radar": {"bias_range_m": 40, "bias_velocity_mps": -2}},
    "drawn biases": {"radar": {"sigma_bias_range_m": 50, "sigma_bias_velocity_mps": 3, "bias_velocity_mps": 1}},
    "fly-by": {"target": FLY_BY, "scans": 25},
    "white jerk": {"every_filter": {"process_noise": "white_jerk"}},
    "white acceleration": {"every_filter": {"process_noise": "white_acceleration"}},
    "random jerk": {},
    "drawn turn": {"target": TURN | DRAWN},
    "drawn velocity": {"target": TURN | {"sigma_velocity_mps": 30}, "every_filter": {"initial_scans": 5}},
    "drawn fly-by": {"target": FLY_BY | DRAWN, "radar": {"bias_velocity_mps": 1, "sigma_bias_range_m": 30}},
    "drawn and missed": {"target": TURN | DRAWN, "radar": {"detection_probability": 0.8, "sigma_bias_velocity_mps": 1}},
    "drawn record": {"target": {"kind": "recorded"} | DRAWN},
}


@pytest.mark.parametrize("name", WORLDS)
def test_sums_agree_with_the_exact_errors(name, tmp_path, monkeypatch):
    changes = {"target": TURN} | WORLDS[name]
    if changes["target"]["kind"] == "recorded":
        monkeypatch.chdir(tmp_path)
        t = np.arange(0, 95.0, 5.0)
        rows = [f"{a},{30e3 - 250 * a},{9000 + 40 * a},{3000 + a**2}" for a in t]
        (tmp_path / "flight.csv").write_text("t_s,x_m,y_m,z_m\n" + "\n".join(rows) + "\n")
        changes["target"] |= {"file": "flight.csv"}
    drawn = DRAWN.keys() & changes["target"].keys()
    plan, count = prepared(**changes), 60_000 if drawn else 20_000
    sums, axes = sums_of(plan, count), plan.axes
    estimates = sums.get("estimates", count * axes.available)
    there = estimates > 0
    n, moment, fourth = estimates[there], sums["error"][there][:, 1], sums["error"][there][:, 3]
    sigma = np.sqrt(moment / n)
    spread = np.sqrt((fourth / n / sigma**4 - 1) / (4 * n))
    assert (np.abs(sigma / axes.exact_sigma[there] - 1) < Z * spread).all()
    assert (np.abs(sums["error"][there][:, 0] / n - axes.exact_bias[there]) < Z * sigma / np.sqrt(n)).all()
    if drawn:
        fixed = prepared(**changes | {"target": changes["target"] | dict.fromkeys(DRAWN, 0)}).axes
        assert np.abs(axes.exact_sigma[there] / fixed.exact_sigma[there] - 1).max() > 1e-3  # what is drawn matters


def test_a_recorded_flight_is_seen_from_the_origin(tmp_path, monkeypatch):
    """A straight flight past the radar, recorded without error, is the fly-by."""
    monkeypatch.chdir(tmp_path)
    t = np.arange(0, 95.0, 1.0)
    x = 300 * t - np.sqrt(40e3**2 - 15e3**2)
    rows = [f"{a},{b},9000,12000" for a, b in zip(t, x, strict=True)]
    (tmp_path / "flight.csv").write_text("t_s,x_m,y_m,z_m\n" + "\n".join(rows) + "\n")
    recorded = prepared(target={"kind": "recorded", "file": "flight.csv"}).problem.truth
    flown = prepared(target=FLY_BY).problem.truth
    # A spline through 95 rows, 1 s apart: its rates are differences of places of up to 40 km.
    assert_rounded(recorded[:, :2], flown[:, :2], size=40e3, operations=95)


# ---- flights that are drawn ------------------------------------------------------------------------------------------


def shifts_of(problem, count):
    """What the kernel draws of a flight for realisations 0, 1, …: (count, 6)."""
    made = np.zeros((6, 1024))
    for pair in range(3):
        fill_normal_pairs(problem.keys[2], 0, 3 + pair, made[2 * pair], made[2 * pair + 1])
    return made.T[:count] * problem.sigma_flight


@pytest.mark.parametrize("kind", ["turn", "fly_by"])
def test_a_drawn_flight_begins_elsewhere_and_flies_the_same_accelerations(kind):
    """Truth by integrating the plane motion of the textbook from the drawn position and velocity."""
    problem = prepared(target={"turn": TURN, "fly_by": FLY_BY}[kind] | DRAWN).problem
    shifts = shifts_of(problem, 2)
    assert (np.abs(shifts[:, [0, 1, 3, 4]]) > 0).all()
    assert not shifts[:, [2, 5]].any()
    for realisation, shift in enumerate(shifts):
        if kind == "turn":
            position, velocity = np.array([TURN["range_m"], 0.0]), np.array([-TURN["speed_mps"], 0.0])
            rate, begin = TURN["acceleration_g"] * 9.80665 / TURN["speed_mps"], TURN["start_s"]
        else:
            along = np.sqrt(FLY_BY["start_range_m"] ** 2 - FLY_BY["distance_m"] ** 2)
            position, velocity = np.array([-along, FLY_BY["distance_m"]]), np.array([FLY_BY["speed_mps"], 0.0])
            rate, begin = 0.0, 0.0
        position, velocity, middle = position + shift[:2], velocity + shift[3:5], velocity
        _, (truth,) = missed_block.simulate_plots(problem, realisation, 1)
        # Halves of a step about its middle: a third power of the step of the jerk over 12, and over 24 of its rate, are
        # left out of a place and of a velocity, as long as it turns; 4000 steps are added up.
        step, jerk = 0.02, rate**2 * TURN["speed_mps"]
        velocity_tolerance = step**2 / 24 * jerk * rate * 20 + rounding(operations=4000) * 300
        place_tolerance = step**2 / 12 * jerk * 20 + velocity_tolerance * 80 + rounding(operations=4000) * 60e3
        for k, (r, radial, _) in enumerate(truth):
            np.testing.assert_allclose(np.hypot(*position), r, rtol=0, atol=place_tolerance)
            turned = np.hypot(*velocity) * place_tolerance / r  # of the line of sight
            np.testing.assert_allclose(
                position @ velocity / np.hypot(*position), radial, rtol=0, atol=velocity_tolerance + turned
            )
            for n in range(round(DT / step)):
                t = k * DT + (n + 0.5) * step
                turning = kind == "turn" and begin <= t < begin + TURN["duration_s"]
                heading = np.arctan2(middle[1], middle[0]) + rate * np.clip(t - begin, 0, 20)
                pull = np.hypot(*middle) * rate * np.array([-np.sin(heading), np.cos(heading)]) * turning
                position = position + step * velocity + step**2 / 2 * pull
                velocity = velocity + step * pull


@pytest.mark.parametrize("target", [TURN, FLY_BY], ids=lambda target: target["kind"])
def test_how_drawn_flights_leave_the_model_has_the_moments_of_those_flights(target):
    """Mean and covariance in plain NumPy, on flights so widely drawn that the mean counts in the covariance."""
    case = case_of(target=target | DRAWN)
    t = DT * np.arange(9.0)
    middle = scenario.true_motion(case)[1]
    flown, weights = [], []
    for share, shifts in scenario.displacements(scenario.sigma_flight(case.spec.target)):
        flown.append(
            scenario.model_defects(scenario.displaced_motion(scenario.flight(case.spec.target, t), shifts, t), DT)
        )
        weights.append(share)
    left, weights = np.concatenate(flown) - scenario.model_defects(middle[None], DT), np.concatenate(weights)
    mean = np.average(left, axis=0, weights=weights)
    flat = left.reshape(len(left), -1)
    covariance = np.cov(flat.T, aweights=weights, ddof=0)
    found = scenario.random_defects(case.spec.target, t, middle)
    # Of what is left of places of up to 60 km and of rates, in units of the scan period.
    unit = DT ** np.arange(3.0)
    assert_rounded(found[..., 0] * unit, mean * unit, size=np.abs(middle[:, 0]).max(), operations=30)
    columns = found[..., 1:].reshape(flat.shape[1], -1)
    units, variances = np.tile(unit, len(t)), np.diag(covariance)
    apart = (columns @ columns.T - covariance) * np.outer(units, units)
    assert np.abs(apart).max() < scenario.NEGLIGIBLE_SHARE * (variances * units**2).max() * len(variances)
    assert (np.outer(mean, mean).diagonal() > 1e-4 * np.diag(covariance)).any()


def test_the_mean_over_drawn_flights_has_settled(monkeypatch):
    """As widely drawn as is allowed, two more nodes in each number change it by less than the stated millionth."""
    widest = TURN | {"sigma_position_m": 4000, "sigma_velocity_mps": 10}
    for target in (widest, FLY_BY | {"sigma_position_m": 2400}):
        plans = [prepared(target=target)]
        with monkeypatch.context() as more:
            more.setattr(scenario, "NODES", {count: nodes + 2 for count, nodes in scenario.NODES.items()})
            plans.append(prepared(target=target))
        one, other = (plan.axes.exact_sigma for plan in plans)
        np.testing.assert_allclose(one, other, rtol=1e-6)  # as NODES has it


def test_the_search_for_a_variance_sees_the_exact_errors():
    """Of filters that start within a drawn turn, with biases: σ at a given variance is that of the exact recursion."""
    turned = {"target": TURN | DRAWN | {"start_s": 5}, "every_filter": {"initial_scans": 5}}
    case = case_of(radar={"bias_velocity_mps": 1, "sigma_bias_range_m": 30}, **turned)
    t, x = scenario.true_motion(case)
    drawn = scenario.random_defects(case.spec.target, t, x)
    plots = Plots(SIGMA, np.array([0.0, 1.0]), np.array([30.0, 0.0]), 1.0, drawn.shape[2] - 1)
    seen = best_variance.FilterInputs(plots, x, DT, drawn)
    exact = study.prepare(case).axes.exact_sigma
    for one, expected in zip(case.spec.filters, exact, strict=True):
        np.testing.assert_allclose(best_variance.errors(one, np.array([VARIANCE]), seen)[0], expected, rtol=PRECISION)


@pytest.mark.parametrize(
    ("target", "words"),
    [
        (FLY_BY | {"sigma_position_m": 3000}, "at 100 s it is 1.659e"),
        (TURN | {"sigma_velocity_mps": 200}, "6 standard deviations are"),
        (TURN | {"sigma_position_m": -1}, "must be >= 0"),
    ],
)
def test_a_flight_that_may_meet_the_radar_is_refused(target, words):
    with pytest.raises(ConfigError, match=words):
        prepared(target=target, scans=14)


def test_exact_errors_of_a_long_drawn_run_are_not_given():
    plan = prepared(target=FLY_BY | DRAWN, radar={"scan_period_s": 0.2}, scans=301)
    assert np.isnan(plan.axes.exact_sigma[:, 3:]).all()
    assert np.isfinite(sums_of(plan, 10)["error"]).all()


# ---- D_M that is looked for -----------------------------------------------------------------------------------------


BOTH, PULLED = ["range", "velocity"], {"target": TURN | {"acceleration_g": 3}, "scans": 15}
SOUGHT = [(over, observes, PULLED) for over in ("worst", "mean", "last") for observes in (["range"], BOTH)]
SOUGHT += [("worst", BOTH, {"target": TURN | {"sigma_velocity_mps": 30}})]
SOUGHT += [("mean", BOTH, {"radar": {"detection_probability": 0.8}})]


@pytest.mark.parametrize(("over", "observes", "changes"), SOUGHT)
def test_the_best_variance_is_that_of_a_grid(over, observes, changes):
    """Of decades and their halves, and about what was found."""

    def made(variance):
        one = {"name": "a", "observes": observes, "process_noise": "white_jerk", "manoeuvre_variance": variance}
        return prepared(filters=[one], **changes).axes

    def cost(variance):
        sigma = made(float(variance)).exact_sigma[0, 3:, 0]
        return {"worst": sigma.max(), "mean": sigma.mean(), "last": sigma[-1]}[over]

    found = float(made({"minimise": "sigma_r", "over": over, "from_k": 4}).manoeuvre_variance[0])
    grid = [*10.0 ** np.arange(-6, 4, 0.5), *found * 2.0 ** np.array([-2, -1, -0.5, 0.5, 1, 2])]
    # A step of the last search and four digits: a least cost, of a curvature of about one a decade², is flat so far.
    near = 2 / best_variance.POINTS_PER_DECADE * (
        2 / (best_variance.POINTS - 1)
    ) ** best_variance.REFINEMENTS + np.log10(1 + 5e-4)
    assert cost(found) <= min(map(cost, grid)) * (1 + near**2)


def test_without_a_manoeuvre_the_best_variance_is_the_least():
    wanted = {"minimise": "sigma_r", "over": "last"}
    one = {"name": "a", "observes": ["range"], "manoeuvre_variance": wanted}
    plan = prepared(filters=[one], target={"kind": "polynomial", "coefficients": [9e4, -200, 1]})
    assert best_variance.is_at_limit(float(plan.axes.manoeuvre_variance[0]), 9, SIGMA, DT)
