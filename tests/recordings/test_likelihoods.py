"""How likely recorded plots are under the filters of each study, against textbook twins; and what is fitted by it."""

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal as normal

from radarsim.api.load_experiments import load_all
from radarsim.kernels.kalman_algebra import pack, unpack
from radarsim.kernels.likelihood import HARD_FACTOR, log_likelihood, with_lasting_errors
from radarsim.physics import frames
from radarsim.physics.motion import manoeuvre_covariance, transition
from radarsim.recordings import simulate_plots
from radarsim.recordings.fit import advice, fit
from radarsim.recordings.study_part import recording_interface
from radarsim.studies import recording_interface as recording_interface_module
from radarsim.studies.ambiguous_doppler import plot_likelihood as ambiguous_likelihood
from radarsim.studies.ambiguous_doppler.kernels import recorded_rows
from radarsim.studies.error_law import ErrorLaw
from radarsim.studies.multimodel.model_bank import start_weights
from radarsim.studies.sonar import conversion
from tests.recordings.error_laws import error_laws, outlier_law
from tests.tolerances import Z, assert_rounded, polynomial_condition, rounding, scaled_condition


def loaded(config, *overrides):
    (one,) = load_all([config], overrides)
    return one.cases[0]


def recording(config, *overrides, number=0):
    """The measured columns of a realisation."""
    (one,) = load_all([config], overrides)
    columns = simulate_plots.simulate_realisation(one, number)
    return {name: column for name, column in columns.items() if not name.startswith("true_")}


def likelihood(case, name, *tracks):
    return recording_interface(case).likelihood(case, name, list(tracks))


def no_outliers(numbers):
    """The arguments of the kernel for which there are neither outliers nor hard manoeuvres."""
    return np.zeros((numbers, 4)), 0, 0.0, np.ones(numbers)


def density_size(off, spread):
    """What a change of a covariance, relative in its own units, changes a normal density's logarithm by, at most: n of
    the determinant's, and the quadratic form; each times κ."""
    return scaled_condition(spread) * (len(off) + off @ np.linalg.solve(spread, off))


# ---- the kernel ------------------------------------------------------------------------------------------------------


