"""Window schedules against the paper and against its formulas written out; the exact tail against known laws."""

import itertools
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import chi2

from radarsim.bursts import block_sums, estimators, schedule_design
from radarsim.bursts import fisher as bursts_fisher
from radarsim.bursts.burst import Burst
from tests.studies.discriminator import naive as naive
from tests.tolerances import assert_rounded, scaled_condition, share_error

COMPUTED = Burst(10e9, 1e-5, 1e-6, 1e-6, 30000, 1.0, 2.25)
PRINTED = replace(COMPUTED, noise_variance=9.0)
TIMES = np.array([100.0, 150.0, 500.0, 1000.0, 2000.0])
PRINTED_PRIOR = np.array([6.1, 67.5, 6.1e3, 183.38e3, 2.426e6])


def designer(burst=COMPUTED, sigma=None, **condition):
    fisher = partial(bursts_fisher.fisher, burst, 5)
    sigma = bursts_fisher.spreads(fisher(burst.duration_s)) * TIMES if sigma is None else sigma
    return schedule_design.Designer(burst, sigma, fisher, schedule_design.Condition(**condition))


def test_paper_pairs_three_sigma_with_its_probability():
    assert schedule_design.spread_factor(0.99) == 3.0
    assert schedule_design.spread_factor(0.9) < 3.0 < schedule_design.spread_factor(0.999)


@pytest.mark.parametrize(("weights", "threshold"), [([1], 0.1), ([1], 60), ([2, 2], 5), ([0.5] * 5, 1), ([1e6], 1)])
def test_tail_of_equal_weights_is_chi_square(weights, threshold):
    expected = chi2.sf(threshold / weights[0], len(weights))
    # To the 10⁻¹² that it states; weights of 10⁶ move the pole, at 0, beside the path.
    found = schedule_design.tail_probability(np.array(weights, float), threshold)
    assert found == pytest.approx(expected, rel=1e-12)


def test_tail_of_unequal_weights_against_sampling():
    weights, rng = np.array([0.19, 0.05, 2e-3, 1e-7]), np.random.default_rng(1)
    n = 2_000_000
    share = np.mean(rng.standard_normal((n, 4)) ** 2 @ weights > 1.0)
    expected = schedule_design.tail_probability(weights, 1.0)
    assert share == pytest.approx(expected, abs=share_error(expected, n))


def test_gaussian_condition_is_equation_14():
    d = designer()
    before, after = 462e-5, 948e-5
    values = d.handover(before)(after).values
    (one, _), (other, mu) = d.posterior(before), d.posterior(after)
    # The twin's error is a difference of inverses; of the form, 1 is taken off.
    twin, condition = naive.handover_form(one, other, mu), scaled_condition(np.stack([one, other])).max()
    assert_rounded(
        schedule_design.excess(values, d.condition), twin - 1.0, size=twin, condition=condition, operations=25
    )


def test_computed_schedule():
    windows = designer().windows()
    assert len(windows) == 13
    assert windows[0] == 199
    assert windows[-1] == 30000
    assert len(designer(threshold=0.5).windows()) == 16


def test_printed_schedule_starts_with_the_printed_window():
    d = designer(PRINTED, PRINTED_PRIOR, threshold=0.5)
    windows = d.windows()
    assert windows[0] == 179  # 1.79 ms
    assert len(windows) == 22
    assert len(designer(PRINTED, PRINTED_PRIOR).windows()) == 17


def test_each_designed_window_is_the_longest_safe_one():
    d, period = designer(), 1e-5
    windows = d.windows()
    for a, b in itertools.pairwise(windows[:-1]):
        form = d.handover(a * period)
        shorter, longer = (schedule_design.excess(form(after * period).values, d.condition) for after in (b - 1, b + 1))
        assert shorter < 0 < longer


def losses(d, windows):
    """The probability of each hand-over's loss, as the form's tail has it."""
    forms = [d.handover(a * 1e-5)(b * 1e-5) for a, b in itertools.pairwise(windows)]
    return [schedule_design.tail_probability(form.values, 1.0) for form in forms]


