"""Linear studies from their matrices: every part against the textbook, of filters right and wrong about their model."""

from typing import Literal

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.stats import multivariate_normal

from radarsim.config.experiment import Case
from radarsim.config.key_types import Positive, Probability, key
from radarsim.config.model import Model
from radarsim.config.study_keys import Member
from radarsim.errors import ConfigError
from radarsim.report.quantities import Component
from radarsim.studies.interface import Paper
from radarsim.studies.linear import LinearStudy, Motion
from radarsim.studies.onefile import MeasuredColumn
from tests.tolerances import Z, assert_rounded, column_sizes, rounding, scaled_condition

SCANS = 25
NAMES = "abcd"


class Sensor(Model):
    """A sensor."""

    sigma_m: Positive = key("σ", "standard deviation of each number, m")
    scan_period_s: Positive = key("scan period", "time between two plots, s")
    probability: Probability = key("probability of detection", "of a plot, no unit", 1.0)
    noise: Positive = key("process noise", "its density, m²/s³", 1.0)


class Believing(Member):
    """A filter that may be wrong."""

    wrong: Literal["", "F", "Q", "H", "R", "x"] = key("wrong", "what it believes otherwise than it is", "")
    gain: Literal["kalman", "steady", "half"] = key("gain", "how its gains are made", "kalman")


def chain(n, t):
    """n states, each the integral of the next, and white noise of the last."""
    power = lambda m: t**m / np.prod(np.arange(1, m + 1))  # noqa: E731
    F = np.array([[power(j - i) if j >= i else 0.0 for j in range(n)] for i in range(n)])
    integral = [[t ** (2 * n - 1 - i - j) / (2 * n - 1 - i - j) for j in range(n)] for i in range(n)]
    scale = np.array([1 / np.prod(np.arange(1, n - i)) for i in range(n)])
    return F, np.array(integral) * np.outer(scale, scale)


def rows(n, D, k):
    """Numbers of the first states, with a coupling that changes its sign from scan to scan."""
    H = np.eye(D, n)
    H[0, n - 1] += 0.3 * (-1) ** k
    return H


def study_of(n, D):
    """A study of n states and D numbers."""

    class Study(LinearStudy):
        """A chain."""

        name, about, filters, asks = "chain", "A chain.", {"wrong": "what is wrong"}, "How well?"
        components = tuple(Component(NAMES[i], "m") for i in range(n))
        parts, Filter = {"sensor": Sensor}, Believing
        scan_period, detection, fitted = (
            "sensor.scan_period_s",
            "sensor.probability",
            ("sensor.sigma_m", "sensor.noise"),
        )
        measured = tuple(MeasuredColumn(f"z{d}_m", "m", ("sensor.sigma_m",)) for d in range(D))
        paper = Paper("Kalman 1960")

        def motion(self, spec):
            q = spec.sensor.noise
            mean = np.arange(1.0, n + 1)
            return Motion(lambda t: chain(n, t)[0], lambda t: q * chain(n, t)[1], mean, np.diag(mean) + 0.1)

        def plot(self, spec, one, k):
            return rows(n, D, k), spec.sensor.sigma_m * np.arange(1, D + 1)

        def assumed_motion(self, spec, one):
            F, Q, mean, P = self.motion(spec)
            match one.wrong:
                case "F":
                    return Motion(lambda t: 0.97 * F(t), Q, mean, P)
                case "Q":
                    return Motion(F, lambda t: 0.2 * Q(t), mean, P)
                case "x":
                    return Motion(F, Q, mean + 20, P)
            return Motion(F, Q, mean, P)

        def assumed_plot(self, spec, one, k):
            H, sigma = self.plot(spec, one, k)
            return H * (0.9 if one.wrong == "H" else 1.0), sigma * (1.5 if one.wrong == "R" else 1.0)

        def own_gains(self, spec, one):
            if one.gain == "half":
                return np.full((spec.scans, D, n), 0.25) * np.eye(D, n)
            return self.steady_gains(spec, one) if one.gain == "steady" else None

    return Study()


