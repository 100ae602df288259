"""Planted faults of recorded plots: their likelihood, and what is fitted by it."""

from tests.trust.mutant import mutants

LIKELIHOOD, FIT = "recorded/test_likelihoods.py", "recorded/test_fit.py"
DOPPLER = "recorded/test_doppler.py"
DIGITS = f"{LIKELIHOOD}::test_nothing_known_before_the_first_plot_costs_no_digits"
DENSITY = f"{LIKELIHOOD}::test_the_kernel_is_the_density_of_all_numbers_together"
RISING = f"{FIT}::test_an_end_is_found_where_another_key_has_to_rise_from_zero"

RECORDED = (
    *mutants(
        "radarsim/kernels/innovations.py",
        ("P[a, b] -= shrink * p[a] * p[b]\n            P[b, a] = P[a, b]",
         "P[a, b] -= shrink * p[a] * p[b]\n            P[b, a] = P[a, b] * (1.0 + 1e-13)", DIGITS),
        ("np.log(2.0 * np.pi * S) + e * e / S", "np.log(2.0 * np.pi * S) + e * e / T", DENSITY),
    ),
    *mutants(
        "radarsim/recorded/fit.py",
        ("if others := {j: log for j, log in self.raised.items() if j != i}:", "if others := {}:", RISING),
        ("np.minimum(share, MOST_SHARE)", "share", f"{FIT}::test_all_plots_as_outliers_are_no_fit"),
        ("> self.top - HALF_CHI2_95\n\n    def _raised", "> self.top\n\n    def _raised", RISING),
    ),
    *mutants(
        "radarsim/recorded/advice.py",
        ("at = polished(along, along.searched(near))", "at = along.searched(near)",
         f"{FIT}::test_what_is_advised_is_the_top"),
        ("one = known[found.fullest]", "one = known[found.best]", f"{FIT}::test_the_wrong_number_is_named"),
        ("[1] < top - HALF_CHI2_95", "[1] < np.inf", f"{FIT}::test_a_quiet_recording_is_no_reason_to_lower"
         "_the_manoeuvre_variance"),
    ),
    *mutants(
        "radarsim/recorded/doppler.py",
        ("or turned < 0.5 * np.median(np.abs(off))", "",
         f"{DOPPLER}::test_velocities_of_the_other_sign_are_not_taken_for_folded"),
        ("> fastest + CLEAR * sigma).sum()", "> CLEAR * sigma).sum()",
         f"{DOPPLER}::test_unfolded_velocities_are_not_noticed"),
    ),
)  # fmt: skip
