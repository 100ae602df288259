"""Planted faults of rare events: weights dropped, shifts, events and boxes not those meant, a search gone astray."""

from tests.trust.mutant import mutants

LOCKS = "studies/discriminator/test_rare.py"
LAW = f"{LOCKS}::test_weights_bring_back_the_normal_law"
SUMS = f"{LOCKS}::test_sums_are_those_of_the_weights_and_add_up"

NEAREST = "studies/discriminator/test_nearest.py"
TURNED = f"{NEAREST}::test_a_turn_brings_every_loss_nearer"
LOSSES = (
    *mutants(
        "radarsim/studies/discriminator/nearest.py",
        ("np.tile((1.0, -1.0)", "np.tile((-1.0, -1.0)", f"{NEAREST}::test_the_conjugate_burst_errs_the_other_way"),
        ("share * towards + (1.0 - share) * unit", "unit", TURNED),
        ("(at[np.argmax(lost)] - width, width / WIDTH)", "(at[np.argmax(lost)], width / WIDTH)", TURNED),
        (
            "from_turn(after - before) @ along",
            "np.abs(after - before) @ along",
            f"{NEAREST}::test_the_normal_is_that_of_the_boundary",
        ),
        ("short / math.sqrt(math.fsum(short * short))", "short", f"{NEAREST}::test_units_have_length_one"),
        (
            "np.round(vector / np.linalg.norm(vector), DIGITS)",
            "vector / np.linalg.norm(vector)",
            f"{NEAREST}::test_last_bits_of_a_direction_are_not_in_what_is_found",
        ),
        ("np.sign(ends[1, last])", "1.0", f"{NEAREST}::test_bounds_of_a_component_are_nearer_than_its_linear_map_says"),
    ),
    *mutants(
        "radarsim/studies/discriminator/kernels/rare.py",
        ("weights[n] = 1.0 / density[n]", "weights[n] = 1.0", LAW),
        ("chosen[i] = m", "chosen[i] = min(m, 1)", LAW),
        ("math.exp(shift[m] * along[n] - level)", "math.exp(shift[m] * along[n] - 2.0 * level)", LAW),
        ("b[lane(r, n)] += step * mixture.second[m, r]", "b[lane(r, n)] += 0.0", LAW),
    ),
    *mutants(
        "radarsim/studies/discriminator/kernels/sums.py",
        ("losses[f, k, lock, 1] += weights[i] * weights[i]", "losses[f, k, lock, 1] += weights[i]", SUMS),
    ),
    *mutants(
        "radarsim/studies/discriminator/study.py",
        ("errors, passes = errors[plain], passes[plain]", "errors, passes = errors, passes", SUMS),
    ),
    *mutants(
        "radarsim/studies/discriminator/rare.py",
        (
            "zeroth * g[1] + first * g[6]",
            "zeroth * g[1]",
            f"{LOCKS}::test_maps_take_both_moments_of_a_block_from_each_of_its_normals",
        ),
    ),
    *mutants(
        "radarsim/report/statistics.py",
        (
            "np.where((p > 0) & (p < 1) & (variance > 0), trials, plain)",
            "np.where((p > 0) & (p < 1) & (variance > 0), n, plain)",
            f"{LOCKS}::test_the_interval_of_a_weighted_rate_follows_the_weights",
        ),
        (
            "np.maximum(middle + half, p)",
            "middle + half",
            "report/test_statistics.py::test_the_interval_of_a_share_holds_the_share",
        ),
    ),
    *mutants(
        "radarsim/report/rare.py",
        (
            "np.minimum(statistics.effective_events(of.squared, of.fourth), _weighing(of))",
            "statistics.effective_events(of.squared, of.fourth)",
            f"{LOCKS}::test_an_interval_that_few_heavy_weights_make_is_marked",
        ),
    ),
)
TRACKS = "studies/sonar/clutter/test_rare.py"
TWINS = f"{TRACKS}::test_weights_and_lives_are_the_twins"
PAIRS = f"{TRACKS}::test_pairs_of_false_plots_are_confirmed_as_their_exact_law_says"
FALSE_TRACKS = (
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/rare.py",
        ("else (1.0 - h) / (1.0 - p)", "else 1.0", TWINS),
        ("if ring:", "if not ring:", PAIRS),
        ("min(high, b0 + sector - b)", "high", PAIRS),
        ("number_when_any(box.mean, p, uniform(u) / h)", "number_when_any(box.mean, p, uniform(u))", TWINS),
        ("box.q + box.dq * u_q", "box.q + box.dq * u_b", TWINS),
        ("own[FOUND, i] * (factor if tentative else 1.0)", "own[FOUND, i] * factor", TWINS),
        ("shares[2] * own[LONG, i]", "shares[2] * own[FOUND, i]", TWINS),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/sums.py",
        ("sums[j, 1] += w * w", "sums[j, 1] += w", TWINS),
        ("drawn[1] += w", "drawn[1] += 1.0", TWINS),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/tables.py",
        (
            "held(result, (f,)).weight.sum()",
            "held(result, (f,)).number.sum()",
            f"{TRACKS}::test_tables_tell_the_rate_and_how_well_it_is_known",
        ),
    ),
)

