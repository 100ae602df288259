"""What proves the study: filters of the textbook over its own plots, a Monte Carlo of another make, its claims."""

import numpy as np
import pytest
import radarsim
from radarsim.api.configs import load

from bearings import STUDY

OWN = ("own_x_m", "own_y_m", "own_vx_mps", "own_vy_mps")


def case_of(*changes):
    return load("bearings", changes).cases[0]


def angle(x, y):
    """The angle from north, also of complex numbers: derivatives are taken by the complex step."""
    x, y = np.asarray(x), np.asarray(y)
    turned = (x.imag * y.real - y.imag * x.real) / (x.real**2 + y.real**2)
    return np.arctan2(x.real, y.real) + 1j * turned


def polar(x):
    square = x[0] ** 2 + x[1] ** 2
    bearing = angle(x[0], x[1])
    turn, rate = (x[2] * x[1] - x[3] * x[0]) / square, (x[0] * x[2] + x[1] * x[3]) / square
    return np.array([turn, rate, bearing, 1 / np.sqrt(square)])


def cartesian(y):
    r, s, o = 1 / y[3], np.sin(y[2]), np.cos(y[2])
    return np.array([r * s, r * o, r * (y[1] * s + y[0] * o), r * (y[1] * o - y[0] * s)])


def derivatives(function, x):
    steps = np.asarray(x)[:, None] + 1e-30j * np.eye(len(x))
    return np.array([function(steps[:, i]).imag / 1e-30 for i in range(len(x))]).T


class Textbook:
    """A filter of one realisation with matrices, all states as they stand on the chart."""

    def __init__(self, spec, kind):
        self.kind, t = kind, spec.target
        self.R, self.range, self.P0 = spec.observer.sigma_bearing_rad**2, t.range_m, None
        self.P0 = np.diag([0, 0, t.sigma_velocity_mps**2, t.sigma_velocity_mps**2])
        self.along = t.sigma_range_m**2

    def run(self, t_s, z, own):
        """The range and the velocity after each plot, not-a-number where it is missed."""
        line = np.array([np.sin(z[0]), np.cos(z[0])])
        across = np.array([line[1], -line[0]])
        x, P = np.append(self.range * line, [0, 0]) + np.append(own[0, :2], [0, 0]), self.P0.copy()
        P[:2, :2] = self.along * np.outer(line, line) + self.range**2 * self.R * np.outer(across, across)
        if self.kind == "modified_polar":
            y = polar(x - own[0]).real
            J = derivatives(polar, x - own[0])
            P = J @ P @ J.T
        made = []
        for k in range(len(z)):
            if k:
                dt = t_s[k] - t_s[k - 1]
                F = np.eye(4) + dt * np.eye(4, k=2)
                if self.kind == "modified_polar":

                    def onwards(y, F=F, k=k):
                        return polar(F @ (cartesian(y) + own[k - 1]) - own[k])

                    J = derivatives(onwards, y)
                    y, P = onwards(y).real, J @ P @ J.T
                else:
                    x, P = F @ x, F @ P @ F.T
                if np.isfinite(z[k]):
                    if self.kind == "modified_polar":
                        K = P[:, 2] / (P[2, 2] + self.R)
                        y, P = y + K * (z[k] - y[2]), P - np.outer(K, P[2])
                        y[3] = max(y[3], 0.1 / self.range)
                    else:
                        x, P = self.updated(x, P, z[k], own[k])
            state = cartesian(y) + own[k] if self.kind == "modified_polar" else x
            made.append([np.hypot(*(state - own[k])[:2]), state[2], state[3]])
        return np.array(made)

    def updated(self, x, P, z, own):
        e, n = (x - own)[:2]
        square = e**2 + n**2
        if self.kind == "pseudolinear":
            h, R = np.array([np.cos(z), -np.sin(z), 0, 0]), self.R * square
            innovation = -h[:2] @ [e, n]
        else:
            h, R = np.array([n, -e, 0, 0]) / square, self.R
            innovation = (z - np.arctan2(e, n) + np.pi) % (2 * np.pi) - np.pi
        K = P @ h / (h @ P @ h + R)
        return x + K * innovation, P - np.outer(K, h @ P)


LAST = "filters=[{name: modified polar, kind: modified_polar}]"


