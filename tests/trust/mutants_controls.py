"""Planted faults of control variates: noise, sums over a stage, what is explained, and pairs not those meant."""

from tests.trust.mutant import mutants

HERE = "studies/multimodel/test_controls.py"
TWIN = f"{HERE}::test_a_control_equals_its_textbook_twin_sample_by_sample"
ZERO = f"{HERE}::test_sums_of_the_controls_have_expectation_zero"
LEFT = f"{HERE}::test_residuals_are_what_the_slopes_leave_of_squared_errors"
PAIRS = f"{HERE}::test_pairs_are_products_of_residuals"

CONTROLS = mutants(
    "radarsim/studies/multimodel/kernels/controls.py",
    ("detected * (w - x - h) + p * h", "detected * (w - x - h) + h", ZERO),
    ("noise[at + 3 * i + 1] * b", "noise[at + 3 * i] * b", TWIN),
    ("(a[0] + d[0] * d[0], ", "(d[0] * d[0], ", ZERO),
) + mutants(
    "radarsim/studies/multimodel/kernels/residuals.py",
    ("d * d - places.variances[places.first + i * places.stride + c]", "d * d", ZERO),
    ("slopes[at + 1] * (d * d - variance)", "slopes[at + 1] * (d * d)", LEFT),
    ("y - found - level", "y - level", LEFT),
    ("add_pairs(own, base, ", "add_pairs(own, own, ", PAIRS),
)
