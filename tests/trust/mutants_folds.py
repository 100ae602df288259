"""Planted faults of folded Doppler: its kernels, exact laws, and its filters over recorded plots."""

from tests.trust.mutant import mutants

HERE = "studies/ambiguous_doppler"
ONE = f"{HERE}/test_kernels.py::test_filters_of_one_hypothesis"
MERGING = f"{HERE}/test_kernels.py::test_merging_filter"
MANY = f"{HERE}/test_kernels.py::test_remembering_filter"
TURNS = f"{HERE}/test_kernels.py::test_remainder_of_two_scans"
ORDERS = f"{HERE}/test_orders.py::test_interacting_orders"
CHOSEN = f"{HERE}/test_orders.py::test_intersection_of_intervals"
TOGETHER = f"{HERE}/test_orders.py::test_orders_within_remembered_hypotheses"
EXPECTED = f"{HERE}/test_orders.py::test_expected_error_is_exact_and_never_beats_the_clairvoyant"
BRACKETS = f"{HERE}/test_exact.py::test_range_only_and_oracle_are_exact"
NEAREST = f"{HERE}/test_exact.py::test_nearest_fold_is_right_as_often_as_the_product_says"
REMAINDERS = f"{HERE}/test_exact.py::test_remainders_of_two_scans_are_right_as_often_as_calculated"
CALIBRATED = f"{HERE}/test_exact.py::test_probabilities_of_the_best_hypothesis_are_calibrated"
LIST = "studies/pulses_to_tracks/test_folds.py::test_hypotheses_are_the_textbooks_list"
FOLLOWED = f"{HERE}/test_results.py::test_track_follows_combined_orders_as_the_study_does"
STUDY = "radarsim/studies/ambiguous_doppler"

FOLDS = (
    *mutants(
        f"{STUDY}/kernels/plots.py",
        ("da * (0.5 * t * t)", "da * (t * t)", BRACKETS),
        ("found, least = u, off", "found, least = off, off", TURNS),
        ("            before = k\n", "            before = before if before >= 0 else k\n", TURNS),
    ),
    *mutants(
        f"{STUDY}/kernels/steps.py",
        ("P[4] - g[1] * P[2]", "P[4] - g[2] * P[2]", ONE),
        ("mean, square / total - mean * mean, total", "mean, square / total, total", MERGING),
        ("get(plot, DETECTED), full(0.5 * D)", "get(plot, DETECTED), full(D)", f"{ONE} {NEAREST}"),
    ),
    *mutants(
        f"{STUDY}/kernels/hypotheses.py",
        ("put(w, i, get(w, i) - weight * (e * e))", "put(w, i, get(w, i))", MANY),
        ("lists.parents[i] == right and abs(", "abs(", MANY),
        ("to[PROBABILITY * WIDTH] = 1.0 / sum_", "to[PROBABILITY * WIDTH] = 0.5 / sum_", f"{MANY} {CALIBRATED}"),
    ),
    *mutants(
        "radarsim/kernels/hypotheses.py",
        ("if side * e[i] <= 0.0:", "if side * e[i] >= 0.0:", f"{MANY} {LIST}"),
        ("weight = w[i] - c[i] * f * f", "weight = w[i] - c[0] * f * f", LIST),
        ("if most <= above:", "if most < above:", "kernels/test_hypotheses.py"),
    ),
    *mutants(
        f"{STUDY}/kernels/orders.py",
        ("P[1] + share * (Y[1] + d0 * d1)", "P[1] + share * Y[1]", ORDERS),
        ("and own > width:", "and own >= width:", CHOSEN),
        ("low, y - width, low)", "low, y + width, low)", CHOSEN),
    ),
    *mutants(
        f"{STUDY}/kernels/together.py",
        ("put(weights, g, w * likelihood)", "put(weights, g, w)", TOGETHER),
        ("put(order, PROBABILITY, one / root(S))", "put(order, PROBABILITY, one)", TOGETHER),
        ("if branch[i] >= top * prune:", "if branch[i] >= prune:", TOGETHER),
        ("if lists.parents[i] == right and abs(", "if abs(", TOGETHER),
    ),
    *mutants(
        f"{STUDY}/exact.py",
        ("(before @ F.T - now) @ kept.T", "(now - before @ F.T) @ kept.T", BRACKETS),
        ("return np.cumprod(each)", "return np.array(each)", NEAREST),
        ("max(i * before - step / 2, centre", "max(i * before - step, centre", REMAINDERS),
        ("raw / total)", "raw)", EXPECTED),
    ),
    *mutants(
        f"{STUDY}/followers.py",
        ("share = passes * self.mu[:, :, None]", "share = passes * self.mu[:, None]", FOLLOWED),
        ("self.bias = np.concatenate([self.bias, np", "self.bias = np.concatenate([0 * self.bias, np", FOLLOWED),
    ),
)