def test_the_kernel_is_the_density_of_all_numbers_together():
    """By the joint normal density of everything that is measured, without a filter."""
    rng, n = np.random.default_rng(1), 6
    F, q = np.tile(transition(2.0, 2), (n, 1, 1)), 0.3
    Q = np.tile(manoeuvre_covariance(1.0, 2.0, 2), (n, 1, 1))
    H, variance = rng.normal(size=(n, 2, 2)), rng.uniform(0.5, 2, (n, 2))
    z, there = rng.normal(size=(n, 2)), rng.random((n, 2)) < 0.7
    x, P = rng.normal(size=2), np.diag([2.0, 0.5])
    means, states = [x], [[P]]  # states[j][i]: covariance of the states at rows i and j
    for k in range(1, n):
        means.append(F[k] @ means[-1])
        states.append([states[-1][i] @ F[k].T for i in range(k)])
        states[-1].append(F[k] @ states[k - 1][k - 1] @ F[k].T + q * Q[k])
    whole = np.block([[states[max(i, j)][min(i, j)] if i <= j else states[i][j].T for j in range(n)] for i in range(n)])
    rows = np.zeros((2 * n, 2 * n))
    for k in range(n):
        rows[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = H[k]
    chosen = there.ravel()
    spread = (rows @ whole @ rows.T + np.diag(variance.ravel()))[np.ix_(chosen, chosen)]
    off = (z.ravel() - rows @ np.concatenate(means))[chosen]
    expected = normal.logpdf(off, cov=spread)
    score = np.empty((n, 2))
    log_likelihood(x.copy(), P.copy(), F, Q, H, z, variance, there, q, *no_outliers(2), 1.0, score, np.empty((n, 2)))
    assert_rounded(score.sum(), expected, density_size(off, spread), operations=len(off))
    assert np.all(score[~there] == 0)


def test_nothing_known_before_the_first_plot_costs_no_digits():
    """Against the same steps in extended precision, each P made symmetric: of 2000 numbers a part in 10⁸ of one. Wide
    variances of the start cancel, and what two halves of P differ by would grow from row to row."""
    n, T, q, variance = 1000, 10.0, 1e-3, np.array([250.0**2, 15.0**2])
    rng, real = np.random.default_rng(2), np.longdouble
    F, Q = transition(T), manoeuvre_covariance(1.0, T)
    z = np.stack([2e6 + 250.0 * T * np.arange(n), np.full(n, 250.0)], axis=1) + rng.normal(size=(n, 2)) * variance**0.5
    wide = np.diag([variance[0], 9e8, 9e6])
    x, P, expected, size = np.array([z[0, 0], 0, 0], dtype=real), wide.astype(real), real(0), 0.0
    for k in range(1, n):
        x, P = F.astype(real) @ x, F.astype(real) @ P @ F.T.astype(real) + real(q) * Q.astype(real)
        for j in range(2):
            p, S, e = P[:, j], P[j, j] + variance[j], z[k, j] - x[j]
            expected -= (np.log(2 * np.pi * S) + e * e / S) / 2
            size += float(np.abs(e * z[k, j]) / S)  # the innovation is a difference of numbers of that size
            x, P = x + p * e / S, P - np.outer(p, p) / S
            P = (P + P.T) / 2
    there, score = np.ones((n, 2), dtype=bool), np.empty((n, 2))
    there[0] = False
    rows = np.tile(np.eye(3)[:2], (n, 1, 1)), z, np.tile(variance, (n, 1)), there
    start = np.array([z[0, 0], 0.0, 0.0]), wide
    log_likelihood(
        *start,
        np.tile(F, (n, 1, 1)),
        np.tile(Q, (n, 1, 1)),
        *rows,
        q,
        *no_outliers(2),
        1.0,
        score,
        np.empty(score.shape),
    )
    assert_rounded(score.sum(), float(expected), size)


def test_errors_that_last_have_the_density_of_their_correlations():
    """By the joint normal density, without a filter: of errors whose correlation falls as a power of the time, at
    uneven times, some numbers missing; the state at the first row is known by a plot whose error it has."""
    rng, n, d, m, rho, q = np.random.default_rng(3), 6, 2, 2, 0.6, 0.3
    t = np.array([0.0, 1.0, 2.0, 4.5, 5.0, 6.0])
    steps = np.diff(t, prepend=0.0)
    F = np.stack([transition(step, d) for step in steps])
    Q = np.stack([manoeuvre_covariance(1.0, step, d) for step in steps])
    H, sigma = rng.normal(size=(n, m, d)), np.array([1.5, 0.7])
    z, there = rng.normal(size=(n, m)), rng.random((n, m)) < 0.8
    x, P, first = rng.normal(size=d), np.diag([2.0, 0.5]), np.array([[-1.0, 0.0], [0.0, 0.1]])
    of_states, moved, own = np.zeros((n, d, n, d)), [np.eye(d)], [P]
    for k in range(1, n):
        moved.append(F[k] @ moved[-1])
        own.append(F[k] @ own[-1] @ F[k].T + q * Q[k])
    for i in range(n):
        for j in range(i, n):
            of_states[j, :, i] = moved[j] @ np.linalg.inv(moved[i]) @ own[i]
            of_states[i, :, j] = of_states[j, :, i].T
    errors = rho ** np.abs(t[:, None] - t)[:, None, :, None] * np.diag(sigma**2)[None, :, None]
    crossed = np.einsum("iab,bc,j->iajc", np.stack(moved), first * sigma, rho**t)
    whole = np.einsum("iad,idje,jbe->iajb", H, of_states, H) + errors
    whole += (both := np.einsum("iad,idjb->iajb", H, crossed)) + both.transpose(2, 3, 0, 1)
    chosen, size = there.ravel(), n * m
    means = np.concatenate([H[k] @ moved[k] @ x for k in range(n)])[chosen]
    off, spread = z.ravel()[chosen] - means, whole.reshape(size, size)[np.ix_(chosen, chosen)]
    expected = normal.logpdf(off, cov=spread)
    variance, score = np.tile(sigma**2, (n, 1)), np.empty((n, m))
    model = with_lasting_errors(x, P, first, F, q * Q, H, variance, rho**steps)
    log_likelihood(*model, z, variance, there, 1.0, *no_outliers(m), 0.0, score, np.empty((n, m)))
    assert_rounded(score.sum(), expected, density_size(off, spread), operations=len(off))


@pytest.mark.parametrize("config", ["rls2", "sonar_smoothing"])
@pytest.mark.parametrize("law", [ErrorLaw(), ErrorLaw(outliers=0.02), ErrorLaw(correlation=0.4)])
def test_tracks_that_are_taken_together_are_those_taken_alone(config, law, monkeypatch):
    case = loaded(config, "scans=30")
    tracks = [recording(config, "scans=30", number=number) for number in range(3)]
    tracks[1] = {name: column[:12] for name, column in tracks[1].items()}
    tracks[2]["range_m"][:2] = np.nan
    together = likelihood(case, None, *tracks)
    values = together.stated * np.array([0.8, 0.8, 0.1])
    alone = [likelihood(case, None, track) for track in tracks]
    for part in alone:
        part.span, part.usual_s = together.span, together.usual_s
    assert_rounded(together(values, law), sum(part(values, law) for part in alone), together.rows, operations=20)
    for soundness, part in zip(together.soundness(values, law), alone, strict=True):
        for name, column in part.soundness(values, law)[0].items():
            np.testing.assert_allclose(soundness[name], column, rtol=1e-12)
    monkeypatch.setattr(recording_interface_module, "BATCH_ROWS", 20)
    assert likelihood(case, None, *tracks)(values, law) == pytest.approx(together(values, law), rel=1e-12)


@pytest.mark.parametrize("offset", [0.0, 5.0])
def test_an_outlier_leaves_the_moments_of_all_explanations(offset):
    """Of the second number, after a first that is a mixture: Bayes' rule by hand."""
    P, variance, law, span, z = 4.0, 1.0, outlier_law(0.2, 0.1, offset), 500.0, np.array([[7.0], [1.0]])
    chances, offsets, widths = error_laws(law, span, variance)
    spreads = P + variance * widths**2
    first = chances * np.exp(-0.5 * (z[0] - offsets) ** 2 / spreads) / np.sqrt(2 * np.pi * spreads)
    w = first / first.sum()
    means, variances = P / spreads * (z[0] - offsets), P - P**2 / spreads
    mean = w @ means
    merged = w @ (variances + (means - mean) ** 2)
    spreads = merged + variance * widths**2
    second = chances * np.exp(-0.5 * (z[1] - mean - offsets) ** 2 / spreads) / np.sqrt(2 * np.pi * spreads)
    one, (score, sound) = np.ones((2, 1, 1)), np.empty((2, 2, 1))
    there, x, P = np.ones((2, 1), dtype=bool), np.zeros(1), np.array([[P]])
    given = z, np.ones((2, 1)), there, 0.0, np.array([law]), 0, 0.0, np.array([span]), 1.0
    log_likelihood(x, P, one, 0 * one, one, *given, score, sound)
    assert_rounded(score[:, 0], np.log([first.sum(), second.sum()]), operations=60)
    assert_rounded(sound[:, 0], np.array([w[0], second[0] / second.sum()]), operations=60)


def test_a_hard_manoeuvre_is_a_second_process_noise():
    """Of two numbers in a row, before which the target may have manoeuvred hard: the mixture of two joint densities;
    the state after it has the moments of both."""
    P, q, share, z, F = np.array([[4.0, 0.3], [0.3, 1.0]]), 0.2, 0.3, np.array([1.0, 6.0]), transition(2.0, 2)
    Q, H = manoeuvre_covariance(1.0, 2.0, 2), np.array([[1.0, 0.0], [0.3, 1.0]])
    parts = []
    for chance, noise in ((1 - share, q), (share, HARD_FACTOR * q)):
        predicted = F @ P @ F.T + noise * Q
        S = H @ predicted @ H.T + np.eye(2)
        K = predicted @ H.T @ np.linalg.inv(S)
        parts.append((chance * normal.pdf(z, np.zeros(2), S), K @ z, predicted - K @ S @ K.T))
    total = sum(part[0] for part in parts)
    mean, spread = merged([part[0] / total for part in parts], [part[1:] for part in parts])
    rows, (score, sound) = np.stack([np.zeros(2), z]), np.empty((2, 2, 2))
    there = np.array([[False, False], [True, True]])
    x, P, errors = np.zeros(2), P.copy(), (np.zeros((2, 4)), 0, share, np.ones(2))
    twice = [np.stack([matrix] * 2) for matrix in (F, Q, H)]
    log_likelihood(x, P, *twice, rows, np.ones((2, 2)), there, q, *errors, 1.0, score, sound)
    assert_rounded(score.sum(), np.log(total), density_size(z, S), operations=60)
    assert_rounded(x, mean, scaled_condition(S), operations=60)
    assert_rounded(P, spread, scaled_condition(S) * np.abs(spread).max(), operations=60)


# ---- sonar -----------------------------------------------------------------------------------------------------------


def textbook(case, number, columns):
    """The density of a track's plots after the third, by a Kalman filter on both coordinates together, started from the
    first two plots with a wide covariance."""
    spec, member = case.spec, case.spec.filters[number]
    r, b, T, size = columns["range_m"], columns["bearing_rad"], np.diff(columns["t_s"]), member.degree + 1
    sigma = np.array([spec.sensor.sigma_range_m, spec.sensor.sigma_bearing_rad])
    if spec.frame == "polar":
        z, R = np.stack([r, b], axis=1), np.tile(np.diag(sigma**2), (len(r), 1, 1))
        scale = np.array([1, spec.target.initial_range_m**-2.0])
    else:
        x, y, (xx, xy, yy) = conversion.convert_plainly(r, b, *sigma)
        z, R = np.stack([x, y], axis=1), np.array([[xx, xy], [xy, yy]]).transpose(2, 0, 1)
        scale = np.ones(2)
    H = np.kron(np.eye(2), np.eye(size)[:1])
    state = np.zeros(2 * size)
    state[::size], state[1::size] = z[0], (z[1] - z[0]) / T[0]
    P = np.kron(np.diag(np.diag(R[0])), np.diag([0.0, *(1e3 * T[0] ** -np.arange(1.0, size)) ** 2]))
    P += H.T @ R[0] @ H
    densities = []
    for k in range(1, len(r)):
        F = np.kron(np.eye(2), transition(T[k - 1], size))
        D = member.manoeuvre_variance or 0.0
        P = F @ P @ F.T + np.kron(np.diag(scale), manoeuvre_covariance(D, T[k - 1], size))
        state, S = F @ state, H @ P @ H.T + R[k]
        densities.append(normal.logpdf(z[k], H @ state, S))
        K = P @ H.T @ np.linalg.inv(S)
        state, P = state + K @ (z[k] - H @ state), P - K @ S @ K.T
    return sum(densities[2:])


@pytest.mark.parametrize("frame", ["polar", "cartesian"])
@pytest.mark.parametrize("name", ["growing", "kalman q", "growing 2"])
def test_the_sonar_likelihood_is_that_of_a_textbook_filter(frame, name):
    case = loaded("sonar_smoothing", f"frame={frame}")
    columns = recording("sonar_smoothing")
    (number,) = (i for i, one in enumerate(case.spec.filters) if one.name == name)
    one = likelihood(case, name, columns)
    # The first plots leave a millionth of the wide variances, and of that what a polynomial through them does.
    degree = case.spec.filters[number].degree
    condition = 1e3**2 * polynomial_condition(range(degree + 1), degree)
    assert_rounded(float(one(one.stated)), textbook(case, number, columns), condition=condition, operations=10)


def test_errors_of_a_sonar_that_last_have_the_density_of_their_correlations():
    """By the joint normal density of all plots given the first, without a filter: of a straight course, at uneven
    times; less that of the plots that find the state."""
    case, columns = loaded("sonar_smoothing"), recording("sonar_smoothing")
    rng, rho = np.random.default_rng(1), 0.7
    chosen = np.sort(rng.choice(len(columns["t_s"]), 12, replace=False))
    columns = {name: column[chosen] for name, column in columns.items()}
    one = likelihood(case, "growing", columns)
    t = columns["t_s"] - columns["t_s"][0]
    usual, expected, size = np.median(np.diff(t)), 0.0, 0.0

    def density(x, P):
        return -0.5 * (np.linalg.slogdet(2 * np.pi * P)[1] + x @ np.linalg.solve(P, x))

    for z, sigma in zip((columns["range_m"], columns["bearing_rad"]), one.stated, strict=True):
        off, rate = z[1:] - z[0] - (z[1] - z[0]) / t[1] * t[1:], sigma * 1e3 / usual
        lasting = rho ** (np.abs(t[1:, None] - t[1:]) / usual) - rho ** (t[1:, None] / usual) - rho ** (t[1:] / usual)
        spread = sigma**2 * (lasting + 1) + rate**2 * np.outer(t[1:], t[1:])
        expected += density(off, spread) - density(off[:2], spread[:2, :2])
        size += density_size(off, spread)
    assert_rounded(one(one.stated, ErrorLaw(correlation=rho)), expected, size, operations=len(t))
    timed = fit.CorrelatedLikelihood(one)
    assert_rounded(timed(np.append(one.stated, -usual / np.log(rho))), expected, size, operations=len(t))
    assert timed(np.append(one.stated, 0.0)) == one(one.stated)


@pytest.mark.parametrize("frame", ["polar", "cartesian"])
def test_a_sonar_without_errors_of_range_has_a_likelihood(frame):
    """A fit asks whether an error can be zero; the rates before the first plot are as unknown then."""
    one = likelihood(loaded("sonar_smoothing", f"frame={frame}"), "kalman q", recording("sonar_smoothing"))
    assert np.isfinite(one(np.array([0.0, *one.stated[1:]])))


@pytest.mark.parametrize(
    ("key", "true"), [("sensor.sigma_range_m", 75.0), ("sensor.sigma_bearing_rad", 0.04), (None, None)]
)
def test_a_wrong_error_of_the_sonar_is_named_and_fitted(key, true):
    case = loaded("sonar_smoothing", "frame=cartesian", "scans=80")
    wrong = [f"{key}={true}"] if key else []
    columns = recording("sonar_smoothing", "frame=cartesian", "scans=80", *wrong)
    one = likelihood(case, "growing", columns)
    found = advice.find_errors(one)
    assert [finding.name for finding in found] == ([key] if key else [])
    if key:
        (fitted,) = (each for each in fit.fit_keys(one).keys if each.key == key)
        assert fitted.lo < true < fitted.hi
        assert fitted.hi / fitted.lo < 1.6


def test_a_course_without_manoeuvres_does_not_tell_their_variance():
    case = loaded("sonar_smoothing")
    *_, manoeuvre = fit.fit_keys(likelihood(case, "kalman q", recording("sonar_smoothing"))).keys
    assert (manoeuvre.key, manoeuvre.lo, manoeuvre.identifiable) == ("filters.4.manoeuvre_variance", 0.0, False)


# ---- multimodel ------------------------------------------------------------------------------------------------------


SIZES = 4.0, 1.5  # offset and spread of near outliers


def models_over(options, dt):
    """F and Q (9, 9) of each model over an interval."""
    found = []
    for model in options.models:
        moves, accelerates = {"still": (0, 0), "uniform": (1, 0), "accelerated": (1, 1)}[model.motion]
        F = np.array([[1, moves * dt, accelerates * dt**2 / 2], [0, moves, accelerates * dt], [0, 0, accelerates]])
        G = np.array([dt**2 / 2, moves * dt, accelerates]) * model.sigma_acceleration_mps2
        found.append((np.kron(np.eye(3), F), np.kron(np.eye(3), np.outer(G, G))))
    return found


def local_plots(spec, columns):
    """Plots in the local axes, and their covariances."""
    seen = np.stack([columns[name] for name in ("range_m", "elevation_rad", "azimuth_rad")], axis=1)
    turn = frames.rotation(spec.sensor.antenna_azimuth_rad, spec.sensor.antenna_elevation_rad)
    z = frames.to_local(frames.from_biconical(seen), turn, spec.sensor.antenna_height_m)
    return z, frames.plot_covariance(seen, np.array(spec.sensor.sigma), turn)


def density_rounding(case, columns):
    """Relative rounding of a multimodel likelihood: κ of a plot's covariance, times 200 operations of a row."""
    return rounding(scaled_condition(local_plots(case.spec, columns)[1]).max(), 200)


NO_OUTLIERS = ((0.0, 0.0),) * 3  # shares of near and far ones, of each number of a plot


def interacting(case, options, columns, T, shares=NO_OUTLIERS):
    """IMM of the book over a track (one model: a Kalman filter), with outliers merged by moments; T: over the scan."""
    spec, t = case.spec, columns["t_s"]
    z, _ = local_plots(spec, columns)
    a, b, g = start_weights(t[:3], spec.start_acceleration_mps2).reshape(3, 3)
    x = np.concatenate([[a @ z[:3, i], b @ z[:3, i], 0.0] for i in range(3)])
    lifts = [np.kron(np.eye(3), np.array([[a[k]], [b[k]], [0.0]])) for k in range(3)]
    # the mean square of an error in a number that starts the track
    wider = [1 + sum(size**2 for size in SIZES) * near + 99 * far for near, far in shares]
    R = [sum(w * np.outer(s, s) for w, s in zip(wider, number_shifts(spec, columns, k), strict=True)) for k in range(3)]
    P = sum(lift @ R[k] @ lift.T for k, lift in enumerate(lifts)) + np.kron(np.eye(3), np.outer(g, g))
    M, H = len(options.models), np.kron(np.eye(3), np.array([[1.0, 0, 0]]))
    bank, p, total = [(x, P)] * M, np.full(M, 1 / M), 0.0
    for k in range(3, len(t)):
        c = T @ p
        scores, parts = np.log(c), []
        directions, numbers = numbers_of_plot(spec, columns, k, shares)
        for i, (F, Q) in enumerate(models_over(options, t[k] - t[k - 1])):
            mean, P = merged(T[i] * p / c[i], bank)
            mean, P = F @ mean, F @ P @ F.T + Q
            scores[i] += np.linalg.slogdet(directions)[1]
            for direction, laws in zip(directions, numbers, strict=True):
                score, mean, P = taken_number(mean, P, direction @ H, direction @ z[k], laws)
                scores[i] += score
            parts.append((mean, P))
        density = logsumexp(scores)
        total += density
        p, bank = np.exp(scores - density), parts
    return total


def numbers_of_plot(spec, columns, k, shares):
    """The directions (3, 3) along which the numbers of plot k are measured in the local axes, and of each number the
    probabilities, means and variances of its error."""
    shifts, numbers = number_shifts(spec, columns, k).T / spec.sensor.sigma, []
    for name, sigma, one in zip(("range_m", "elevation_rad", "azimuth_rad"), spec.sensor.sigma, shares, strict=True):
        chances, means, widths = error_laws(outlier_law(*one, *SIZES), np.ptp(columns[name]), sigma**2)
        numbers.append((chances, means * sigma, (widths * sigma) ** 2))
    return np.linalg.inv(shifts), numbers


def taken_number(mean, P, h, z, laws):
    """The logarithm of a number's density, and the mean and covariance after it, of all laws of its error."""
    scores, hypotheses = [], []
    for chance, shift, variance in zip(*laws, strict=True):
        if chance > 0:
            S, e = h @ P @ h + variance, z - shift - h @ mean
            scores.append(np.log(chance) + normal.logpdf(e, 0.0, S))
            hypotheses.append((mean + P @ h * e / S, P - np.outer(P @ h, P @ h) / S))
    score = logsumexp(scores)
    return score, *merged(np.exp(np.array(scores) - score), hypotheses)


def number_shifts(spec, columns, k):
    """How far (3, 3) an error of one σ in each number moves plot k in the local axes."""
    seen = np.array([columns[name][k] for name in ("range_m", "elevation_rad", "azimuth_rad")])
    turn = frames.rotation(spec.sensor.antenna_azimuth_rad, spec.sensor.antenna_elevation_rad)
    return (turn @ frames.jacobian(seen) * spec.sensor.sigma).T


def merged(weights, hypotheses):
    mean = sum(w * x for w, (x, _) in zip(weights, hypotheses, strict=True))
    return mean, sum(w * (P + np.outer(x - mean, x - mean)) for w, (x, P) in zip(weights, hypotheses, strict=True))


def test_far_outliers_of_a_range_leave_its_sigma_as_it_is():
    """By the change of the logarithm with σ of the range, against the plots without them; by 12 of 120 that are 6000 km
    off σ was 25 % too large."""
    case, columns = loaded("multimodel_1hz"), recording("multimodel_1hz", "scans=120")
    is_off = np.arange(120) % 10 == 5
    wild = columns | {"range_m": columns["range_m"] + 6e6 * is_off}
    missed = columns | {name: np.where(is_off, np.nan, columns[name]) for name in columns if name != "t_s"}
    changes = []
    for plots, law in ((wild, ErrorLaw(outlier_laws=(outlier_law(0.0, 0.1),))), (missed, ErrorLaw())):
        one = likelihood(case, None, plots)
        values = np.array([one.stated[:4] * [factor, 1, 1, 0] for factor in (1.0, 1.25)])
        changes.append(one(values[1], law) - one(values[0], law))
    assert changes[0] == pytest.approx(changes[1], abs=0.5)


PAIR = (
    "filters=[{name: two, family: imm, merge: moment, models: [{motion: uniform, sigma_acceleration_mps2: 5}, "
    "{motion: accelerated, sigma_acceleration_mps2: 30}], transition: [[0.9, 0.1], [0.1, 0.9]], "
    "transition_interval_s: 1}, {name: one, family: kalman, models: [{motion: uniform, sigma_acceleration_mps2: 20}]}, "
    "{name: pairs, family: gpb2, merge: moment, models: [{motion: uniform, sigma_acceleration_mps2: 20}, "
    "{motion: uniform, sigma_acceleration_mps2: 20}], transition: [[0.9, 0.1], [0.1, 0.9]], transition_interval_s: 1}]"
)


@pytest.mark.parametrize("shares", [NO_OUTLIERS, ((0.03, 0.07), (0.0, 0.02), (0.1, 0.0))])
def test_the_multimodel_likelihood_is_that_of_a_textbook_filter(shares):
    case, columns = loaded("multimodel_1hz", "scans=30", PAIR), recording("multimodel_1hz", "scans=30")
    for name, T in (("two", np.array([[0.9, 0.1], [0.1, 0.9]])), ("one", np.ones((1, 1)))):
        one = likelihood(case, name, columns)
        (options,) = (each for each in case.spec.filters if each.name == name)
        expected = interacting(case, options, columns, T, shares)
        law = ErrorLaw(outlier_laws=tuple(outlier_law(*one_share, *SIZES) for one_share in shares))
        assert one(one.stated, law) == pytest.approx(expected, rel=density_rounding(case, columns))


def test_a_number_of_a_multimodel_plot_is_an_outlier_alone():
    """An error of 400 m in a range, σ 2.5 m: taken for the whole plot's, it would double every angle's σ."""
    columns = recording("multimodel_1hz", "scans=40")
    columns["range_m"][20] += 400.0
    one = likelihood(loaded("multimodel_1hz"), "MMA2-122", columns)
    (sound,) = one.soundness(one.stated, ErrorLaw(outlier_laws=(outlier_law(0.03, 0.03),)))
    assert sound["range_m"][20] < 0.001
    assert min(sound["elevation_rad"][20], sound["azimuth_rad"][20]) > 0.9


def test_the_multimodel_likelihood_does_not_leap():
    """Along a key, where the filter's own rule of merges, which chooses, makes it leap by units."""
    case = loaded("multimodel_1hz")
    one = likelihood(case, "MMA2-122", *(recording("multimodel_1hz", "scans=60", number=i) for i in range(5)))
    grid = [np.array([2.7948 * (1 + step), 0.00183, 0.001705, 0.0]) for step in np.linspace(-0.02, 0.02, 17)]
    smooth, leaping = (
        np.abs(np.diff([of(values) for values in grid], n=2)).max()
        for of in (one, lambda at: one.by_number(at)["plot"])
    )
    assert smooth < 0.02
    assert leaping > 1


@pytest.mark.parametrize("shares", [(0.0, 0.0), (0.03, 0.07)])
@pytest.mark.parametrize("family", ["imm", "gpb1", "gpb2"])
def test_equal_models_are_one(family, shares):
    """Whatever is merged of two models alike: the Kalman filter. The density of pairs is found in another way."""
    equal = PAIR.replace("gpb2", family)
    case, columns = loaded("multimodel_1hz", "scans=30", equal), recording("multimodel_1hz", "scans=30")
    one, pairs = (likelihood(case, name, columns) for name in ("one", "pairs"))
    law = ErrorLaw(outlier_laws=(outlier_law(*shares, *SIZES),))
    assert pairs(pairs.stated, law) == pytest.approx(one(one.stated, law), rel=density_rounding(case, columns))


@pytest.mark.parametrize("family", ["imm", "gpb1", "gpb2"])
def test_outliers_that_hardly_occur_change_no_multimodel_likelihood(family):
    """Of different models, with plots missing: the plots that may be outliers have a kernel of their own."""
    case, columns = (
        loaded("multimodel_1hz", "scans=40", PAIR.replace("imm", family)),
        recording("multimodel_1hz", "scans=40"),
    )
    allowed = density_rounding(case, columns)
    columns["range_m"][[10, 20, 21, 39]] = np.nan
    one = likelihood(case, "two", columns)
    rare = ErrorLaw(outlier_laws=(outlier_law(1e-16, 1e-16, *SIZES),))
    assert one(one.stated, rare) == pytest.approx(one(one.stated), rel=allowed)


def test_the_multimodel_likelihood_is_best_of_the_filter_that_fits_and_at_the_true_error():
    """The case that misled: the advice named the second best filter."""
    case, columns = loaded("multimodel_1hz"), recording("multimodel_1hz", "sensor.sigma_azimuth_deg=0.3")
    known = [likelihood(case, member.name, columns) for member in case.spec.filters]
    assert advice.compare_filters(known).best == "MMA2-122"
    best, gains = known[0], {}
    for i, key in enumerate(best.keys):
        for factor in (1 / 3, 3.0):
            values = best.stated.copy()
            values[i] *= factor
            gains[key, factor] = best(values) - best(best.stated)
    assert max(gains, key=gains.get) == ("sensor.sigma_azimuth_rad", 3.0)
    assert gains["sensor.sigma_azimuth_rad", 3.0] > 100


# ---- ambiguous Doppler -----------------------------------------------------------------------------------------------


def test_the_density_of_a_folded_velocity_sums_over_the_folds():
    """Two plots by hand: the second range, then the second velocity under the fold that each hypothesis takes."""
    case = loaded("ambiguous_rls4", "radar.repetition_rate_hz=20000")  # a span of 300 m/s: few folds
    sigma_r, sigma_v, T, D = 50.0, 1.0, 10.0, 300.0
    prior, q = case.spec.prior, 1e-3
    columns = {"t_s": np.array([0, T]), "range_m": np.array([1e5, 1.02e5]), "velocity_mps": np.array([120.0, 130.0])}
    folds = 120.0 + D * np.arange(-20, 21)
    weights = np.exp(-0.5 * folds**2 / (S := prior.sigma_velocity_mps**2 + sigma_v**2)) / np.sqrt(2 * np.pi * S)
    F, P = transition(T), np.diag([sigma_r**2, prior.sigma_velocity_mps**2, prior.sigma_acceleration_mps2**2])
    gain = P[:, 1] / S
    P = P - np.outer(gain, gain) * S
    states = [F @ (np.array([1e5, 0, 0]) + gain * v) for v in folds]
    P = F @ P @ F.T + manoeuvre_covariance(q, T)
    ranges = np.array([normal.pdf(1.02e5, x[0], P[0, 0] + sigma_r**2) for x in states])
    K = P[:, 0] / (P[0, 0] + sigma_r**2)
    states, P = [x + K * (1.02e5 - x[0]) for x in states], P - np.outer(K, P[0])
    velocities = [
        sum(normal.pdf(130 + D * n, x[1], P[1, 1] + sigma_v**2) for n in np.arange(-20, 21)) for x in states
    ]  # fmt: skip
    one = likelihood(case, "memory", columns)
    found = one.by_number(one.stated)
    # After the first velocity the filter drops the folds that are so much less likely than the likeliest.
    (options,) = (each for each in case.spec.filters if each.name == "memory")
    kept = np.where(weights < options.prune_below * weights.max(), 0.0, weights)
    # States are known to their rounding, e/S of which a density's logarithm changes by.
    size = 1.02e5 * np.abs(1.02e5 - np.array([x[0] for x in states])).max() / sigma_r**2
    assert_rounded(found["range_m"], np.log(kept @ ranges / kept.sum()), size, operations=10)
    expected = np.log(weights.sum()) + np.log((kept * ranges) @ velocities / (kept @ ranges))
    assert_rounded(found["velocity_mps"], expected, size, operations=10)


def test_the_span_beside_a_velocity_counts_before_that_of_the_config():
    case, columns = loaded("ambiguous_rls4"), recording("ambiguous_rls4")
    other = loaded("ambiguous_rls4", "radar.repetition_rate_hz=2000")
    told = columns | {"span_mps": np.full(len(columns["t_s"]), 15.0)}
    for filter_name in ("memory", "no memory"):
        plain, with_span = likelihood(case, filter_name, columns), likelihood(other, filter_name, told)
        assert with_span(with_span.stated) == plain(plain.stated)
        assert abs(likelihood(other, filter_name, columns)(plain.stated) - plain(plain.stated)) > 1  # e times as likely


def test_an_outlier_among_folded_velocities_is_anywhere_in_the_span():
    """Some σ off are as good as another fold: a share of near outliers is one of far ones; of ranges it is not."""
    case, columns = loaded("ambiguous_rls4"), recording("ambiguous_rls4")
    one, none = likelihood(case, "memory", columns), outlier_law(0.0, 0.0)

    def value(range_law, velocity_law):
        return one(one.stated, ErrorLaw(outlier_laws=(range_law, velocity_law)))

    near, far = outlier_law(0.05, 0.0), outlier_law(0.0, 0.05)
    assert one.far_kinds == ("velocity_mps",)
    assert value(none, near) == value(none, far)
    assert value(near, none) != value(far, none)


def test_a_velocity_whose_error_is_a_span_tells_nothing():
    """It is as likely as any other, whatever the filter knew: one over the span; the ranges as without it."""
    case, columns = loaded("ambiguous_rls4"), recording("ambiguous_rls4")
    blind = columns | {"velocity_mps": np.full(len(columns["t_s"]), np.nan)}
    one = likelihood(case, "memory", columns)
    values = np.array([one.stated[0], 15.0, one.stated[2]])
    found, without = one.by_number(values), likelihood(case, "memory", blind).by_number(values)
    assert found["range_m"] == without["range_m"]
    rows = len(columns["t_s"])
    assert_rounded(found["velocity_mps"], -rows * np.log(15.0), operations=rows)


@pytest.mark.parametrize("sigma_r", [250.0, 2e6])
@pytest.mark.parametrize("sigma_v", [20.0, 28.0, 38.0, 50.0])
def test_velocities_that_tell_little_are_as_likely_as_over_all_folds(sigma_r, sigma_v):
    """By the normal density of all numbers of three plots together, summed over their folds; the first range is given.
    With the larger σ no row tells anything, with the smaller ones all do, or the first ones."""
    case, columns, n, T, q, D = loaded("ambiguous_rls2"), recording("ambiguous_rls2", "scans=3"), 3, 10.0, 2e-2, 75.0
    prior, F = case.spec.prior, transition(T)
    states = [[np.diag([sigma_r**2, prior.sigma_velocity_mps**2, prior.sigma_acceleration_mps2**2])]]
    for k in range(1, n):  # states[j][i]: covariance of the states at rows i and j
        states.append([states[-1][i] @ F.T for i in range(k)])
        states[-1].append(F @ states[k - 1][k - 1] @ F.T + manoeuvre_covariance(q, T))
    whole = np.block([[states[max(i, j)][min(i, j)] if i <= j else states[i][j].T for j in range(n)] for i in range(n)])
    numbers = [*range(3, 3 * n, 3), *range(1, 3 * n, 3)]  # ranges, velocities
    sigmas = np.array([sigma_r] * (n - 1) + [sigma_v] * n)
    spread = whole[np.ix_(numbers, numbers)] + np.diag(sigmas**2)
    folds = np.stack(np.meshgrid(*[np.arange(-16, 17)] * n), axis=-1).reshape(-1, n)
    ranges = np.tile(columns["range_m"][1:] - columns["range_m"][0], (len(folds), 1))
    root = np.linalg.cholesky(spread / np.outer(sigmas, sigmas))
    white = np.linalg.solve(root, (np.hstack([ranges, columns["velocity_mps"] + D * folds]) / sigmas).T)
    densities = np.exp(-0.5 * (white**2).sum(axis=0)) / np.prod(np.sqrt(2 * np.pi) * sigmas * np.diag(root))
    found = likelihood(case, "memory", columns)(np.array([sigma_r, sigma_v, q]))
    assert found == pytest.approx(np.log(densities.sum()), rel=0, abs=2e-3)


@pytest.mark.parametrize("name", ["memory", "no memory", "nearest fold", "range only"])
def test_missing_plots_count_as_nothing(name):
    """Rows without a plot among those with one: as without these rows, where no manoeuvre parts two steps from one."""
    case, columns = loaded("ambiguous_rls4"), recording("ambiguous_rls4")
    there = np.arange(len(columns["t_s"])) % 3 != 1
    some = columns | {key: np.where(there, columns[key], np.nan) for key in ("range_m", "velocity_mps")}
    one, kept = (
        likelihood(case, name, plots) for plots in (some, {key: column[there] for key, column in columns.items()})
    )
    values = np.append(one.stated[:-1], 0.0)
    # Of a parabola through the plots; ten operations a row.
    allowed = rounding(polynomial_condition(columns["t_s"]), 10 * len(columns["t_s"]))
    assert one.by_number(values) == pytest.approx(kept.by_number(values), rel=allowed)


def test_exponentials_are_those_of_numpy():
    """To 3 units in the last place; what is less than exp(-700) stays a number."""
    exponents = -np.concatenate([[0.0], np.geomspace(1e-18, 700, 2000)])
    values = exponents.copy()
    recorded_rows.take_exponentials(values)
    np.testing.assert_allclose(values, np.exp(exponents), rtol=3 * np.finfo(float).eps)
    least = np.array([-745.0, -1e300])
    recorded_rows.take_exponentials(least)
    np.testing.assert_allclose(least, np.exp(-700.0), rtol=1e-12)


def test_the_likeliest_hypotheses_are_kept_in_their_order():
    from radarsim.studies.ambiguous_doppler.kernels.recorded_rows import likeliest

    rng = np.random.default_rng(7)
    for most, least in ((5, 0.0), (40, 1e-2), (1, 0.5), (100, 1e-6)):
        w = np.round(-4 * rng.random(60), 1)
        w -= w.max()
        order = np.argsort(-w, kind="stable")
        kept = sorted([i for i in order if np.exp(w[i]) >= least][:most])
        np.testing.assert_array_equal(likeliest(w, most, least), kept)
    for most in (3, 10):
        assert 0 < likeliest(np.full(4, np.nan), most, 0.1).size <= most


def mixture_moments(x, w, P):
    """Mean and covariance of hypotheses x (3, n) of log weights w (n,) and the common packed covariance P."""
    p = np.exp(w) / np.exp(w).sum()
    mean = x @ p
    return mean, unpack(P) + (p * (x - mean[:, None])) @ (x - mean[:, None]).T


@pytest.mark.parametrize("order", [0, 1, 2])
def test_hypotheses_that_hardly_differ_are_merged_by_moments(order):
    """Of their mixture mean and covariance stay; none that is left is nearer to another than was asked, but for the
    moves of the means."""
    rng, spread = np.random.default_rng(3), np.zeros((3, 3))
    spread[: order + 1, : order + 1] = manoeuvre_covariance(1.0, 2.0)[: order + 1, : order + 1] + np.eye(order + 1)
    P = np.array(pack(spread))
    x, w = np.linalg.cholesky(spread + np.diag(np.diag(spread) == 0)) @ rng.normal(size=(3, 80)), -3 * rng.random(80)
    x[order + 1 :] = 0.0
    merged_P = P.copy()
    merged_x, merged_w = recorded_rows.merge_alike(x, w, merged_P, 0.5)
    assert merged_w.size < 60
    for before, after in zip(mixture_moments(x, w, P), mixture_moments(merged_x, merged_w, merged_P), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-12 * np.abs(spread).max())
    alone, alone_w = recorded_rows.merge_alike(x, w, P.copy(), 1e-9)
    np.testing.assert_allclose(alone, x, rtol=1e-14)
    np.testing.assert_allclose(alone_w, w, rtol=1e-14)


@pytest.mark.parametrize("law", [ErrorLaw(), ErrorLaw(outlier_laws=(outlier_law(0.03, 0.01), outlier_law(0.0, 0.05)))])
def test_merged_hypotheses_are_as_likely_as_the_longest_list(monkeypatch, law):
    """Against lists that drop next to nothing, to 0.002: a thousandth of what an interval's end is below a maximum."""
    columns = recording("ambiguous_rls2", "scans=40")
    merged = likelihood(loaded("ambiguous_rls2"), "memory", columns)
    complete = likelihood(
        loaded("ambiguous_rls2", "filters.5.hypotheses=4000", "filters.5.prune_below=1e-9"), "memory", columns
    )
    for factor in (0.8, 1.0):
        values = factor * merged.stated
        value = merged(values, law)
        with monkeypatch.context() as patch:
            patch.setattr(ambiguous_likelihood, "MERGE_DISTANCE", 0.0)
            assert value == pytest.approx(complete(values, law), rel=0, abs=2e-3)


def test_a_wrong_velocity_error_is_named_though_velocities_fold(monkeypatch):
    monkeypatch.setattr(advice, "MAX_FINDINGS", 1)
    case = loaded("ambiguous_rls4", "filters=[{name: memory, doppler: folded, manoeuvre_variance: 1.0e-7}]")
    wrong = recording("ambiguous_rls4", "radar.sigma_velocity_mps=4")
    assert advice.find_errors(likelihood(case, None, wrong))[0].name == "radar.sigma_velocity_mps"
    assert advice.find_errors(likelihood(case, None, recording("ambiguous_rls4"))) == []


def test_innovations_of_a_right_filter_over_folded_velocities():
    """NIS of range and velocity over 20 realisations: 1 within Z standard errors."""
    case = loaded("ambiguous_rls4", "filters=[{name: memory, doppler: folded, manoeuvre_variance: 0.0}]")
    nis = []
    for i in range(20):
        made = recording_interface(case).tracker(case).feed(recording("ambiguous_rls4", "scans=25", number=i))
        nis.append(made.nis[0, 5:])
        assert np.nanmax(np.abs(made.residual[0, 5:, 1])) <= 7.5
    nis = np.concatenate(nis)
    for number in range(2):
        values = nis[np.isfinite(nis[:, number]), number]
        assert len(values) > 300
        assert abs(values.mean() - 1) < Z * np.sqrt(2 / len(values))


def test_an_angle_fitted_takes_the_place_of_the_one_in_degrees(tmp_path, monkeypatch):
    """And a key of one filter among several that of this filter alone."""
    from radarsim.api import configs
    from radarsim.api.new_configs import write_new_config

    monkeypatch.chdir(tmp_path)
    values = {"sensor.sigma_bearing_rad": 0.05, "filters.4.manoeuvre_variance": 0.25}
    spec = configs.load(write_new_config("mine", "sonar_smoothing", values=values)).cases[0].spec
    assert (spec.sensor.sigma_bearing_rad, spec.sensor.sigma_range_m) == (0.05, 30)
    assert [one.manoeuvre_variance for one in spec.filters[3:6]] == [None, 0.25, 0.0025]


def test_errors_far_below_both_sigmas_are_not_told_as_errors_that_last():
    """Of one explanation alone these explain smooth plots best; both σ together explain them better."""
    case = loaded("rls2", "scans=60")
    track = recording("rls2", "scans=60", "radar.sigma_range_m=30", "radar.sigma_velocity_mps=1")
    findings = {finding.name: finding.value for finding in advice.find_errors(likelihood(case, None, track))}
    assert "correlation" not in findings
    assert 20 < findings["radar.sigma_range_m"] < 40
    assert 0.7 < findings["radar.sigma_velocity_mps"] < 1.4
