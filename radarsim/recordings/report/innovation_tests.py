"""Test the innovations of each filter: whether the configured accuracies fit the plots.

The filters' own innovations decide whether the configured accuracies fit. For a consistent filter the squares of the
innovations, divided by their predicted variance, average 1 for each degree of freedom (NIS). A larger average means
that the plots are worse than configured, or that the target manoeuvres more than the filter assumes; a smaller one
means that the plots are better."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from radarsim.config.experiment import Case
from radarsim.language.translate import term
from radarsim.recordings.study_part import recording_interface
from radarsim.recordings.tracking_result import InnovationTally, TrackingResult
from radarsim.report.statistics import normalised_bounds

MIN_TESTS = 10  # with fewer tests there is no verdict
FITS, TOO_SMALL, TOO_LARGE = term("fits"), term("too small"), term("too large")
TOO_FEW_PLOTS, FOLD_LOST, MAYBE_TOO_SMALL = term("too few plots"), term("fold lost"), term("too small?")


@dataclass(frozen=True)
class InnovationTest:
    """The test of a filter's innovations in one measured number: its mean NIS, the bounds of that for a consistent
    filter, and the verdict on the configured σ."""

    filter: str
    name: str
    tests: int
    nis: float
    lo: float
    hi: float
    verdict: str


def innovation_tests(followed: TrackingResult) -> list[InnovationTest]:
    """The tests of all filters."""
    all_tests = [_test_innovations(tally) for tally in followed.tallies.values()]
    return [replace(test, verdict=_verdict_with_folds(followed.case, test, all_tests)) for test in all_tests]


def _test_innovations(tally: InnovationTally) -> InnovationTest:
    """The verdict at 95 %."""
    lo, hi = map(float, normalised_bounds(max(tally.count * tally.freedom, 1)))
    verdict = TOO_SMALL if tally.mean > hi else TOO_LARGE if tally.mean < lo else FITS
    if tally.count < MIN_TESTS:
        verdict = TOO_FEW_PLOTS
    return InnovationTest(tally.filter, tally.name, tally.count, tally.mean, lo, hi, verdict)


def _verdict_with_folds(case: Case, test: InnovationTest, all_tests: Sequence[InnovationTest]) -> str:
    """The verdict of a test; a filter that unfolds velocities by itself may have chosen a wrong fold, which shows where
    another filter fits the same plots."""
    interface = recording_interface(case)
    unfolding_filters = {member.name for member in case.spec.members if interface.unfolds(case.spec, member)}
    if test.verdict != TOO_SMALL or test.filter not in unfolding_filters:
        return test.verdict
    fits_elsewhere = any(
        test_of_filter.name == test.name and test_of_filter.verdict in (FITS, TOO_LARGE) for test_of_filter in all_tests
    )
    return FOLD_LOST if fits_elsewhere else MAYBE_TOO_SMALL
