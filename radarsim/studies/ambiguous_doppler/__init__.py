"""Folded Doppler velocity: filters that unfold it by hypotheses, with memory and without (the wish that ends P1)."""

from radarsim.language import term
from radarsim.report.quantities import FLOORS, RIGHT, WRONG, Quantity
from radarsim.studies.folder import StudyFolder

COLUMN = "above_oracle_percent|above_oracle"  # against the filter that is given the true folds
ABOVE_ORACLE = Quantity(
    *("above_oracle", term("σ above the oracle's"), "gains", COLUMN, "exact_above_oracle"),
    per="component",
    kind="signed",
    unit="%",
    squares=True,
    paired=True,
)
STUDY = StudyFolder(
    package=__name__,
    name="ambiguous_doppler",
    about="Beyond P1: folded Doppler, unfolded by hypotheses kept from scan to scan.",
    filters={
        "doppler: none": "Kalman filter on range alone, order 0, 1 or 2: the upper reference",
        "doppler: unfolded": "the same with the velocity unfolded by the truth: the lower reference",
        "doppler: folded": "the same, unfolded by up to `hypotheses` sequences of folds; 1: the nearest fold",
        "merge: each_scan": "the same, hypotheses merged into one each scan (GPB1): no memory",
    },
    offers=("inputs", "recorded", "warnings", "floor", "errors"),
    own_quantities=(ABOVE_ORACLE, RIGHT, WRONG, *FLOORS),
)
