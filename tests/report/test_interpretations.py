"""Interpretations as data, the rule over them and the page, on a small paper of our own."""

import dataclasses

from radarsim.papers import verdicts_by_interpretation
from radarsim.papers.claim import Claim, Part
from radarsim.papers.claim_outcome import round_up
from radarsim.papers.evidence import MissingEvidence, exact_number
from radarsim.papers.expected_ranges import printed
from radarsim.papers.interpretation_outcome import outcome_over_interpretations
from radarsim.papers.interpretations import DEFAULT, Alternative, Choice, PaperInterpretations
from radarsim.papers.interpretations_page import interpretations_page
from radarsim.papers.verdict_rule import AGAINST, CONFIRMED, DEPENDS, EQUIVALENT, REFUTED, UNDECIDED, UNSTATED
from radarsim.papers.verdicts_by_interpretation import (
    ClaimVerdicts,
    judge_claim,
    verdict_columns,
    verdict_rows,
    worst_distance,
)
from radarsim.report.statistics import Estimate
from tests.tolerances import assert_rounded


class Small(PaperInterpretations):
    """Two numbers that depend on two choices, of which one bears on the first claim alone."""

    paper = "P9"
    choices = (
        Choice(
            *("scale", "how large it is", "nichts", "nothing"),
            (
                Alternative("one", UNSTATED, "plain"),
                Alternative("two", UNSTATED, "double"),
                Alternative("ten", AGAINST, "not as printed"),
            ),
        ),
        Choice(
            *("form", "its form", "nichts", "nothing"),
            (Alternative("round", EQUIVALENT, "plain"), Alternative("square", EQUIVALENT, "alike")),
            ("P9.1",),
        ),
    )

    def is_exact(self, claim, interpretation):
        return True

    def evidence(self, claim, interpretation, changed_results, paper_claims):
        if interpretation["form"] == "square" and interpretation["scale"] == "two":
            raise MissingEvidence("no square is so large")
        return {"one": 1.0, "two": 2.0, "ten": 10.0}[interpretation["scale"]]


class Sampled(Small):
    """The same, of numbers with an interval."""

    def is_exact(self, claim, interpretation):
        return False


class Ends(Estimate):
    """Evidence of one number, which is not known exactly."""

    def exactly(self):
        raise MissingEvidence("not known exactly")


def claim(number, *values):
    parts = tuple(
        Part((), f"number {text}", "m", lambda evidence: exact_number(evidence), printed(text)) for text in values
    )
    return Claim(f"P9.{number}", "somewhere", f"It is {' and '.join(values)}", parts)


def over(of, one):
    every = []
    for interpretation in of.for_claim(one.id):
        try:
            every.append(judge_claim(of, one, interpretation, of.evidence(one, interpretation, None, None)))
        except MissingEvidence as missing:
            every.append(judge_claim(of, dataclasses.replace(one, parts=()), interpretation, None))
            every[-1] = dataclasses.replace(every[-1], claim=one, outcome=None, why=missing.args[0])
    return ClaimVerdicts(of, one, tuple(every))


def test_interpretations_of_a_claim_leave_out_what_does_not_bear_on_it():
    of = Small()
    assert len(of.declared_interpretations()) == 5  # two by two of E and U, and one against the print
    assert len(of.for_claim("P9.1")) == 5
    assert len(of.for_claim("P9.2")) == 3
    assert all(one["form"] == "round" for one in of.for_claim("P9.2"))


def test_names_and_kinds():
    of = Small()
    assert of.name(of.interpretation()) == DEFAULT
    assert of.name(of.interpretation(scale="two", form="square")) == "scale: two; form: square"
    assert [
        of.kind(of.interpretation(**taken)) for taken in ({}, {"form": "square"}, {"scale": "two"}, {"scale": "ten"})
    ] == [*(EQUIVALENT, EQUIVALENT, UNSTATED, AGAINST)]
    assert of.kind(of.interpretation(scale="ten", form="square")) == AGAINST