def case_of(study, filters, scans=SCANS, **sensor):
    given = [{"name": f"{n} {one}", **one} for n, one in enumerate(filters)]
    sensor = {"sigma_m": 2.0, "scan_period_s": 0.5} | sensor
    spec = study.keys().model_validate({"sensor": sensor, "filters": given, "scans": scans})
    return Case("chain", "chain", "chain", spec, (), 1000, 1)


def textbook(study, spec, one, z, t, gains=None):
    """x (K, n) and P (K, n, n) of the Kalman filter, or of one with gains (K, D, n), in a few lines of NumPy."""
    F, Q, x, P = study.assumed_motion(spec, one)
    x, found, spread = np.array(x, float), [], []
    for k in range(len(z)):
        if k:
            A = np.asarray(F(t[k] - t[k - 1]))
            x, P = A @ x, A @ P @ A.T + Q(t[k] - t[k - 1])
        H, sigma = study.assumed_plot(spec, one, k)
        for d in range(len(H)):
            if np.isfinite(z[k, d]):
                R = sigma[d] ** 2
                K = P @ H[d] / (H[d] @ P @ H[d] + R) if gains is None else gains[k, d]
                x = x + K * (z[k, d] - H[d] @ x)
                A = np.eye(len(x)) - np.outer(K, H[d])
                P = A @ P @ A.T + R * np.outer(K, K)
        found.append(x)
        spread.append(P)
    return np.array(found), np.array(spread)


def precision(P):
    """Rounding of a filter with these covariances (K, n, n), over the size of its states: ten operations a scan."""
    return rounding(scaled_condition(P).max(), 10 * len(P))


FILTERS = ({}, *({"wrong": what} for what in "FQHRx"), {"gain": "half"}, {"gain": "steady"})


@pytest.mark.slow_cases("4-2*", "3-2*")
@pytest.mark.parametrize("probability", [1.0, 0.7])
@pytest.mark.parametrize(("n", "D"), [(1, 1), (2, 1), (3, 2), (4, 2)])
def test_the_kernel_is_the_textbooks_filter_over_its_own_plots(n, D, probability):
    study = study_of(n, D)
    case = case_of(study, FILTERS, probability=probability)
    plan = study.prepare(case)
    for i in (0, 700, 4099):
        made = study.drawing(case)(i, 1)
        z, truth = np.stack([made.columns[f"z{d}_m"][0] for d in range(D)], axis=1), made.truth[0]
        assert np.isnan(z).any() == (probability < 1)
        sums = plan.layout.unpack(study.simulate(plan, i, 1))
        error = sums["error"]
        assert_rounded(sums["paired"], error[..., 1] * error[:1, ..., 1], operations=3)
        for f, one in enumerate(case.spec.filters):
            x, P = textbook(study, case.spec, one, z, plan.axes.t_s, study.own_gains(case.spec, one))
            tolerance = precision(P) * np.abs(x).max()
            np.testing.assert_allclose(error[f, :, :, 0], x - truth, rtol=0, atol=tolerance)
            fourth = 4 * tolerance * np.abs(x - truth).max() ** 3
            np.testing.assert_allclose(error[f, :, :, 3], (x - truth) ** 4, rtol=rounding(operations=4), atol=fourth)


@pytest.mark.parametrize("probability", [1.0, 0.7])
def test_a_realisation_is_itself_in_any_block(probability):
    study = study_of(2, 1)
    plan = study.prepare(case_of(study, FILTERS, probability=probability))
    together = study.simulate(plan, 509, 6)
    apart = [study.simulate(plan, i, 1) for i in range(509, 515)]
    added = plan.layout.unpack(sum(apart))
    for name, sums in plan.layout.unpack(together).items():
        assert_rounded(sums, added[name], size=column_sizes(added[name], 6), operations=6)
    alone = np.stack([plan.layout.unpack(values)["error"][..., 0] for values in apart], axis=1)
    assert_rounded(study.errors(plan, 509, 6), alone, size=column_sizes(alone, 1), operations=10 * SCANS)


