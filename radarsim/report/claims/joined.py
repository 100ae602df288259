"""Verdicts over all readings that a paper allows, beside those of the default one: from the rows of readings.csv."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from radarsim.report.claims import rule
from radarsim.report.claims.judge import NOT_JUDGED, NOT_RUN
from radarsim.report.claims.rule import Outcome, Reading

# Columns of readings.csv that are no choice.
FIXED = frozenset(
    (
        *("claim", "part", "reading", "kind", "measured", "lo", "hi", "exact", "expected_lo", "expected_hi", "margin"),
        *("verdict", "unit", "what", "outcome", "miss", "n", "needed", "reason", "over"),
    )
)


def with_readings(rows: Sequence[Mapping[str, Any]], stored: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of claims.csv with holds, of, depends_on and the class filled in from rows of readings.csv.

    A claim of which no reading is stored stays as it is, and so does one that was not judged. Where the readings say
    that the print contradicts itself, which depends on more than how each of them comes out, so does the row.
    """
    by_claim: dict[str, list[Mapping[str, Any]]] = {}
    for row in stored:
        by_claim.setdefault(str(row["claim"]), []).append(row)
    found = {claim: _readings(own) for claim, own in by_claim.items()}
    torn = {claim for claim, own in by_claim.items() if any(row.get("over") == rule.CONTRADICTORY for row in own)}
    joined = [dict(row) | _over(row, found.get(str(row["claim"]), []), str(row["claim"]) in torn) for row in rows]
    open_ = {claim: _needed(own) for claim, own in by_claim.items()}
    return [
        row | {"needed": open_[str(row["claim"])]} if row["class"] == rule.UNDECIDED and row["claim"] in open_ else row
        for row in joined
    ]


def _needed(rows: Sequence[Mapping[str, Any]]) -> float:
    """Realisations that would decide every reading that the paper allows; not-a-number where that is not known."""
    open_ = [row for row in rows if row["kind"] != rule.AGAINST and row["outcome"] == rule.UNDECIDED]
    found = rule.most_needed(int(row["needed"]) if row.get("needed") else None for row in open_)
    return math.nan if found is None else float(found)


def _readings(rows: Sequence[Mapping[str, Any]]) -> list[Reading]:
    """The readings of one claim, of which each has a row a part."""
    found: dict[str, Reading] = {}
    for row in rows:
        choices = {key: str(value) for key, value in row.items() if key not in FIXED and value not in ("", None)}
        found.setdefault(str(row["reading"]), Reading(str(row["reading"]), row["kind"], choices, row["outcome"]))
    return list(found.values())


def _over(row: Mapping[str, Any], readings: Sequence[Reading], torn: bool) -> dict[str, Any]:
    if not readings or row["class"] in (NOT_RUN, NOT_JUDGED):
        return {}
    over = rule.over_readings(Outcome(row["class"], 0, 0, 0, 0.0), readings)
    if over.readings is None:
        return {}
    if torn:
        over = replace(over, kind=rule.CONTRADICTORY)
    on = ", ".join(over.depends_on)
    return {"class": over.kind, "overall": over.words, "holds": over.holds_in, "of": over.readings, "depends_on": on}
