"""Planted faults: one small wrong change each, and the tests that must notice it. `make mutants` runs them all.

Each is a place of the program where a slip would give plausible, wrong numbers: a sign, a transposed index, a lost
term, a bound one off. A test of the ordinary suite keeps the list in step with the sources. The list goes on in
the other files `mutants_…`.
"""

from tests.trust.mutant import mutants
from tests.trust.mutants_controls import CONTROLS
from tests.trust.mutants_folds import FOLDS
from tests.trust.mutants_further import FURTHER
from tests.trust.mutants_rare import RARE
from tests.trust.mutants_recorded import RECORDED

LINEAR, RANDOM = "kernels/test_linear.py", "kernels/test_random.py"
TEXTBOOK = f"{LINEAR}::test_estimates_are_the_textbook_filter"
TWIN = "studies/multimodel/test_kernels.py::test_kernel_equals_its_twin"
SONAR = "studies/sonar/test_kernels.py::test_estimates_are_the_twins"
BURST = "studies/discriminator/test_kernels.py"
EXACT, SQUARES = "studies/range_doppler/test_exact.py", "studies/sonar/test_exact.py"
FRAMES, PLACES = "physics/test_frames.py", "studies/sonar/test_world.py"
STATISTICS, COVERAGE = "report/test_statistics.py", "trust/test_statistics.py"
BLOCKS, STORE = "engine/test_blocks.py", "engine/test_store.py"