@pytest.mark.parametrize(("n", "D"), [(2, 1), (3, 2)])
def test_exact_values_are_those_of_the_kernel_of_wrong_filters_too(n, D):
    """Within Z standard errors at all 8 · 25 · n places."""
    study, count = study_of(n, D), 20_000
    plan = study.prepare(case_of(study, FILTERS))
    sums = plan.layout.unpack(study.simulate(plan, 0, count))
    e1, e2, _, e4 = np.moveaxis(sums["error"] / count, -1, 0)
    sigma = plan.axes.exact_sigma
    assert (abs(e2 - sigma**2) < Z * np.sqrt((e4 - e2**2) / count)).all()
    assert (abs(e1 - plan.axes.exact_bias) < Z * np.sqrt((e2 - e1**2) / count)).all()
    assert (abs(plan.axes.exact_bias[5, 0]) > 0.1).all()  # that of the wrong start
    assert plan.gaussian


def test_filters_that_see_different_plots_have_their_own():
    study, count = study_of(2, 1), 20_000
    study.plot = lambda spec, one, k: (rows(2, 1, k), spec.sensor.sigma_m * np.array([3.0 if one.wrong else 1.0]))
    plan = study.prepare(case_of(study, [{}, {"wrong": "H"}, {"gain": "steady"}]))
    e2, _, e4 = np.moveaxis(plan.layout.unpack(study.simulate(plan, 0, count))["error"][..., 1:] / count, -1, 0)
    assert (abs(e2 - plan.axes.exact_sigma**2) < Z * np.sqrt((e4 - e2**2) / count)).all()


def test_with_missed_plots_exact_values_are_known_of_gains_that_do_not_depend_on_them():
    """Of a biased filter too, whose error is a mixture with means apart."""
    study, count = study_of(2, 1), 40_000
    plan = study.prepare(
        case_of(study, [{}, {"gain": "half"}, {"gain": "steady"}, {"gain": "half", "wrong": "x"}], probability=0.7)
    )
    assert np.isnan(plan.axes.exact_sigma[0]).all()
    sums = plan.layout.unpack(study.simulate(plan, 0, count))["error"][1:] / count
    e1, e2, _, e4 = np.moveaxis(sums, -1, 0)
    assert (abs(e2 - plan.axes.exact_sigma[1:] ** 2) < Z * np.sqrt((e4 - e2**2) / count)).all()
    assert (abs(e1 - plan.axes.exact_bias[1:]) < Z * np.sqrt((e2 - e1**2) / count)).all()
    assert not plan.gaussian


def test_the_limit_is_the_riccati_equations():
    """Of a plot that does not change; of one that does, of the equation over two scans (Bittanti et al. 1991)."""
    for n, D in ((1, 1), (2, 1), (3, 2), (4, 1)):
        study = study_of(n, D)
        F, Q = chain(n, 0.5)
        R = np.diag(4.0 * np.arange(1, D + 1) ** 2)
        fixed = type(study)()
        fixed.plot = lambda spec, one, k, n=n, D=D: (rows(n, D, 0), 2.0 * np.arange(1, D + 1))
        H = rows(n, D, 0)
        P = solve_discrete_are(F.T, H.T, Q, R)
        after = P - P @ H.T @ np.linalg.solve(H @ P @ H.T + R, H @ P)
        spec = case_of(fixed, [{}, {"gain": "steady"}]).spec
        memory = 1 / (1 - np.abs(np.linalg.eigvals(after @ np.linalg.solve(P, F))).max())  # scans
        steady = rounding(scaled_condition(P), 10 * max(memory, 1))
        np.testing.assert_allclose(fixed.limits(spec), np.sqrt([np.diag(after)] * 2), rtol=steady)
        H1, none = rows(n, D, 1), np.zeros((D, n))
        # Two scans as one: numbers of both, those of the second before its noise has come.
        both, push = np.vstack([H, H1 @ F]), np.block([[none, none], [H1, none]])
        noise = push[:, :n] @ Q @ push[:, :n].T + np.kron(np.eye(2), R)
        cross = F @ Q @ push[:, :n].T
        P = solve_discrete_are((F @ F).T, both.T, F @ Q @ F.T + Q, noise, s=cross)
        S = H @ P @ H.T + R
        P = F @ (P - P @ H.T @ np.linalg.solve(S, H @ P)) @ F.T + Q  # that before the second, at odd scans
        last = P - P @ H1.T @ np.linalg.solve(H1 @ P @ H1.T + R, H1 @ P)
        spec = case_of(study, [{}], scans=24).spec  # the last scan is an odd one
        np.testing.assert_allclose(study.limits(spec)[0], np.sqrt(np.diag(last)), rtol=2 * steady)  # steps of two scans


