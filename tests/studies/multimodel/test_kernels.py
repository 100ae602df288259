"""The multiple-model kernel against its textbook twin, family by family, rule by rule, on random banks."""

import numpy as np
import pytest

from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel.kernels import filter_strip, hypothesis, layout
from radarsim.studies.multimodel.kernels.plots import pack_frame
from tests.studies.multimodel import naive
from tests.tolerances import assert_rounded, rounding, scaled_condition

FAMILIES = {"kalman": layout.KALMAN, "gpb1": layout.GPB1, "imm": layout.IMM, "gpb2": layout.GPB2}
RULES = {
    "moment": layout.MOMENT,
    "best": layout.BEST,
    "combined": layout.COMBINED,
    "modified_combined": layout.MODIFIED,
}
UPPER = np.triu_indices(3)
DT = 0.05
FRAME = pack_frame(np.eye(3), 0.0, (1.0, 1.0, 1.0), 1, False, 1.0)

OPERATIONS = 200  # of an update of nine states by three numbers: terms of the products that an element is summed of
EXPONENT = 50  # a weight is the exponential of so much at most, which multiplies a relative error


def bank(size, seed):
    """A random bank: motions with sigmas, a column-stochastic matrix, starting probabilities."""
    rng = np.random.default_rng(seed)
    kinds = [("accelerated", 30.0)] + [
        (str(rng.choice(["uniform", "accelerated", "still"], p=[0.5, 0.4, 0.1])), float(10 ** rng.uniform(-1.5, 1.5)))
        for _ in range(size - 1)
    ]
    T = np.eye(size) * 40 + rng.random((size, size))
    p = rng.random(size)
    return kinds, T / T.sum(0), p / p.sum()


def workload(scans, seed=1, missing=0.0):
    """Plots (K, 3, WIDTH) of a target that manoeuvres, full covariances (K, 3, 3) that change, start x (9,) and P
    (9, 9)."""
    rng = np.random.default_rng(seed)
    t = np.arange(1, scans + 1) * DT
    acceleration = np.stack([12 * (t % 60 > 40), -20 * (t % 50 > 30), 3 * np.sin(t)], axis=1)
    velocity = np.cumsum(acceleration, axis=0) * DT + [-220, 60, -5]
    position = np.cumsum(velocity, axis=0) * DT + [30e3, 20e3, 8e3]
    root = rng.normal(size=(scans, 3, 3)) * 3 + np.eye(3) * 12
    plots = position[:, :, None] + root @ rng.normal(size=(scans, 3, WIDTH))
    lost = rng.random((scans, WIDTH)) < missing
    plots = np.where(lost[:, None], np.nan, plots)
    x = np.zeros(9)
    x[0::3], x[1::3] = [30e3 + 20, 20e3 - 20, 8e3], [-215, 55, 0]
    return plots, root @ np.swapaxes(root, 1, 2), x, np.diag([50.0**2, 20.0**2, 5.0**2] * 3)


def run_kernel(family, rule, output, kinds, T, p, plots, covariances, x, P, prediction=0):
    """Estimates (K, 9, WIDTH), variances (K, 9, WIDTH), probabilities (K, M, WIDTH), and the work rows left behind."""
    scans, size = len(plots), len(kinds)
    work, numbers = hypothesis.work_arrays()
    lane_values = work.reshape(-1, WIDTH)
    for i in range(size):
        h = lane_values[i * layout.HYPOTHESIS :]
        h[:9] = x[:, None]
        for axis in range(3):
            block = P[3 * axis : 3 * axis + 3, 3 * axis : 3 * axis + 3]
            h[layout.OWN + 6 * axis : layout.OWN + 6 * axis + 6] = block[UPPER][:, None]
        h[layout.PROBABILITY] = p[i]
    strip = rows(scans * layout.PLOT)
    cells = strip.reshape(scans, layout.PLOT, WIDTH)
    cells[:, layout.DETECTED] = ~np.isnan(plots).any(axis=1)
    cells[:, :3], cells[:, layout.COVARIANCE : layout.DETECTED] = (
        np.nan_to_num(plots),
        covariances[:, UPPER[0], UPPER[1], None],
    )
    out = rows(scans * layout.OUTPUT)
    models = np.array([[k != "still", k == "accelerated", s] for k, s in kinds], dtype=float).ravel()
    rules = np.array([FAMILIES[family], RULES[rule], RULES[output], prediction])
    intervals, times, reported = np.zeros(scans, dtype=np.int64), np.array([DT]), np.ones(scans, dtype=np.int64)
    transitions = np.ascontiguousarray(T).ravel()
    filter_strip.filter_strip(
        work, numbers, strip, 0, scans, models, transitions, intervals, times, rules, FRAME, reported, out
    )
    cells = out.reshape(scans, layout.OUTPUT, WIDTH)
    variances = cells[:, layout.VARIANCE : layout.VARIANCE + 9]
    return cells[:, :9], variances, cells[:, layout.MODELS : layout.MODELS + size], lane_values


def compare(family, rule, output, size, scans, missing=0.0, lanes=(0,), seed=3):
    kinds, T, p = bank(size, seed + size)
    plots, covariances, x, P = workload(scans, missing=missing)
    got = run_kernel(family, rule, output, kinds, T, p, plots, covariances, x, P)
    for lane in lanes:
        twin = naive.track(
            family,
            rule,
            output,
            kinds,
            lambda t: np.linalg.matrix_power(T, round(t / DT)),
            x,
            P,
            p,
            plots[:, :, lane],
            covariances,
            np.full(scans, DT),
        )
        allowed = rounding(scaled_condition(twin[1]).max(), OPERATIONS)
        scale = np.abs(twin[0]).max(axis=0) + 1
        assert np.max(np.abs(got[0][:, :, lane] - twin[0]) / scale) <= allowed
        variances = np.diagonal(twin[1], axis1=1, axis2=2)
        assert np.max(np.abs(got[1][:, :, lane] - variances) / (variances.max(axis=0) + 1e-3)) <= allowed
        assert np.max(np.abs(got[2][:, :, lane] - twin[2])) <= EXPONENT * allowed