KERNELS = (
    *mutants(
        "radarsim/kernels/random.py",
        ("U(0x1BD11BDAA9FC1A22)", "U(0x1BD11BDAA9FC1A23)", f"{RANDOM}::test_published_vectors"),
        ("U(12)) * 2.0**-52 + 2.0**-53", "U(12)) * 2.0**-52 + 2.0**-3", f"{RANDOM}::test_uniforms"),
        ("q + 0.2222219857317996", "q + 0.2222229857317996", f"{RANDOM}::test_polynomials_against_the_library"),
        (
            "radius * (c if turned else s)",
            "radius * (s if turned else c)",
            f"{RANDOM}::test_independence_within_a_pair",
        ),
    ),
    *mutants(
        "radarsim/kernels/linear.py",
        ("r + dt * (v + 0.5 * dt * a), v + dt * a, a", "r + dt * (v + dt * a), v + dt * a, a", TEXTBOOK),
        ("q + g1 * e + h1 * f", "q + g1 * e + h0 * f", TEXTBOOK),
        ("if k < start[f]:", "if k <= start[f]:", TEXTBOOK),
        ("r4 + rr * rr, v4 + vv * vv", "r4 + rr * vv, v4 + vv * vv", f"{LINEAR}::test_sums_are_those_of_the_estimates"),
        ("if row != beside:", "if row == beside:", f"{LINEAR}::test_sums_are_those_of_the_estimates"),
    ),
    *mutants(
        "radarsim/kernels/symmetric.py",
        ("f[4] * (f[4] * p[5]) + q[5]", "f[4] * (f[4] * p[5])", TWIN),
        ("m = s[0] * s[4] - s[1] * s[2]", "m = s[0] * s[4] - s[1] * s[1]", TWIN),
    ),
    *mutants(
        "radarsim/studies/multimodel/kernels/hypothesis.py",
        ("p[0] + mu * (P[0] + d[0] * d[0])", "p[0] + mu * P[0]", TWIN),
        ("(xx[1], xy[3], xz[3]), L)", "(xx[1], xy[1], xz[3]), L)", TWIN),
    ),
    *mutants(
        "radarsim/studies/multimodel/kernels/filters.py",
        ("TRANSITION + i * MOST + j) * get", "TRANSITION + j * MOST + i) * get", TWIN),
        (
            "where_greater(of_main, others, is_main, full(1.0))",
            "where_greater(others, of_main, is_main, full(1.0))",
            TWIN,
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/kernels/shared_gains.py",
        ("step_one * one[1, i] + fresh_one * a", "step_one * one[1, i] - fresh_one * a", SONAR),
    ),
    *mutants(
        "radarsim/studies/sonar/kernels/steps.py",
        (
            "where_greater(w, zero, zero, get(a, ages + i) + tau)",
            "where_greater(w, zero, zero, get(a, ages + i))",
            SONAR,
        ),
    ),
    *mutants(
        "radarsim/bursts/kernels/lanes.py",
        (
            "g0 + e, g1 + m1 * e + s1 * h",
            "g0 + e, g1 + m1 * e - s1 * h",
            f"{BURST}::test_merged_blocks_hold_the_same_likelihood",
        ),
        ("1.0 - 0.5 * square, square - 1.0", "1.0 - square, square - 1.0", f"{BURST}::test_sine_and_cosine_of_lanes"),
    ),
    *mutants(
        "radarsim/studies/discriminator/kernels/sums.py",
        (
            "met[i, k, 0] = 1.0 if worst < 5.0",
            "met[i, k, 0] = 1.0 if worst < 4.0",
            f"{BURST}::test_sums_of_errors_against_numpy",
        ),
        (
            "met[i, k, 2] = 1.0 if worst_posterior < 5.0",
            "met[i, k, 2] = 1.0 if worst < 5.0",
            f"{BURST}::test_sums_of_errors_against_numpy",
        ),
    ),
)

FILTERS = (
    *mutants(
        "radarsim/studies/range_doppler/filters.py",
        ("P = F @ P @ F.T + Q", "P = F @ P @ F.T", f"{LINEAR}::test_gains_are_the_papers_closed_forms"),
        (
            "joseph @ P @ joseph.T + K @ R @ K.T",
            "joseph @ P @ joseph.T",
            f"{LINEAR}::test_gains_are_the_papers_closed_forms",
        ),
        ("transition((k - start + 1) * dt)", "transition((k - start) * dt)", TEXTBOOK),
    ),
    *mutants(
        "radarsim/studies/multimodel/filters.py",
        (
            "rest = np.maximum(exponents - whole, 0.0)",
            "rest = np.maximum(exponents - whole, 1.0)",
            "studies/multimodel/test_filters.py",
        ),
        (
            "np.where(np.eye(len(Q), dtype=bool), 0.0, np.maximum(Q, 0.0))",
            "np.where(np.eye(len(Q), dtype=bool), 0.0, Q)",
            "studies/multimodel/test_filters.py",
        ),
        (
            "bent = tau**2 / 2",
            "bent = tau**2",
            "studies/multimodel/test_filters.py::test_start_is_least_squares_with_its_covariance",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/filters.py",
        (
            "h + 2 * g * step + f * step**2",
            "h + g * step + f * step**2",
            "studies/sonar/test_filters.py::test_line_recursion_is_least_squares",
        ),
        (
            "np.stack([np.ones(patterns), -age, age**2 / 2]",
            "np.stack([np.ones(patterns), -age, age**2]",
            "studies/sonar/test_filters.py::test_differenced_is_generalised_least_squares",
        ),
    ),
    *mutants(
        "radarsim/bursts/schedule.py",
        (
            "-0.5 * np.log(1.0 - 2.0 * weights",
            "-np.log(1.0 - 2.0 * weights",
            "studies/discriminator/test_filters.py::test_tail_of_equal_weights_is_chi_square",
        ),
        (
            "math.sqrt(2.0 * float(np.sum(weights**2)))",
            "math.sqrt(float(np.sum(weights**2)))",
            "studies/discriminator/test_filters.py::test_gaussian_condition_is_equation_14",
        ),
    ),
)

FRAMES_AND_MODELS = (
    *mutants(
        "radarsim/physics/frames.py",
        ("[sa * ce, -sa * se, ca]", "[sa * ce, sa * se, ca]", f"{FRAMES}::test_rotation_is_a_right_hand_turn"),
        (
            "np.stack([u, -r * np.sin(e) * np.cos(e) / u",
            "np.stack([u, -r * np.sin(e) / u",
            f"{FRAMES}::test_jacobian_equals_central_differences",
        ),
        (
            "np.array([1.0, 1 + ve / 2, 1 + va / 2])",
            "np.array([1.0, 1 - ve / 2, 1 + va / 2])",
            f"{FRAMES}::test_unbiased_conversion_takes_the_mean_error_off",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/world.py",
        (
            "y[:, 2] * sb + r * vb**2",
            "y[:, 2] * sb - r * vb**2",
            f"{PLACES}::test_frames_are_inverse_and_their_rates_are_derivatives",
        ),
        (
            "np.exp(sigma_b**2), np.exp(-2 * sigma_b**2)",
            "np.exp(sigma_b**2), np.exp(-(sigma_b**2))",
            f"{PLACES}::test_conversions_against_quadrature",
        ),
        (
            "np.where(lags % 2 == 1, -1.0, 1.0)",
            "np.where(lags % 2 == 0, -1.0, 1.0)",
            f"{PLACES}::test_correlation_over_lags_and_gaps",
        ),
    ),
    *mutants(
        "radarsim/physics/targets.py",
        (
            "(speed**2 - radial_velocity**2 + np",
            "(speed**2 + np",
            "physics/test_targets.py::test_velocity_and_acceleration_are_the_derivatives",
        ),
    ),
    *mutants(
        "radarsim/physics/motion.py",
        (
            "float(np.prod(range(1, lag + 1)))",
            "float(lag)",
            "physics/test_targets.py::test_manoeuvre_covariance_is_the_papers_matrix",
        ),
    ),
    *mutants(
        "radarsim/bursts/burst.py",
        (
            "path[i] + s * (v[i] + 0.5 * s *",
            "path[i] + s * (v[i] + s *",
            "studies/discriminator/test_world.py::test_profile_phase_is_the_integral_of_its_doppler",
        ),
    ),
)

EXACT_VALUES = (
    *mutants(
        "radarsim/studies/range_doppler/exact.py",
        (
            "A @ bias[k - 1] + kept @ defect[k - 1]",
            "A @ bias[k - 1] - kept @ defect[k - 1]",
            "studies/range_doppler/test_study.py::test_bias_of_a_turning_target_is_the_exact_one",
        ),
        (
            "solve_discrete_lyapunov(kept @ F,",
            "solve_discrete_lyapunov(F @ kept,",
            f"{EXACT}::test_settles_to_the_steady_state",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/exact.py",
        (
            "Q[4, 4] = sigma[k] ** 2 * (1 - a * a)",
            "Q[4, 4] = sigma[k] ** 2 * (1 - a)",
            f"{SQUARES}::test_recursion_of_true_errors_is_that_of_the_weights",
        ),
        (
            "np.sqrt(720 / (n * (n**2 - 1)",
            "np.sqrt(720 / (n * (n**2 + 1)",
            f"{SQUARES}::test_720_formula_is_least_squares",
        ),
    ),
    *mutants(
        "radarsim/bursts/fisher.py",
        (
            "(order[:, None] + order + 1.0)",
            "(order[:, None] + order + 2.0)",
            "studies/discriminator/test_exact.py::test_closed_form_is_the_printed_matrix",
        ),
    ),
)

NUMBERS = (
    *mutants(
        "radarsim/report/statistics.py",
        (
            "np.maximum(relative, 0) / 9",
            "np.maximum(relative, 0) / 18",
            f"{COVERAGE}::test_coverage_at_the_least_sizes_without_a_note",
        ),
        (
            "- 2 * _per_one(cross, n) / (a * b)",
            "- _per_one(cross, n) / (a * b)",
            f"{COVERAGE}::test_pairing_narrows_a_gain",
        ),
        ("middle, half = (p + zz / 2)", "middle, half = (p + zz)", f"{STATISTICS}::test_rate_is_wilsons"),
        (
            "return np.hypot(one - shared, np",
            "return np.maximum(one - shared, np",
            f"{STATISTICS}::test_difference_adds_in_squares",
        ),
        (
            "(b - exact_square)",
            "(exact_square - b)",
            "trust/test_statistics_control.py::test_mean_coverage_and_factor",
        ),
        ("inv_cdf(1 - 0.025 / n)", "inv_cdf(1 - 0.025)", f"{COVERAGE}::test_bounds_for_many_looks"),
        ("np.sqrt(variance / np.abs(n - 1)), np.nan)", "np.sqrt(variance / n), np.nan)", f"{STATISTICS}::test_by_hand"),
    ),
    *mutants(
        "radarsim/report/tables.py",
        ("both[b] = False", "both[b] = True", "report/test_tables.py::test_gains_are_against_the_baseline"),
        (
            'result.sums.get("estimates")',
            'result.sums.get("estimated")',
            "report/test_tables.py::test_fewer_estimates_than_realisations",
        ),
    ),
)

ENGINE = (
    *mutants(
        "radarsim/engine/moments.py",
        (
            "self.count + other.count",
            "self.count",
            f"{BLOCKS}::test_sums_are_a_commutative_monoid_where_addition_is_exact",
        ),
    ),
    *mutants(
        "radarsim/engine/blocks.py",
        (
            "        while number & 1:",
            "        if number & 1:",
            f"{BLOCKS}::test_any_cut_in_any_order_gives_the_bytes_of_the_textbook",
        ),
        (
            "(first & -first).bit_length() - 1)",
            "(first & -first).bit_length())",
            f"{BLOCKS}::test_the_widest_node_is_aligned_and_cannot_grow",
        ),
        (
            "if not np.isfinite(both.values).all():",
            "if np.isnan(both.values).all():",
            f"{BLOCKS}::test_an_overflow_between_blocks_is_no_result",
        ),
    ),
    *mutants(
        "radarsim/engine/store.py",
        (
            "if hashlib.sha256(body).digest() != digest:",
            "if len(digest) != DIGEST:",
            "engine/test_damage.py::test_a_hundred_of_a_hundred_flipped_bits_are_found",
        ),
        ('"identity": work.identity,', '"identity": "",', STORE),
    ),
    *mutants(
        "radarsim/studies/identity.py",
        (
            '"seed": case.seed,',
            '"seed": 1,',
            "studies/range_doppler/test_study.py::test_identity_ignores_names_and_realisations",
        ),
    ),
    *mutants(
        "radarsim/studies/noise.py",
        (
            "digest(world(keyed_by))",
            "digest(canonical(keyed_by))",
            "studies/range_doppler/test_study.py::test_cases_that_differ_only_in_filters_share_their_noise",
        ),
    ),
)

ALL = (
    *KERNELS,
    *FILTERS,
    *FRAMES_AND_MODELS,
    *EXACT_VALUES,
    *NUMBERS,
    *ENGINE,
    *FURTHER,
    *FOLDS,
    *RARE,
    *CONTROLS,
    *RECORDED,
)
