"""Tables of filter errors and of innovation tests."""

from collections.abc import Sequence
from typing import Any

from radarsim.language.translate import term, tr
from radarsim.recordings.report.innovation_tests import InnovationTest
from radarsim.recordings.tracking_result import TrackingResult
from radarsim.report.wording import unit as unit_of


def error_table(followed: TrackingResult) -> list[dict[str, Any]]:
    """A table of the filters' errors, where the file has the truth: a row each, by column."""
    columns = ("filter", "component", "RMS error", "unit", "of own σ", "estimates")
    table = [
        (sums.filter, sums.component, sums.rms, tr(unit_of(sums.unit)), sums.ratio, sums.count)
        for sums in followed.errors.values()
        if sums.count
    ]
    return [dict(zip(columns, row, strict=True)) for row in table]


ERRORS_TITLE, TESTS_TITLE = (term("Errors against the truth"), term("Innovations (NIS of a consistent filter: 1)"))


def test_table(judged: Sequence[InnovationTest]) -> list[dict[str, Any]]:
    """A table of the tests of the innovations: a row each, by column."""
    columns = ("filter", "number", "plots", "NIS", "95 % from", "95 % to", "stated σ")
    table = [
        (test.filter, test.name, test.tests, test.nis, test.lo, test.hi, tr(test.verdict))
        for test in judged
        if test.tests
    ]
    return [dict(zip(columns, row, strict=True)) for row in table]


NUMBER_FORMATS = {  # the columns of numbers in these tables, and their formats
    **{"RMS error": "#.4g", "of own σ": "#.3g", "estimates": ".0f"},
    **{"plots": ".0f", "NIS": ".3g", "95 % from": ".3g", "95 % to": ".3g"},
}