GRID = [("kalman", "moment", 1)] + [
    pytest.param(family, rule, size, marks=[pytest.mark.slow] * (size in (1, 4)))
    for family in ("gpb1", "imm", "gpb2")
    for rule in RULES
    for size in range(1, 6)
]


@pytest.mark.parametrize(("family", "rule", "size"), GRID)
def test_kernel_equals_its_twin(family, rule, size):
    compare(family, rule, "best" if rule == "combined" else "moment", size, 120, lanes=(0, 5))


@pytest.mark.slow_cases("gpb*")
@pytest.mark.parametrize("family", ["kalman", "gpb1", "imm", "gpb2"])
def test_missed_plots_are_one_prediction_over_the_real_interval(family):
    compare(family, "combined", "best", 1 if family == "kalman" else 3, 150, missing=0.3, lanes=range(WIDTH))


def hypothesis_of(cells, lane=0):
    """Mean (9,) and covariance (9, 9) of the hypothesis that begins at a row."""
    P = np.empty((9, 9))
    for axis in range(3):
        block = cells[layout.OWN + 6 * axis :][:6, lane]
        for value, i, j in zip(block, *UPPER, strict=True):
            P[3 * axis + i, 3 * axis + j] = P[3 * axis + j, 3 * axis + i] = value
    for pair, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
        block = cells[layout.CROSS + 9 * pair :][:9, lane].reshape(3, 3)
        P[3 * a : 3 * a + 3, 3 * b : 3 * b + 3], P[3 * b : 3 * b + 3, 3 * a : 3 * a + 3] = block, block.T
    return cells[:9, lane], P


@pytest.mark.parametrize("rule", RULES)
def test_imm_equals_the_papers_form_of_n_squared_extrapolations(rule):
    kinds, T, p = bank(3, 11)
    plots, covariances, x, P = workload(60)
    merged_first = extrapolated_first = (np.tile(x, (3, 1)), np.tile(P, (3, 1, 1)), p)
    models = [naive.motion(*kind, DT) for kind in kinds]
    for z, R in zip(plots[:, :, 0], covariances, strict=True):
        merged_first = naive.imm(*merged_first, models, T, z, R, rule)
        extrapolated_first = naive.imm_by_extrapolations(*extrapolated_first, models, T, z, R, rule)
    allowed = rounding(scaled_condition(merged_first[1]).max(), OPERATIONS)
    for left, right in zip(merged_first, extrapolated_first, strict=True):
        assert np.abs(left - right).max() <= allowed * max(np.abs(right).max(), EXPONENT)


@pytest.mark.slow_cases_except("imm-combined")
@pytest.mark.parametrize(
    ("family", "rule"), [("kalman", "best"), ("gpb1", "moment"), ("imm", "combined"), ("gpb2", "moment")]
)
def test_covariances_stay_positive_over_1e5_steps(family, rule):
    kinds, T, p = bank(1 if family == "kalman" else 3, 5)
    kinds = [("accelerated", sigma) for _, sigma in kinds]
    plots, covariances, x, P = workload(100_000)
    estimates, _, probabilities, cells = run_kernel(family, rule, "best", kinds, T, p, plots, covariances, x, P)
    assert np.isfinite(estimates).all()
    assert_rounded(probabilities.sum(axis=1), np.ones((len(plots), WIDTH)), operations=8)  # shares
    for lane in range(WIDTH):
        eigenvalues = np.linalg.eigvalsh(hypothesis_of(cells, lane)[1])
        assert eigenvalues.min() > rounding(operations=OPERATIONS) * eigenvalues.max()  # what rounding cannot have made


def test_rules_break_ties_by_the_lower_number():
    assert np.argmax(naive.shares([0.4, 0.4, 0.2], 1, "best")) == 0
    kinds, T, p = [("uniform", 5.0)] * 3, np.eye(3), np.array([0.4, 0.4, 0.2])
    plots, covariances, x, P = workload(1)
    for rule in RULES:
        expected = naive.track("imm", rule, "best", kinds, lambda t: T, x, P, p, plots[:, :, 0], covariances, [DT])
        got = run_kernel("imm", rule, "best", kinds, T, p, plots, covariances, x, P)
        allowed = rounding(scaled_condition(expected[1][0]), OPERATIONS)
        assert np.abs(got[0][0, :, 0] - expected[0][0]).max() <= allowed * np.abs(expected[0][0]).max()


def test_a_model_that_cannot_be_reached_does_no_harm():
    kinds, p = [("uniform", 5.0), ("accelerated", 5.0), ("uniform", 1.0)], np.array([0.5, 0.5, 0.0])
    T = np.array([[0.9, 0.1, 0], [0.1, 0.9, 0], [0, 0, 1.0]])
    plots, covariances, x, P = workload(200)
    for family in ("gpb1", "imm", "gpb2"):
        got = run_kernel(family, "moment", "moment", kinds, T, p, plots, covariances, x, P)
        two = run_kernel(family, "moment", "moment", kinds[:2], T[:2, :2], p[:2], plots, covariances, x, P)
        # The same operations, of which some add a hypothesis of weight zero.
        np.testing.assert_allclose(got[0], two[0], rtol=rounding(operations=3 * 200), atol=0)
        assert np.all(got[2][:, 2] == 0)