def test_hand_overs_of_the_paper_are_less_safe_than_designed():
    """The factor 3 gives 0.978 a hand-over, not 0.99: the form is one chi-square, not a Gaussian."""
    d, windows = designer(), designer().windows()
    lost = losses(d, windows)
    assert np.median(lost) == pytest.approx(0.022, abs=0.001)


def test_exact_tail_keeps_its_probability():
    d = designer(tail="exact", probability=0.999)
    windows = d.windows()
    lost = losses(d, windows)
    assert max(lost[:-1]) == pytest.approx(1e-3, rel=0.05)
    assert len(windows) == 16


def test_a_better_forecast_needs_fewer_windows():
    sigma = designer().sigma
    found = [designer(sigma=sigma * scale).windows() for scale in (1, 0.1, 0.01, 0.001)]
    assert [len(w) for w in found] == [13, 8, 5, 3]
    assert [round(w[0] * 1e-2) for w in found] == [2, 16, 65, 166]  # ms


def test_a_perfect_forecast_needs_one():
    assert designer(sigma=designer().sigma * 1e-6).windows() == [30000]


def test_density_puts_windows_at_geometric_means():
    assert schedule_design.densify([100, 400, 30000], 2) == [100, 200, 400, 3464, 30000]
    assert schedule_design.densify([100, 800], 3) == [100, 200, 400, 800]
    assert schedule_design.densify([5, 6], 2) == [5, 6]  # no room between
    assert len(schedule_design.densify(designer().windows(), 2)) == 25


def test_direction_is_the_leading_error_of_a_handover():
    """One radian rms along it; random errors of the hand-over lie along it but for a tenth."""
    d = designer()
    windows = d.windows()
    k, period = 6, 1e-5
    direction = schedule_design.handover_directions(d, windows)[k]
    information, mu = d.posterior(windows[k] * period)
    mean_square = direction @ information @ direction / (2 * mu)
    assert_rounded(mean_square, 1.0, condition=scaled_condition(information), operations=25)
    values = d.handover(windows[k - 1] * period)(windows[k] * period).values
    assert np.sqrt(values[-1]) == pytest.approx(0.437, abs=0.005)
    assert np.sqrt(values[-2]) < 0.1 * np.sqrt(values[-1])


@pytest.mark.parametrize("per_window", [4, 16, 64])
def test_blocks_end_with_windows_and_grow_with_time(per_window):
    windows = designer().windows()
    edges = block_sums.block_edges(windows, per_window)
    assert set(windows) <= set(edges)
    assert edges[0] == 0
    lengths = np.diff(edges)
    assert lengths.min() >= 1
    assert np.all(lengths <= np.maximum(1, np.maximum(edges[:-1], windows[0]) // per_window))
    assert len(lengths) < 2.2 * per_window * (1 + np.log(30000 / windows[0]))


def test_step_root_solves_for_any_coherence():
    rng = np.random.default_rng(3)
    a = rng.normal(size=(5, 5))
    data, precision = a @ a.T * 50, np.array([0, 1, 10, 100, 1000.0])
    root, share = estimators.step_root(data, precision)
    for coherence in (1.0, 0.5, 0.25):
        built = root.T @ np.diag(1 / (1 - (1 - coherence) * share)) @ root
        matrix = coherence * data + np.diag(precision)
        wanted = np.linalg.inv(matrix)
        assert_rounded(built, wanted, np.full((5, 5), np.abs(wanted).max()), np.linalg.cond(matrix), operations=25)


def test_a_wide_phase_prior_says_nothing():
    assert bursts_fisher.phase_prior(np.array([6.1, 2.0]))[0] == 0.0
    np.testing.assert_array_equal(bursts_fisher.phase_prior(np.array([0.5, 2.0])), [4.0, 0.25])


@pytest.mark.parametrize("per_window", [4, 16, 24])
def test_merged_blocks_are_few_and_short(per_window):
    windows = designer().windows()
    edges = block_sums.block_edges(windows, per_window)
    for pulses in windows:
        ends = block_sums.merged_block_ends(edges, pulses, per_window)
        merged = edges[[0, *ends]]
        assert merged[-1] == pulses
        assert np.diff(merged).max() <= max(1, pulses / per_window)
        assert len(ends) < 1.6 * per_window + 2