TARGET = "studies/sonar/clutter/test_ends.py"
ENDS = f"{TARGET}::test_weights_and_ends_are_the_twins"
RUNS = f"{TARGET}::test_runs_of_misses_end_tracks_as_their_exact_law_says"
LOST_TRACKS = (
    *mutants(
        "radarsim/studies/sonar/clutter/kernels/ends.py",
        ("slope * x - off_b", "-off_b", f"{TARGET}::test_the_probability_outside_a_gate_is_that_of_a_sum"),
        ("(h + (1.0 - h) * c) / (1.0 - detection + detection * c)", "h / (1.0 - detection)", ENDS),
        ("max(own[LONGEST, i], status[MISSES, i])", "status[MISSES, i]", ENDS),
        ("b = along(direction[j], errors, 1, i) + part_of * own[PUSH_B, i]", "b = 0.0", ENDS),
        ("MOST_LOG)) / squared", "MOST_LOG)) / stretch[j]", ENDS),
        ("if own[CAME, i] == 0.0 else 0.0", "if own[CAME, i] >= 0.0 else 0.0", ENDS),
        ("status[MISSES, i] < misses and off_target", "off_target", ENDS),
        ("k > laws.young.max()", "k >= 0", ENDS),
        ("shares[1 + j] * own[RATIO + j, i]", "shares[1] * own[RATIO + j, i]", ENDS),
        ("1.0 if seen and own[ENDED, i] == 0.0 else 0.0", "1.0 if seen else 0.0", ENDS),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/rare.py",
        ("(1.0 - miss[k]) * out[0, k + 1]", "(1.0 - miss[k]) * out[:length, k + 1]", RUNS),
        ("np.clip(1.0 - hits / inside, 1.0 - probability, 1.0)", "np.clip(1.0 - hits, 1.0 - probability, 1.0)", ENDS),
        ("np.linalg.norm(A, axis=1))", "np.ones(OUT))", ENDS),
    ),
    *mutants(
        "radarsim/studies/sonar/clutter/tables.py",
        (
            'np.cumsum(result.sums["ended"][f], axis=0)',
            'np.asarray(result.sums["ended"][f])',
            f"{TARGET}::test_tables_tell_the_curve_and_how_tracks_end",
        ),
    ),
)

FOLDS = "studies/ambiguous_doppler/test_rare.py"
NORMAL = f"{FOLDS}::test_weights_bring_back_the_normal_law"
JUST = f"{FOLDS}::test_folds_are_wrong_just_where_the_half_spaces_are"
ADDED = f"{FOLDS}::test_sums_are_those_of_the_weights_and_add_up"
TEXTBOOK = f"{FOLDS}::test_distances_between_sequences_are_the_textbooks"
EARLY = f"{FOLDS}::test_what_is_dropped_early_is_dropped_in_a_half_space"
PRODUCT = f"{FOLDS}::test_the_nearest_fold_is_wrong_as_often_as_the_exact_product_says"
STUDY = "radarsim/studies/ambiguous_doppler"

WRONG_FOLDS = (
    *mutants(
        f"{STUDY}/kernels/rare.py",
        ("put(weights, 0, 1.0 / density)", "put(weights, 0, full(1.0))", NORMAL),
        ("exponential(shift * along - 0.5 * shift * shift)", "exponential(shift * along - shift * shift)", NORMAL),
        ("to[1] += weight * weight", "to[1] += weight", ADDED),
        ("n < size and chosen[n] == 0 else 0.0", "n < size else 0.0", ADDED),
    ),
    *mutants(
        f"{STUDY}/rare.py",
        ("made[k, 0] = e / math.sqrt(of.range_variance[k])", "made[k, 0] = 0.0 * e", f"{TEXTBOOK} {JUST}"),
        ("/ 2 + apart @ b + depth) / length", "/ 2 - apart @ b + depth) / length", JUST),
        ("own = 0.0 if k == len(of.constant) else depth", "own = depth", f"{JUST} {EARLY}"),
        ("(apart**2).sum(axis=1) / 2", "(apart**2).sum(axis=1)", f"{JUST} {PRODUCT}"),
    ),
    *mutants(
        f"{STUDY}/lattice.py",
        (
            "np.ceil(centre - reach), np.floor",
            "np.floor(centre), np.floor",
            f"{FOLDS}::test_short_vectors_are_all_that_there_are",
        ),
    ),
)
RARE = (*LOSSES, *FALSE_TRACKS, *LOST_TRACKS, *WRONG_FOLDS)