@pytest.mark.parametrize("probability", [1.0, 0.7])
def test_errors_tend_to_their_limit(probability):
    study = study_of(2, 1)
    filters = [{}, {"wrong": "Q"}, {"wrong": "R"}, {"gain": "steady"}, {"wrong": "H"}]
    case = case_of(study, filters, scans=301, probability=probability)
    last, limits = study.prepare(case).axes.exact_sigma[:, -1], study.limits(case.spec)
    known = [0, 1, 2, 3] if probability == 1 else [3]
    plots = np.zeros((100, 1))
    P = textbook(study, case.spec, case.spec.filters[0], plots, 0.5 * np.arange(100))[1]
    np.testing.assert_allclose(limits[known], last[known], rtol=precision(P))  # a memory is shorter than that
    assert np.isnan(np.delete(limits, known, axis=0)).all()


def test_a_filter_that_diverges_has_no_limit():
    study = study_of(2, 1)
    study.own_gains = lambda spec, one: np.zeros((spec.scans, 1, 2))
    assert np.isnan(study.limits(case_of(study, [{}]).spec)).all()
    study = study_of(2, 1)  # two states that double at each scan, of which only the sum is seen
    study.motion = lambda spec: Motion(lambda t: 2 * np.eye(2), lambda t: np.eye(2), [0, 0], np.eye(2))
    study.plot = lambda spec, one, k: (np.ones((1, 2)), 1.0)
    assert np.isnan(study.limits(case_of(study, [{}]).spec)).all()


def test_a_small_component_that_settles_late_has_its_own_limit():
    """Two random walks that have nothing to do with each other: variance p = (q + √(q² + 4 q R)) / 2 before a plot."""
    study = study_of(2, 2)
    q, R = np.array([1e6, 1e-14]), np.array([1e6, 1e-8])
    study.motion = lambda spec: Motion(lambda t: np.eye(2), lambda t: np.diag(q), [0, 0], np.diag([1e6, 1e-9]))
    study.plot = lambda spec, one, k: (np.eye(2), np.sqrt(R))
    p = (q + np.sqrt(q**2 + 4 * q * R)) / 2
    tolerance = rounding(operations=10 * np.sqrt(R / q).max())  # ten in each of the scans of a memory, a thousand
    np.testing.assert_allclose(study.limits(case_of(study, [{}]).spec)[0], np.sqrt(p * R / (p + R)), rtol=tolerance)


@pytest.mark.parametrize("n", [2, 4])
def test_recorded_plots_are_followed_as_a_run_follows_them_and_between_irregular_times(n):
    study = study_of(n, 2 if n == 4 else 1)
    D = len(study.measured)
    case = case_of(study, FILTERS, probability=0.8)
    columns = study.recording_interface().simulated(case, 3)
    t = columns["t_s"] + np.random.default_rng(1).uniform(-0.1, 0.1, SCANS)
    for times in (columns["t_s"], t):
        plots = {**columns, "t_s": times}
        track = study.tracker(case).feed(plots)
        tracker = study.tracker(case)
        parts = [
            tracker.feed({name: one[a:b] for name, one in plots.items()}) for a, b in ((0, 1), (1, 10), (10, SCANS))
        ]
        np.testing.assert_array_equal(np.concatenate([one.estimate for one in parts], axis=1), track.estimate)
        z = np.stack([columns[f"z{d}_m"] for d in range(D)], axis=1)
        for f, one in enumerate(case.spec.filters):
            x, P = textbook(study, case.spec, one, z, times, study.own_gains(case.spec, one))
            np.testing.assert_allclose(track.estimate[f], x, rtol=0, atol=precision(P) * np.abs(x).max())
            variances = np.diagonal(P, axis1=1, axis2=2)
            np.testing.assert_allclose(track.sigma[f] ** 2, variances, rtol=precision(P), atol=0)


def test_after_the_configs_scans_the_last_period_of_own_gains_goes_on():
    study = study_of(2, 1)
    short, whole = (case_of(study, [{"gain": "steady"}], scans=scans) for scans in (8, 41))
    columns = study.recording_interface().simulated(whole, 0)
    one, other = (study.tracker(case).feed(columns).estimate for case in (short, whole))
    assert_rounded(one, other, size=np.abs(other).max(), operations=10 * 41)


