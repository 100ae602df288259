"""Planted faults, further ones: manoeuvres, false plots, scoring of bursts, exact laws, and how runs are run."""

from tests.trust.mutant import mutants

TWINS = "studies/sonar/manoeuvre/test_kernels.py"
ALARMS, ANSWERS = f"{TWINS}::test_alarms_and_first_events_are_the_twins", f"{TWINS}::test_filters_are_their_twins"
CLUTTER, LAWS = "studies/sonar/clutter/test_kernels.py", "studies/sonar/clutter/test_study.py"
AMONG = f"{CLUTTER}::test_estimates_are_the_twins"
SCORE = "studies/discriminator/test_kernels.py::test_score_of_samples_is_the_likelihood_and_its_gradient"
CLEAN = "studies/discriminator/test_kernels.py::test_the_coherent_sum_of_a_clean_burst_is_its_amplitude"
POWERS = "trust/test_statistics_sums.py::test_sums_of_one_realisation_are_the_powers_of_its_error"
LOOKS = "trust/test_looks.py"
DETECTOR, INITIATION = "studies/sonar/manoeuvre/test_exact.py", "studies/sonar/clutter/test_exact.py"

MANOEUVRES = (
    *mutants(
        "radarsim/studies/sonar/kernels/steps.py",
        ("h1, h2 = zero - age, half * age * age", "h1, h2 = zero - age, age * age", ANSWERS),
    ),
    *mutants(
        "radarsim/studies/sonar/kernels/detector.py",
        ("first = alarms + alarm, first + new", "first = alarms + alarm, first + event", ALARMS),
        (
            "where_greater(quiet, patience - 0.5, zero, mode)",
            "where_greater(quiet, patience + 0.5, zero, mode)",
            ANSWERS,
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/kernels/imm.py",
        ("mu1 * P1[1] + mu2 * P2[1] + both * d0 * d1", "mu1 * P1[1] + mu2 * P2[1]", ANSWERS),
        ("p11 * mu1 + p21 * mu2, p12 * mu1", "p11 * mu1 + p12 * mu2, p21 * mu1", ANSWERS),
    ),
)
FALSE_PLOTS = (
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/tracker.py",
        (
            "S = (S[0] + reach * reach, S[1]",
            "S = (S[0], S[1]",
            f"{LAWS}::test_pairs_of_false_plots_follow_their_exact_law",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/rules.py",
        (
            "hits + (n - age) >= m else NONE",
            "hits + (n - age) > m else NONE",
            f"{LAWS}::test_initiation_follows_its_exact_law",
        ),
        (
            "NONE if misses >= most else CONFIRMED",
            "NONE if misses > most else CONFIRMED",
            f"{AMONG} {LAWS}::test_every_track_of_the_target_is_accounted_for",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/field.py",
        ("np.floor((low - least) / step), 0.0)", "np.ceil((low - least) / step), 0.0)", f"{AMONG} {LAWS}"),
        (
            "while u >= share[n]:",
            "while n < 1 and u >= share[n]:",
            f"{CLUTTER}::test_the_field_is_poisson_and_even_in_area",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/gate.py",
        ("return bb * per, -rb * per,", "return bb * per, rb * per,", AMONG),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/tracks.py",
        ("P[1] + u0 * K[1] + v0 * L[1],", "P[1] + u0 * K[1],", AMONG),
        (
            "rr * (P_r[0] + 1.0)",
            "rr * P_r[0]",
            f"{AMONG} {LAWS}::test_gates_hold_target_and_false_plots_as_they_should",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/kernels/patterns.py",
        (
            "detected[i] = 1.0 if a < limit else 0.0",
            "detected[i] = 1.0 if a > limit else 0.0",
            "studies/sonar/smoothing/test_study.py::test_random_misses_are_exact_as_means_over_patterns",
        ),
    ),
)
SCORES = (
    *mutants(
        "radarsim/bursts/kernels/scoring.py",
        ("image = amplitude * (cc - 0.5 * pulses)", "image = amplitude * (cc - pulses)", CLEAN),
        ("e = y * c - x * s", "e = y * c + x * s", SCORE),
    ),
    *mutants(
        "radarsim/studies/multimodel/kernels/sums.py",
        (
            "get(out, VARIANCE + 6),",
            "get(out, VARIANCE + 3),",
            "studies/multimodel/test_kernels.py::test_kernel_equals_its_twin studies/multimodel/test_study.py",
        ),
        ("error[4 * c + 2] += total(e2 * e)", "error[4 * c + 2] += total(e2)", POWERS),
    ),
)
LAWS_EXACT = (
    *mutants(
        "radarsim/studies/sonar/manoeuvre/exact.py",
        (
            "+ special.ndtr(-shift - np",
            "- special.ndtr(-shift - np",
            f"{DETECTOR}::test_detection_is_the_noncentral_law",
        ),
        (
            "weights) + (moved**2).sum(axis=1)",
            "weights) + moved.sum(axis=1) ** 2",
            f"{DETECTOR}::test_a_random_push_adds_to_the_variance",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/exact.py",
        ("(n - age - 1) >= m", "(n - age) >= m", f"{INITIATION}::test_m_of_n_is_the_sum_over_all_patterns"),
        (
            "variance_r, variance_b = 2 * given.sigma**2",
            "variance_r, variance_b = given.sigma**2",
            f"{INITIATION}::test_pairs_of_false_plots_far_from_any_edge",
        ),
    ),
)
RUNS = (
    *mutants(
        "radarsim/engine/blocks.py",
        (
            "share_bound(full + (rest > 0), bound, part[1]), full)",
            "share_bound(full, bound, part[1]) + 1, full)",
            "engine/test_share.py::test_shares_tile_the_blocks_and_the_last_has_the_cut_one",
        ),
    ),
    *mutants(
        "radarsim/engine/run.py",
        (
            "sums.count == self.full * self.work.block:",
            "sums.count >= 0:",
            "engine/test_store.py::test_a_stored_cut_block_counts_only_once_all_before_it_is_done",
        ),
    ),
    *mutants(
        "radarsim/engine/stopping.py",
        (
            "limit_s = 1.5",
            "limit_s = 150.0",
            "engine/test_signals.py::test_a_main_thread_that_never_asks_is_ended",
        ),
    ),
    *mutants(
        "radarsim/engine/audit.py",
        (
            "return one.tobytes() == other.tobytes()",
            "return True",
            "engine/test_audit.py::test_sums_that_were_forged_with_a_right_checksum_do_not_add_up",
        ),
    ),
    *mutants(
        "radarsim/engine/cluster.py",
        (
            "if work.identity != identity:",
            "if not identity:",
            "engine/test_cluster.py::test_workers_with_other_sources_are_refused",
        ),
    ),
    *mutants(
        "radarsim/report/precision.py",
        (
            "np.isnan(percent) | np.isnan(value), np.inf",
            "np.isnan(percent) | np.isnan(value), 0.0",
            "report/test_precision.py::test_what_is_not_known_is_never_reached",
        ),
        (
            "percent >= percent.max() * (1 - EQUAL)",
            "percent <= percent.min() * (1 + EQUAL)",
            "report/test_precision.py::test_the_worst_cell_is_the_widest_of_the_table",
        ),
        ("TAILED = 3", "TAILED = 0", f"{LOOKS}::test_where_a_run_ends_is_foretold"),
    ),
    *mutants(
        "radarsim/app/simulation.py",
        (
            "cell.percent < wanted.percent and n >= least",
            "cell.percent < wanted.percent or n >= least",
            f"{LOOKS}::test_sigma_with_rare_large_errors_is_covered_where_a_precision_ends",
        ),
    ),
    *mutants(
        "radarsim/report/claims/rule.py",
        ("1 - 0.025 / LOOKS / max", "1 - 0.025 / max", f"{LOOKS}::test_a_rate_keeps_what_is_promised_too"),
    ),
)
CHAIN, BURSTS = "studies/pulses_to_tracks/test_kernels.py", "studies/pulses_to_tracks/test_study.py"
TEXTBOOK = f"{CHAIN}::test_the_chain_is_the_textbooks"
LIST = "studies/pulses_to_tracks/test_folds.py::test_hypotheses_are_the_textbooks_list"
PULSES = (
    *mutants(
        "radarsim/studies/pulses_to_tracks/kernels/folds.py",
        ("weights[h] -= 0.5 * (e * e / S + math.log(S))", "weights[h] -= 0.5 * (e * e / S)", LIST),
        ("weight -= 0.5 * (off * off / S", "weight += 0.5 * (off * off / S", LIST),
        ("right, taken, wrong = 0.0 if off else right,", "right, taken, wrong = right,", LIST),
        (
            "lists.parents[made] = held.weights[i, h] + lost, 0.0, -1 - h",
            "lists.parents[made] = lost, 0.0, -1 - h",
            LIST,
        ),
    ),
    *mutants(
        "radarsim/studies/pulses_to_tracks/kernels/steps.py",
        ("u * P[1] + w * Q[1] + v * d[0] * d[1]", "u * P[1] + w * Q[1]", TEXTBOOK),
        ("if k >= own.start else", "if k > own.start else", TEXTBOOK),
        (
            "ages[i] = min(ages[i] + 1, AGES - 1) if locked else 0",
            "ages[i] = min(ages[i] + 1, AGES - 1) if locked else 1",
            f"{BURSTS}::test_ages_count_the_realisations_once",
        ),
    ),
    *mutants(
        "radarsim/studies/pulses_to_tracks/kernels/chain.py",
        (
            "locks[TAKEN] += weight",
            "locks[TAKEN] += 1.0",
            f"{BURSTS}::test_a_narrow_gate_takes_nothing_and_leaves_range_alone",
        ),
    ),
    *mutants(
        "radarsim/studies/pulses_to_tracks/kernels/estimate.py",
        (
            "pair = U(2 * (blocks * k + begin))",
            "pair = U(2 * begin)",
            f"{BURSTS}::test_sampled_idealisations_have_their_exact_errors",
        ),
    ),
    *mutants(
        "radarsim/studies/pulses_to_tracks/world.py",
        (
            "power_db = power_db + 40.0",
            "power_db = power_db + 20.0",
            f"{BURSTS}::test_power_falls_with_range_and_with_the_pulses_length",
        ),
    ),
    *mutants(
        "radarsim/studies/pulses_to_tracks/exact.py",
        (
            "F @ mean + missed[k]",
            "F @ mean",
            f"{BURSTS}::test_exact_errors_follow_a_target_that_leaves_the_model",
        ),
    ),
)
P1_WORLD = "studies/range_doppler/test_world.py"
DRAWN_FLIGHTS = (
    *mutants(
        "radarsim/studies/range_doppler/kernels/draws.py",
        (
            "y = flight[3] + shift[1, i] + t * shift[4, i]",
            "y = flight[3] + shift[1, i]",
            f"{P1_WORLD}::test_a_drawn_flight_begins_elsewhere_and_flies_the_same_accelerations",
        ),
    ),
    *mutants(
        "radarsim/studies/range_doppler/world.py",
        (
            "np.linalg.eigh(products - np.outer(total, total))",
            "np.linalg.eigh(products)",
            f"{P1_WORLD}::test_how_drawn_flights_leave_the_model_has_the_moments_of_those_flights",
        ),
    ),
    *mutants(
        "radarsim/studies/range_doppler/propagation.py",
        (
            "self.Y = back(self.Y, dt) + np.einsum",
            "self.Y = back(self.Y, dt) - np.einsum",
            f"{P1_WORLD}::test_the_search_for_a_variance_sees_the_exact_errors",
        ),
    ),
)
MISSED_PLOTS = (
    *mutants(
        "radarsim/studies/range_doppler/kernels/patterns.py",
        (
            "s[5] - g[2] * own[2] - d2 * g[2],",
            "s[5] - g[2] * own[2],",
            f"{P1_WORLD}::test_exact_values_are_the_means_over_all_patterns",
        ),
        (
            "get(p, last) * (1.0 - world.detection)",
            "get(p, last) * world.detection",
            f"{P1_WORLD}::test_exact_values_are_the_means_over_all_patterns",
        ),
        (
            "l2 * d0 + l4 * d1 + l5 * d2",
            "l2 * d0 + l4 * d1",
            f"{P1_WORLD}::test_exact_values_are_the_means_over_all_patterns",
        ),
        (
            "room.size[top], room.size[top + 1], room.scan[top + 1] = kept * WIDTH, m - kept * WIDTH, scan",
            "room.size[top], room.size[top + 1], room.scan[top + 1] = kept * WIDTH, kept * WIDTH, scan",
            f"{P1_WORLD}::test_patterns_followed_to_the_end_piece_by_piece_are_those_side_by_side",
        ),
        (
            "for first in range(0, n, PIECE):",
            "for first in range(0, n - PIECE, PIECE):",
            f"{P1_WORLD}::test_patterns_followed_to_the_end_piece_by_piece_are_those_side_by_side",
        ),
    ),
    *mutants(
        "radarsim/studies/range_doppler/kernels/merging.py",
        (
            "get(p, 9) + sign * v * v",
            "get(p, 9)",
            f"{P1_WORLD}::test_means_over_merged_patterns_are_those_over_all",
        ),
        (
            "spare[to + i * WIDTH] += rows",
            "spare[to + i * WIDTH] = rows",
            f"{P1_WORLD}::test_means_over_merged_patterns_are_those_over_all",
        ),
    ),
)
MARKS = "report/test_notes.py"
FEW_FOLDS = "studies/ambiguous_doppler/test_results.py::test_sigma_is_marked_where_few_false_velocities_were_seen"
SAID = (
    *mutants(
        "radarsim/studies/pulses_to_tracks/tables.py",
        (
            "statistics.effective(of[:, 1, 0], of[:, 1, 1], n)",
            "statistics.effective(of[:, 0, 0], of[:, 0, 1], n)",
            "studies/pulses_to_tracks/test_tables.py::test_sigma_of_all_bursts_is_marked_where_few_lost_ones_decide",
        ),
    ),
    *mutants(
        "radarsim/report/notes.py",
        (
            "np.minimum(EFFECTIVE, n / TAIL)",
            "EFFECTIVE",
            f"{MARKS}::test_gaussian_errors_of_few_realisations_have_no_tails",
        ),
        (
            "known(table) & exact",
            "known(table) & False",
            f"{MARKS}::test_no_note_stands_beside_an_exact_value",
        ),
        (
            "fewest = np.fmin(fewest, other)",
            "fewest = np.fmax(fewest, other)",
            f"{MARKS}::test_a_gain_rests_on_the_fewer_of_its_two_filters",
        ),
    ),
    *mutants(
        "radarsim/studies/ambiguous_doppler/tables.py",
        (
            "few = unfolding(result)[:, None] & (beyond < statistics.FEW_EVENTS)",
            "few = unfolding(result)[:, None] & (beyond < 0)",
            FEW_FOLDS,
        ),
    ),
    *mutants(
        "radarsim/report/claims/classes.py",
        (
            'every = {"class": found.kind,',
            'every = {"class": own,',
            "report/test_classes.py::test_every_claim_has_one_class_wherever_it_is_said",
        ),
        (
            "for end in (part.expected.lo, part.expected.hi, part.expected.margin)",
            "for end in (part.expected.lo, part.expected.hi)",
            "report/test_classes.py::test_what_was_judged_of_other_words_is_no_class",
        ),
    ),
    *mutants(
        "radarsim/report/claims/judge.py",
        (
            "asked = [one for one in tried if one.part.asserted] or tried",
            "asked = tried",
            "report/test_claims.py::test_what_does_not_hang_on_the_end_is_judged_of_a_shorter_run",
        ),
    ),
    *mutants(
        "radarsim/studies/range_doppler/readings.py",
        (
            'float(shown if shown != SHIPPED else reading["manoeuvre_variance"])',
            'float(reading["manoeuvre_variance"])',
            "app/test_readings.py::test_figure_1a_is_of_several_variances",
        ),
        (
            "ends = short if np.isfinite(asked) and end < asked - 1e-6 else",
            "ends = short if not short else",
            "app/test_readings.py::test_a_run_that_is_over_before_the_time_asked_about_is_not_judged",
        ),
        (
            'reading["curves_of"] == EACH or part.cases == (2,)',
            'reading["curves_of"] == EACH or part.cases == (1,)',
            "app/test_readings.py::test_sentences_on_figures_2a_and_3a_speak_of_their_radar_or_of_each",
        ),
    ),
    *mutants(
        "radarsim/studies/range_doppler/measures.py",
        (
            "1.5 * dt**2 * f",
            "0.5 * dt**2 * f",
            "report/test_claims.py::test_measures_what_it_says",
        ),
    ),
    *mutants(
        "radarsim/studies/discriminator/versions.py",
        (
            "error = covariance[:-1] - covariance[1:]",
            "error = covariance[:-1]",
            "studies/discriminator/test_readings.py::test_the_probability_of_a_miss_is_that_of_the_prepared_case",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/smoothing/measures.py",
        (
            "(F @ _covariance(n) @ F.T)[0, 0]",
            "_covariance(n)[0, 0]",
            "studies/sonar/smoothing/test_tables.py::test_what_is_known_exactly_is_judged_exactly",
        ),
    ),
    *mutants(
        "radarsim/studies/sonar/manoeuvre/readings.py",
        (
            "measure=measures.further(part.cases[0], measures.ENOUGH, delay, rate)",
            "measure=measures.fastest(part.cases[0], delay, rate)",
            "studies/sonar/manoeuvre/test_readings.py::test_more_plots_can_be_worth_while_under_a_reading",
        ),
    ),
)
PICTURES = mutants(
    "radarsim/report/figures.py",
    (
        "*side.get_view_interval(), *axes.bbox.bounds,",
        "*side.get_view_interval(),",
        "report/test_figures.py::test_what_is_remembered_of_axes_changes_no_picture",
    ),
    (
        "vars(side).pop(name, None)",
        "pass",
        "report/test_figures.py::test_a_figure_that_is_handed_out_remembers_nothing",
    ),
)
FURTHER = (
    *MANOEUVRES,
    *FALSE_PLOTS,
    *SCORES,
    *LAWS_EXACT,
    *RUNS,
    *PULSES,
    *DRAWN_FLIGHTS,
    *MISSED_PLOTS,
    *SAID,
    *PICTURES,
)
