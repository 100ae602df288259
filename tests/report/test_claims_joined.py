"""Readings beside claims, the page's headline, and the forest plot, by hand."""

import math

import numpy as np

from radarsim.report.claims import forest, page
from radarsim.report.claims.joined import with_readings
from radarsim.report.claims.judge import NOT_RUN
from radarsim.report.claims.rule import CONFIRMED, CONTRADICTORY, DEPENDS, REFUTED, UNDECIDED


def row(claim="P9.1", kind=REFUTED, **more):
    numbers = {"measured": 3.0, "lo": 2.5, "hi": 3.5, "expected_lo": 5.0, "expected_hi": "", "margin": 1.0}
    words = {"paper": "Someone", "statement": "s", "place": "p", "original": "", "reading": "", "number": "", "why": ""}
    classes = {"class": kind, "overall": kind, "verdict": kind, "extension": False, "worst_miss": 2.0, "needed": ""}
    return {"claim": claim, **words, **classes, **numbers, "exact": "", "miss": 2.0, "of": "", "holds": "", **more}


def reading(name, outcome, kind="U", **choices):
    return {"claim": "P9.1", "part": "1", "reading": name, "kind": kind, "outcome": outcome, "miss": 1, **choices}


def test_readings_make_a_claim_depend_on_what_flips_it():
    stored = [
        reading("a", REFUTED, flight="weave", start=""),
        reading("b", CONFIRMED, flight="pull", start=""),
        reading("c", CONFIRMED, "N", flight="other", start=""),
    ]
    (joined,) = with_readings([row()], stored)
    assert (joined["class"], joined["overall"]) == (DEPENDS, "depends on flight")
    assert (joined["holds"], joined["of"], joined["depends_on"]) == (1, 2, "flight")
    assert "in 1 of 2 readings" in page.verdict_of([joined])


def test_readings_leave_alone_what_was_not_run_and_other_claims():
    stored = [reading("a", CONFIRMED, flight="weave")]
    for one in (row(kind=NOT_RUN), row("P9.2")):
        assert with_readings([one], stored) == [one]
    assert with_readings([row(kind=CONTRADICTORY)], stored)[0]["class"] == CONTRADICTORY


def test_a_print_that_contradicts_itself_over_its_readings_does_so_beside_the_claims():
    """The run's own reading confirms it; what the print has otherwise is known to the readings alone."""
    stored = [
        reading("a", CONFIRMED, noise="9") | {"over": CONTRADICTORY},
        reading("b", REFUTED, noise="2.25") | {"over": CONTRADICTORY},
    ]
    (joined,) = with_readings([row(kind=CONFIRMED, worst_miss=0.9)], stored)
    assert (joined["class"], joined["overall"]) == (CONTRADICTORY, CONTRADICTORY)
    assert page.verdict_of([joined]) == f"{CONTRADICTORY} (in 1 of 2 readings)"  # within the margin: no miss is said


def test_what_would_decide_is_of_all_readings_that_are_open():
    stored = [
        reading("a", CONFIRMED, flight="weave", needed=""),
        reading("b", UNDECIDED, flight="pull", needed="3000"),
        reading("c", UNDECIDED, flight="turn", needed="64000"),
        reading("d", UNDECIDED, "N", flight="other", needed="900000"),
    ]
    (joined,) = with_readings([row(kind=CONFIRMED)], stored)
    assert (joined["class"], joined["needed"]) == (UNDECIDED, 64000)
    assert "64,000 realisations would decide" in page.verdict_of([joined])
    stored[1]["needed"] = ""  # a value on a border
    (joined,) = with_readings([row(kind=CONFIRMED)], stored)
    assert math.isnan(joined["needed"])
    assert "would decide" not in page.verdict_of([joined])


def test_headline_counts_classes_and_leaves_extensions_out():
    rows = [row(), row("P9.2", CONFIRMED), row("P9.3", CONFIRMED, extension="true")]
    assert page.counts(rows) == ({CONFIRMED: 1, REFUTED: 1}, 1)
    assert page.counted(rows) == "1 confirmed, 1 refuted; 1 extension not counted"


def test_forest_stands_in_margins():
    assert forest.depth(3.0, row()) == 2.0
    assert forest.depth(6.5, row()) == -1.5
    assert forest.depth(-100.0, row()) == forest.FURTHEST
    between = row(expected_hi=7.0)
    assert forest.depth(6.5, between) == -0.5
    figure = forest.figure([row(), row("P9.2", CONFIRMED, measured=6.0, lo=5.5, hi=6.5, exact=6.25)])
    marks = {mark.label: mark for mark in figure.panels[0].marks if mark.label in (CONFIRMED, REFUTED)}
    refuted, confirmed = marks[REFUTED], marks[CONFIRMED]
    np.testing.assert_allclose((refuted.lo, refuted.y, refuted.hi), ([1.5], [2.0], [2.5]))
    np.testing.assert_allclose((confirmed.lo, confirmed.y, confirmed.exact), ([-1.5], [-1.0], [-1.25]))
    assert forest.figure([row(kind=NOT_RUN)]) is None


def test_of_variants_of_a_number_the_nearest_is_drawn():
    far = row(number="T", measured=-50.0, lo=-51.0, hi=-49.0)
    near = row(number="T", measured=4.9, lo=4.8, hi=5.0)
    assert forest.worst([far, near]) is near
    assert forest.worst([row(extension=True), near]) is near