@pytest.mark.parametrize("changes", [(), ("observer.detection_probability=0.7", LAST)], ids=["all", "missed"])
def test_filters_are_those_of_the_textbook_over_their_own_plots(changes):
    case = case_of(*changes)
    plan = STUDY.prepare(case)
    for i in (3, 700):
        plots = STUDY.recording_interface().simulated(case, i)
        own = np.transpose([plots[name] for name in OWN])
        track = STUDY.recording_interface().tracker(case).feed(plots)
        error = plan.layout.unpack(STUDY.simulate(plan, i, 1))["error"][..., 0]
        true = np.transpose([plots[f"true_{name}"] for name in ("r_m", "vx_mps", "vy_mps")])
        for f, one in enumerate(case.spec.filters):
            wanted = Textbook(case.spec, one.kind).run(plots["t_s"], plots["bearing_rad"], own)
            np.testing.assert_allclose(track.estimate[f], wanted, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(error[f] + true, wanted, rtol=1e-9, atol=1e-9)


def test_errors_are_those_of_a_monte_carlo_of_another_make():
    """Of 500 realisations with NumPy's noise: the mean and the rms error within 4.5 joint standard errors."""
    n, many = 500, 20_480
    case = case_of("observer.sigma_bearing_deg=1")
    plan, spec, rng = STUDY.prepare(case), case.spec, np.random.default_rng(3)
    sums = sum(plan.layout.unpack(STUDY.simulate(plan, i, 512))["error"] for i in range(0, many, 512))
    t = plan.axes.t_s
    own = np.transpose(STUDY.known_quantities(spec, t))
    target, line = spec.target, np.array([np.sin(spec.target.bearing_rad), np.cos(spec.target.bearing_rad)])
    errors = []
    for _ in range(n):
        place = (target.range_m + target.sigma_range_m * rng.normal()) * line
        velocity = target.sigma_velocity_mps * rng.normal(size=2)
        seen = place + np.outer(t, velocity) - own[:, :2]
        z = np.arctan2(seen[:, 0], seen[:, 1]) + spec.observer.sigma_bearing_rad * rng.normal(size=t.size)
        found = [Textbook(spec, kind).run(t, z, own)[-1, 0] for kind in ("cartesian", "pseudolinear")]
        errors.append(np.array(found) - np.hypot(*seen[-1]))
    for f, e in enumerate(np.transpose(errors)):
        s1, s2, _, s4 = sums[f, -1, 0] / many
        assert abs(e.mean() - s1) < 4.5 * np.sqrt((s2 - s1**2) * (1 / n + 1 / many))
        assert abs(np.mean(e**2) - s2) < 4.5 * np.sqrt((s4 - s2**2) * (1 / n + 1 / many))


def test_the_claims_are_confirmed():
    result = radarsim.run("bearings", realisations=20_000)
    claims = result.tables["claims"]
    assert dict(zip(claims["claim"], claims["overall"], strict=True)) == dict.fromkeys(claims["claim"], "confirmed")
    first = result.tables["consistency"].iloc[0]  # where the filter is right about itself, of three degrees of freedom
    half = 1.96 * np.sqrt(2 / (3 * 20_000))
    assert abs(first["nees"] - 1) < 2.5 * half
    assert (first["nees_hi"] - first["nees_lo"]) / 2 == pytest.approx(half, rel=0.1)
    assert result.figure("consistency").axes[0].lines


def test_the_textbook_filter_is_judged_as_a_filter_from_outside():
    """Given plots of one realisation at a time, it equals the config's, so gains are nil; against the others not."""
    book = Textbook(case_of().spec, "modified_polar")

    def polar_filter(plots):
        return book.run(plots.t_s, plots["bearing_rad"], np.transpose([plots[name] for name in OWN]))

    judged = radarsim.judge("bearings", polar_filter, one_by_one=True, name="book", realisations=60)
    gains = judged.gains[judged.gains["filter"] == "book"].groupby("baseline")["gain_percent"]
    assert gains.agg(lambda g: g.abs().max())["modified polar"] < 1e-3
    assert set(gains.groups) == {"cartesian", "pseudolinear", "modified polar"}
    assert judged.tables["failures"]["failed"].sum() == 0