def test_a_claim_over_its_interpretations():
    of = Small()
    one = over(of, claim(2, "1"))
    assert [each.outcome.kind for each in one.verdicts] == [CONFIRMED, REFUTED, REFUTED]
    assert one.outcome.kind == DEPENDS
    assert (one.outcome.holds_in, one.outcome.interpretations, one.outcome.depends_on) == (1, 2, ("scale",))
    assert one.sentence() == "holds in 1 of 2 interpretations; depends on how large it is"
    never = over(of, claim(2, "10"))
    assert never.outcome.kind == REFUTED
    assert "it holds, against the print, with how large it is: ten" in never.sentence()


def test_the_rule_looks_at_all_interpretations_once(monkeypatch):
    """A row each asks for the class: of 768 interpretations, each looking at all the others, that took ten minutes."""
    calls = []
    monkeypatch.setattr(
        verdicts_by_interpretation,
        "outcome_over_interpretations",
        lambda *arguments: calls.append(1) or outcome_over_interpretations(*arguments),
    )
    one = over(Small(), claim(1, "1"))
    names = verdict_columns([Small()])
    assert {row["over"] for each in one.verdicts for row in verdict_rows(each, names, one.outcome)} == {
        one.outcome.kind
    }
    assert one.sentence()
    assert len(calls) == 1


def test_a_interpretation_that_cannot_be_done_is_listed():
    one = over(Small(), claim(1, "1"))
    (impossible,) = one.impossible
    assert impossible.why == "no square is so large"
    assert "1 not possible" in one.sentence()
    assert one.outcome.interpretations == 3  # of four that the paper allows
    names = verdict_columns([Small()])
    (row,) = verdict_rows(impossible, names)
    assert (row["verdict"], row["reason"], row["scale"]) == ("not possible", "no square is so large", "two")


def test_depth_is_in_margins_with_its_sign():
    of = Small()
    one = over(of, claim(2, "1", "1.6"))
    assert_rounded(worst_distance(one.verdicts[0])[0], (1.6 - 1.0) / 0.05, operations=3)  # of the worst part
    assert worst_distance(over(of, claim(2, "1")).verdicts[0])[0] == 0


def test_what_is_open_says_what_would_decide_it():
    """Two interpretations of three are open: the harder one says how many it takes; the one against the print is not
    asked."""
    of, one = Sampled(), claim(2, "1")
    part = Part((), "number", "m", lambda evidence: Estimate(*evidence), printed("1.0"))
    ends = {"one": (1.0, 0.99, 1.01), "two": (1.04, 1.0, 1.08), "ten": (1.0, 0.0, 2.0)}
    every = [
        judge_claim(
            of, dataclasses.replace(one, parts=(part,)), interpretation, Ends(*ends[interpretation["scale"]]), 1000
        )
        for interpretation in of.for_claim(one.id)
    ]
    found = ClaimVerdicts(of, one, tuple(every))
    assert [each.outcome.kind for each in every] == [CONFIRMED, UNDECIDED, UNDECIDED]
    needed = every[1].outcome.needed
    assert 1000 < needed < every[2].outcome.needed
    assert (found.outcome.kind, found.outcome.needed, found.fewest_realisations) == (UNDECIDED, needed, 1000)
    assert f"1 open at 1000 realisations, about {round_up(needed):,} would decide" in found.sentence()
    assert {row["needed"] for each in every[1:2] for row in verdict_rows(each, verdict_columns([of]))} == {needed}
    assert found.undecided_sentence() in interpretations_page(of, "Nobody 1900", [found])
    assert over(Small(), claim(2, "1")).undecided_sentence() == ""


def test_page_lists_claims_impossible_interpretations_and_open_choices():
    of = Small()
    text = interpretations_page(of, "Nobody 1900", [over(of, claim(1, "1")), over(of, claim(2, "10"))])
    assert "| P9.1 |" in text
    assert "no square is so large" in text
    assert "> nichts" in text
    assert "| ten | N | not as printed |" in text
