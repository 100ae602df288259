"""What proves the study: textbook filters over its plots, what its targets do, a gradient, what is learned, claims."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
import radarsim
from radarsim.api.configs import load

from learned import STUDY
from learned.network import COLUMNS, Inner, Network
from learned.train import SCALE_M, drawn, fitted, lessons, slope, trained, untrained

PLACE = Path(__file__).parents[1]
CASE = load("learned").cases[0]
SPEC = CASE.spec


def motion(rate, T=1.0):
    """The transition of a clockwise turn, by the exponential of its matrix."""
    from scipy.linalg import expm

    A = np.zeros((4, 4))
    A[:2, 2:], A[2:, 2:] = np.eye(2), [[0, rate], [-rate, 0]]
    return expm(A * T)


class Textbook:
    """Filters of one realisation with matrices: interacting models, of which a Kalman filter has one."""

    def __init__(self, one):
        r, t, T = SPEC.radar, SPEC.target, SPEC.radar.scan_period_s
        self.variances = lambda z: np.diag([r.sigma_range_m, r.sigma_azimuth_rad * z[0], r.sigma_velocity_mps]) ** 2
        if one.kind == "constant":
            own = one.sigma_position_m, one.sigma_position_m, one.sigma_velocity_mps
            self.variances = lambda z: np.diag(own) ** 2
        G = np.kron([[T**2 / 2], [T]], np.eye(2))
        models = [(0.0, one.sigma_acceleration_mps2)]
        self.P = np.eye(1)
        if one.kind == "imm":
            models += [(s * one.turn_rate_radps, one.sigma_turning_mps2) for s in (1, -1)]
            a, b = T / t.straight_s, T / t.turn_s
            self.P = np.array([[1 - a, a / 2, a / 2], [b, 1 - b, 0], [b, 0, 1 - b]])
        self.models = [(motion(rate), sigma**2 * G @ G.T) for rate, sigma in models]

    def run(self, plots):
        """Estimates (K, 4) and σ (K, 4)."""
        found = []
        for z in plots:
            s, o = np.sin(z[1]), np.cos(z[1])
            H, R = np.array([[s, o, 0, 0], [o, -s, 0, 0], [0, 0, s, o]]), self.variances(z)
            y = np.array([z[0], 0, z[2]])
            if not found:
                whole = np.vstack([H, [0, 0, o, -s]])
                first = np.linalg.inv(whole)
                C = np.zeros((4, 4))
                C[:3, :3], C[3, 3] = R, SPEC.target.speed_mps**2
                states = [(first @ [*y, 0], first @ C @ first.T)] * len(self.models)
                p = np.eye(len(self.models))[0]
            else:
                joint, before, states = self.P * p[:, None], states, []
                p = joint.sum(0)
                for j, (F, Q) in enumerate(self.models):
                    x, C = mixed(joint[:, j] / p[j], before)
                    x, C = F @ x, F @ C @ F.T + Q
                    S, e = H @ C @ H.T + R, y - H @ x
                    K = C @ H.T @ np.linalg.inv(S)
                    states.append((x + K @ e, C - K @ H @ C))
                    p[j] *= np.exp(-0.5 * e @ np.linalg.solve(S, e)) / np.sqrt(np.linalg.det(S))
                p /= p.sum()
            x, C = mixed(p, states)
            found.append((x, np.sqrt(np.diag(C))))
        return np.swapaxes(found, 0, 1)


def mixed(weights, states):
    x = sum(w * x for w, (x, _) in zip(weights, states, strict=True))
    return x, sum(w * (C + np.outer(y - x, y - x)) for w, (y, C) in zip(weights, states, strict=True))


def test_filters_are_those_of_the_textbook_over_their_own_plots():
    plan = STUDY.prepare(CASE)
    for i in (3, 700):
        plots = STUDY.recording_interface().simulated(CASE, i)
        track = STUDY.recording_interface().tracker(CASE).feed(plots)
        error = plan.layout.unpack(STUDY.simulate(plan, i, 1))["error"][..., 0]
        true = np.transpose([plots[f"true_{name}"] for name in ("x_m", "y_m", "vx_mps", "vy_mps")])
        for f, one in enumerate(SPEC.filters):
            wanted, sigma = Textbook(one).run(np.transpose([plots[name] for name in COLUMNS]))
            np.testing.assert_allclose(track.estimate[f], wanted, rtol=1e-9, atol=1e-8)
            np.testing.assert_allclose(track.sigma[f], sigma, rtol=1e-7)
            np.testing.assert_allclose(error[f] + true, wanted, rtol=1e-9, atol=1e-7)


def test_targets_do_what_the_keys_say():
    """Within 5 standard errors: how often they turn, how long, how hard, how fast; and plots miss by their σ."""
    n, t = 4000, SPEC.target
    made = radarsim.plots("learned", n=n)
    place, v = made.truth[..., :2], made.truth[..., 2:]
    speed = np.hypot(*v[:, 0].T)
    np.testing.assert_allclose(np.hypot(*np.moveaxis(v, -1, 0)), speed[:, None] * np.ones(30), rtol=1e-9)
    assert abs(speed.mean() - t.speed_mps) < 5 * t.sigma_speed_mps / np.sqrt(n)
    turns = v[:, :-1, 0] * v[:, 1:, 1] - v[:, :-1, 1] * v[:, 1:, 0]
    turning = abs(turns) > 1e-6 * speed[:, None] ** 2
    begins, ends = turning[:, 1:][~turning[:, :-1]], ~turning[:, 1:][turning[:, :-1]]
    for share, mean_s in ((begins, t.straight_s), (ends, t.turn_s)):
        assert abs(share.mean() - 1 / mean_s) < 5 * np.sqrt(share.mean() / share.size)
    first = ~turning[:, :-1] & turning[:, 1:]
    angle = np.arctan2(turns, (v[:, :-1] * v[:, 1:]).sum(-1))[:, 1:][first]
    hard = abs(angle) * np.broadcast_to(speed[:, None], first.shape)[first]
    assert abs(hard.mean() - t.acceleration_mps2) < 5 * t.sigma_acceleration_mps2 / np.sqrt(hard.size)
    assert abs(np.sign(angle).mean()) < 5 / np.sqrt(hard.size)
    chords = np.diff(place, axis=1)  # of arcs that turn by a course's change
    half = np.arctan2(turns, (v[:, :-1] * v[:, 1:]).sum(-1)) / 2
    wanted = speed[:, None] * np.sinc(half / np.pi)
    np.testing.assert_allclose(np.hypot(*np.moveaxis(chords, -1, 0)), wanted, rtol=1e-8)
    r, azimuth, radial = (made.columns[name] for name in COLUMNS)
    range_m = np.hypot(*np.moveaxis(place, -1, 0))
    away = np.arctan2(place[..., 0], place[..., 1])
    misses = r - range_m, (azimuth - away + np.pi) % (2 * np.pi) - np.pi, radial - (v * place).sum(-1) / range_m
    for miss, sigma in zip(misses, (10, np.pi / 180, 5), strict=True):
        assert abs(miss.std() / sigma - 1) < 5 / np.sqrt(2 * miss.size)


def test_the_filter_within_the_network_is_that_of_the_config():
    case = load("learned", ["filters.2.sigma_acceleration_mps2=16"]).cases[0]
    plots = STUDY.recording_interface().simulated(case, 5)
    track = STUDY.recording_interface().tracker(case).feed(plots)
    inner = Inner((10, np.pi / 180, 5), 70, 1)
    for k in range(30):
        inner.features(*(plots[name][k : k + 1] for name in COLUMNS))
        np.testing.assert_allclose(inner.x[0], track.estimate[2, k], rtol=1e-9)
        np.testing.assert_allclose(np.sqrt(np.diag(inner.P[0])), track.sigma[2, k], rtol=1e-9)


def test_the_slope_is_that_of_finite_differences():
    rng = np.random.default_rng(1)
    w = untrained(rng, 9, hidden=5, dtype=float)
    seen, wanted = rng.normal(size=(7, 4, 9)), rng.normal(size=(7, 4, 2))
    _, by = slope(w, seen, wanted)
    for name, one in w.items():
        for at in rng.integers(0, one.size, 3):
            step = np.zeros(one.size)
            step[at] = 1e-6
            ends = [slope(w | {name: one + sign * step.reshape(one.shape)}, seen, wanted)[0] for sign in (1, -1)]
            assert by[name].ravel()[at] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5, abs=1e-9)


def test_the_network_says_in_a_run_what_it_was_taught_to_say():
    """Its mean squared correction left, over the lessons, is its error in the run of these plots."""
    plots = drawn(300)
    seen, wanted = lessons(plots)
    left = SCALE_M**2 * slope(Network().weights, seen.astype(float), wanted.astype(float))[0]
    judged = radarsim.judge("learned", Network, name="again", realisations=300, seed=2**32 + 1, figures=False)
    curves = judged.curves[judged.curves["filter"] == "again"]
    assert np.mean(curves["sigma"] ** 2) == pytest.approx(left, rel=1e-4)
    assert judged.tables["failures"]["failed"].sum() == 0


def test_what_is_learned_is_the_same_each_time():
    seen, wanted = lessons(drawn(500))
    one, two = (trained(seen, wanted, epochs=1) for _ in range(2))
    assert all(np.array_equal(one[name], two[name]) for name in one)
    assert slope(one, seen, wanted)[0] < slope(untrained(np.random.default_rng(2**32 + 1), 9), seen, wanted)[0]


def test_the_config_has_the_fitted_values():
    one = SPEC.filters[0]
    stated = one.sigma_position_m, one.sigma_velocity_mps, one.sigma_acceleration_mps2
    assert stated == pytest.approx(fitted(drawn()), abs=0.006)


def test_claims_are_judged_with_the_shipped_network_alone(tmp_path):
    tables = radarsim.run("learned", realisations=2000, figures=False).tables
    assert sys.modules["learned"].STUDY is STUDY  # not imported again with the network
    verdicts = dict(zip(tables["claims"]["claim"], tables["claims"]["overall"], strict=True))
    assert verdicts["learned.1"] == "confirmed"
    assert verdicts["learned.2"] == "refuted"
    (tmp_path / "other.py").write_text("from learned.network import Network\n")
    text = (PLACE / "src/learned/shipped/configs/learned.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(text.replace("learned.network:Network", "other.py:Network"))
    assert radarsim.run(tmp_path / "mine.yaml", realisations=200, figures=False).tables["claims"].empty


@pytest.mark.slow
def test_the_shipped_weights_are_as_good_as_those_of_a_new_training():
    plots = drawn()
    seen, wanted = lessons(plots)
    new, old = (slope(w, seen, wanted)[0] for w in (trained(seen, wanted), Network().weights))
    assert new == pytest.approx(old, rel=0.005)


@pytest.mark.slow
def test_the_readme_says_what_comes_out():
    """Its tables of σ, gains, what filters believe, and of verdicts, as the shipped runs have them."""
    text = (PLACE / "README.md").read_text(encoding="utf-8")
    tables = radarsim.run("learned", figures=False).tables
    last = {name: tables[name].query("component == 'x' and k == 30") for name in ("curves", "gains")}
    for one in last["curves"].to_dict("records"):
        gain = last["gains"].query("baseline == 'fitted' and filter == @one['filter']").to_dict("records")
        ratio = one["sigma"] / one["believed_sigma"]
        believed = "–" if math.isnan(ratio) else f"{ratio:.2f}"
        cells = told(one, "sigma", 1), *(told(row, "gain_percent", 1) for row in gain or [{}]), believed
        assert f"| {one['filter']} | {' | '.join(cells)} |" in text
    elsewhere = radarsim.run("learned_elsewhere", figures=False).tables["claims"].query("claim == 'learned.4'")
    for one in [*tables["claims"].to_dict("records"), *elsewhere.to_dict("records")]:
        if one["verdict"] != "not run":
            assert f"| {told(one, 'measured', 3)} | {one['verdict']} |" in text


def told(row, name, digits):
    """An estimate as the page has it."""
    if not row:
        return "–"
    start = {"gain_percent": "gain_", "measured": ""}.get(name, f"{name}_")
    value, lo, hi = (f"{row[key]:.{digits}f}" for key in (name, f"{start}lo", f"{start}hi"))
    return f"{value} [{lo}, {hi}]"
