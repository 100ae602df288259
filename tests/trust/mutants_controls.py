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
    ("d * d - places.variances[places.first + i * places.stride + c]", "d * d", ZERO),
    ("noise[at + 3] * a + noise[at + 4] * b", "noise[at + 3] * a - noise[at + 4] * b", TWIN),
    ("put(parts, to, get(parts, to) + d[i] * d[i])", "put(parts, to, d[i] * d[i])", ZERO),
    ("get(of.x, 0) - found - level", "get(of.x, 0) - level", LEFT),
    ("row(to.residuals, baseline * STATES)", "row(to.residuals, f * STATES)", PAIRS),
)