def test_the_likelihood_is_that_of_all_plots_together():
    """By the covariance of all numbers of a track, made of the matrices at once."""
    study = study_of(2, 1)
    case = case_of(study, [{}], scans=6)
    columns = study.recording_interface().simulated(case, 0)
    found = study.likelihood(case, None, [columns, columns])
    assert (found.keys, found.rows, found.tracks) == (study.fitted, 12, 2)
    for sigma, noise in ((2.0, 1.0), (3.0, 0.2)):
        F, Q = chain(2, 0.5)
        mean, P = np.array([1.0, 2.0]), np.diag([1.0, 2.0]) + 0.1
        H = [rows(2, 1, k)[0] for k in range(6)]
        spread = [P]
        for _ in range(5):
            spread.append(F @ spread[-1] @ F.T + noise * Q)
        power = lambda m: np.linalg.matrix_power(F, m)  # noqa: E731, B023
        S = np.array(
            [[H[max(i, j)] @ power(abs(i - j)) @ spread[min(i, j)] @ H[min(i, j)] for j in range(6)] for i in range(6)]
        )
        z = columns["z0_m"] - [h @ power(k) @ mean for k, h in enumerate(H)]
        S = S + sigma**2 * np.eye(6)
        wanted = 2 * multivariate_normal(np.zeros(6), S).logpdf(z)
        likelihoods = [found(np.array([sigma, noise])), sum(found.by_number(np.array([sigma, noise])).values())]
        assert_rounded(likelihoods, [wanted] * 2, condition=scaled_condition(S), operations=60)  # ten a scan


def test_what_is_fitted_is_the_likeliest_of_the_filters_that_say_how_likely_plots_are():
    """One with gains of its own does not; where all have such, by the model that they share with a Kalman filter."""
    study = study_of(2, 1)
    case = case_of(study, [{"gain": "half"}, {"wrong": "R"}, {}, {"wrong": "F"}])
    columns = study.recording_interface().simulated(case, 0)
    each = {one.name: study.likelihood(case, one.name, [columns]) for one in case.spec.filters}
    half, *others = each.values()
    assert half is None
    best = max(others, key=lambda one: one(one.stated))
    assert study.likelihood(case, None, [columns]).filter == best.filter
    alone = study.likelihood(case_of(study, [{"gain": "half"}]), None, [columns])
    right = each[case.spec.filters[2].name]
    assert alone(alone.stated) == right(right.stated)  # the same model's


def test_a_filter_that_diverges_has_no_exact_error_and_no_warning():
    study = study_of(2, 1)
    study.own_gains = lambda spec, one: np.full((spec.scans, 1, 2), 9.0)
    plan = study.prepare(case_of(study, [{}], scans=400))
    assert not np.isfinite(plan.axes.exact_sigma[0, -1]).any()


def test_at_the_first_plot_and_over_no_time_the_state_stays_whatever_the_motion_says():
    """Of a motion that is the same over any time; F(0) of an author's formula may fail."""
    study = study_of(2, 1)
    F, Q = np.array([[0.9, 0.1], [0.0, 0.8]]), np.diag([0.5, 2.0])
    study.motion = lambda spec: Motion(lambda t: F * (t / t), lambda t: Q, [1, 2], np.eye(2))
    case = case_of(study, [{}])
    columns = study.recording_interface().simulated(case, 0)
    one = {name: value[:1] for name, value in columns.items()}
    S = rows(2, 1, 0)[0] @ rows(2, 1, 0)[0] + 4
    wanted = multivariate_normal(rows(2, 1, 0)[0] @ [1, 2], S).logpdf(one["z0_m"][0])
    assert_rounded(study.likelihood(case, None, [one])(np.array([2.0, 1.0])), wanted, operations=20)
    twice = {name: np.repeat(value[:2], 2) for name, value in columns.items()} | {"t_s": np.repeat([0, 0.5], 2)}
    twice["z0_m"][[1, 3]] = np.nan
    estimate = study.tracker(case).feed(twice).estimate[0]
    np.testing.assert_array_equal(estimate[::2], estimate[1::2])


@pytest.mark.parametrize(
    ("F", "Q", "said"),
    [
        (np.eye(2), lambda t: np.diag([1, 0.6 - t]), r"assumed_motion: Q\(0.75 s\): must be symmetric and not neg"),
        ([[1]], lambda t: np.eye(2), r"assumed_motion: F\(dt\): must be 2 × 2, got 1 × 1"),
    ],
)
def test_a_motion_that_is_wrong_over_the_times_of_recorded_plots_is_one_line(F, Q, said):
    study = study_of(2, 1)
    study.motion = lambda spec: Motion(lambda t: np.eye(2) if t == 0.5 else F, Q, [0, 0], np.eye(2))
    with pytest.raises(ConfigError, match=said):
        study.tracker(case_of(study, [{}])).feed({"t_s": np.array([0.0, 0.75]), "z0_m": np.zeros(2)})


RNG = np.random.default_rng(1)
WRONG = {
    "motion": ("motion", lambda spec: Motion(lambda t: [[1, t]], lambda t: np.eye(2), [0, 0], np.eye(2)),
               r"motion: F\(dt\): must be 2 × 2, got 1 × 2"),
    "covariance": ("motion", lambda spec: Motion(lambda t: np.eye(2), lambda t: np.eye(2), [0, 0], 1.0),
                   "motion: covariance: must be 2 × 2, got one"),
    "mean": ("motion", lambda spec: Motion(lambda t: [[1]], lambda t: [[1]], [0], [[1]]), "must be of the 2 comp"),
    "no motion": ("motion", lambda spec: None, r"motion: must give Motion\(F, Q, mean, covariance\), got None"),
    "H": ("plot", lambda spec, one, k: ([1, 0, 0], 1.0), "plot: H: must be 1 × 2, got 1 × 3"),
    "sigma": ("plot", lambda spec, one, k: ([1, 0], "wide"), "plot: sigma: must be numbers, got"),
    "nan": ("plot", lambda spec, one, k: ([1, np.nan], 1.0), "plot: H: must be 1 × 2, got numbers that are not finite"),
    "Q turned": ("motion", lambda spec: Motion(lambda t: np.eye(2), lambda t: [[1, 2], [0, 1]], [0, 0], np.eye(2)),
                 r"motion: Q\(dt\): must be symmetric and not negative, got"),
    "Q negative": ("motion", lambda spec: Motion(lambda t: np.eye(2), lambda t: -np.eye(2), [0, 0], np.eye(2)),
                   r"motion: Q\(dt\): must be symmetric and not negative, got"),
    "covariance negative": ("assumed_motion", lambda spec, one: Motion(
        lambda t: np.eye(2), lambda t: np.eye(2), [0, 0], [[1, 2], [2, 1]]),
        "assumed_motion: covariance: must be symmetric and not negative, got"),
    "small and negative": ("motion", lambda spec: Motion(
        lambda t: np.eye(2), lambda t: np.eye(2), [0, 0], [[1e6, 0], [0, -1e-4]]),
        "motion: covariance: must be symmetric and not negative, got"),
    "small and turned": ("motion", lambda spec: Motion(
        lambda t: np.eye(2), lambda t: [[1e6, 1e-4], [0, 1e-6]], [0, 0], np.eye(2)),
        r"motion: Q\(dt\): must be symmetric and not negative, got"),
    "F": ("motion", lambda spec: Motion(np.eye(2), lambda t: np.eye(2), [0, 0], np.eye(2)), "F: must be a function"),
    "F drawn": ("motion", lambda spec: Motion(lambda t: RNG.normal(size=(2, 2)), lambda t: np.eye(2), [0, 0],
                                              np.eye(2)), r"F\(dt\): gives another formula each time"),
    "nothing": ("plot", lambda spec, one, k: None, "plot: must give rows and standard deviations, H, sigma, got None"),
    "zero": ("plot", lambda spec, one, k: ([1, 0], 0.0), "plot: sigma: must be positive, got 0"),
    "drawn": ("plot", lambda spec, one, k: ([1, RNG.normal()], 1.0), "plot: gives another formula each time"),
    "boom": ("plot", lambda spec, one, k: 1 / 0, "ZeroDivisionError: division by zero"),
    "of other states": ("assumed_motion", lambda spec, one: Motion(
        lambda t: np.eye(3), lambda t: np.eye(3), np.zeros(3), np.eye(3)), "plot: H: must be 1 × 3, got 1 × 2"),
    "of other numbers": ("assumed_plot", lambda spec, one, k: (np.eye(2), np.ones(2)),
                         "assumed_plot: H: must be 1 × 2"),
    "gains": ("own_gains", lambda spec, one: np.zeros((3, 2)), "own_gains: must be 25 × 1 × 2, got 3 × 2"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_shape_is_one_line_with_the_classs_file(what):
    method, given, said = WRONG[what]
    study = study_of(2, 1)
    case = case_of(study, [{}])
    setattr(study, method, given)
    with pytest.raises(ConfigError, match=said) as caught:
        study.prepare(case)
    assert len(caught.value.lines) == 1
    assert "test_linear.py:" in caught.value.lines[0]


def test_filters_have_the_states_of_the_truth_and_as_many_numbers():
    study = study_of(2, 1)
    study.assumed_motion = lambda spec, one: Motion(lambda t: np.eye(3), lambda t: np.eye(3), np.zeros(3), np.eye(3))
    study.plot = study.assumed_plot = lambda spec, one, k: (np.eye(1, 3), 1.0)
    case = case_of(study, [{}, {"wrong": "H"}])
    for of in (study.prepare, study.tracker):
        with pytest.raises(
            ConfigError, match=r"assumed_motion: 0 .*: mean: must be of the 2 states of `motion`, got 3"
        ):
            of(case)
    study = study_of(2, 1)
    study.measured = ()
    study.assumed_plot = lambda spec, one, k: (np.eye(2), np.ones(2))
    with pytest.raises(ConfigError, match=r"assumed_plot: 0 .*: must be of as many numbers as `plot`, 1, got 2"):
        study.prepare(case)
    D = lambda one: 1 + bool(one.wrong)  # noqa: E731
    study.plot = study.assumed_plot = lambda spec, one, k: (np.eye(D(one), 2), np.ones(D(one)))
    with pytest.raises(ConfigError, match="plot: must give all filters as many numbers, got 1 and 2"):
        study.prepare(case)


def test_keys_and_methods_that_are_not_there_are_a_line_each():
    Study = study_of(2, 1).__class__
    given = {"detection": "sensor.detektion", "fitted": ("sensor.nois", "scans", "gain"), "plot": None}
    Wrong = type("Wrong", (Study,), given | {"__module__": __name__})
    assert list(Wrong.missing()) == [
        "Wrong.plot must be given: what a filter sees at scan k",
        "detection: there is no key sensor.detektion",
        "fitted: there is no key sensor.nois",
        "fitted: scans must be a key of a part that YAML gives, PART.KEY",
        "fitted: gain must be a key of a part that YAML gives, PART.KEY",
    ]


def test_what_is_fitted_is_a_real_number_and_what_is_detected_is_of_a_part():
    class Odd(Sensor):
        """A sensor with keys that are no real numbers."""

        about: str = key("about", "what it is", "")
        bursts: int = key("bursts", "of a plot", 4)
        both: bool = key("both", "whether it has two", True)
        offsets_m: tuple[float, ...] = key("offsets", "of both numbers, m", ())
        drift_m: Positive | None = key("drift", "of its zero, m", None)

    unreal = "about", "bursts", "both", "offsets_m"
    fitted = tuple(f"sensor.{name}" for name in ("sigma_m", *unreal, "drift_m", "noise"))
    given = {"parts": {"sensor": Odd}, "fitted": fitted, "detection": "gain", "__module__": __name__}
    Wrong = type("Wrong", (study_of(2, 1).__class__,), given)
    said = [f"fitted: sensor.{name} must be a key that is a real number" for name in unreal]
    assert list(Wrong.missing()) == ["detection: gain must be a key of a part, PART.KEY", *said]
    study = type("Right", (Wrong,), {"fitted": ("sensor.drift_m",), "detection": "", "__module__": __name__})()
    case = case_of(study, [{}])
    with pytest.raises(ConfigError, match=r"fitted: sensor\.drift_m is not given"):
        study.likelihood(case, None, [study.recording_interface().simulated(case, 0)])
