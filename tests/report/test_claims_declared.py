"""What every declared claim must have, of all studies: a sentence, a place, a margin that a rule gives."""

import math
import re

import pytest

from radarsim.app import configs
from radarsim.app.run import papers
from radarsim.report.claims import rule

PAPERS = papers()
CLAIMS = [pytest.param(claim, id=claim.id) for of in PAPERS for claim in of.claims]
ORIGINAL = re.compile("[А-Яа-я]{3}")  # the papers are in Russian
SENTENCE = {rule.PRINT, rule.ABOUT, rule.GRID, rule.SAME}  # a range, or a value, of the words
ONE_SIDED = {rule.LIMIT, rule.MATERIAL}


@pytest.mark.parametrize("claim", CLAIMS)
def test_a_claim_carries_its_sentence_and_its_place(claim):
    assert claim.statement
    assert not claim.statement.endswith(".")
    assert claim.place
    if not claim.extension:
        assert ORIGINAL.search(claim.original), claim.original
    assert claim.parts
    assert configs.load(claim.config).stem == claim.config


@pytest.mark.parametrize("claim", CLAIMS)
def test_no_expected_value_is_without_a_rule(claim):
    for part in claim.parts:
        of = part.expected
        assert of.kind in SENTENCE | ONE_SIDED
        assert 0 < of.margin < math.inf
        assert of.lo <= of.hi
        assert of.words
        assert of.strict[0] <= of.strict[1]
        bounded = math.isfinite(of.lo) and math.isfinite(of.hi)
        assert bounded or math.isfinite(of.lo) or math.isfinite(of.hi)
        if of.kind in ONE_SIDED:
            assert not bounded, part.what
        elif of.kind != rule.SAME:  # "no loss" is the same or better
            assert bounded, part.what


@pytest.mark.parametrize("claim", CLAIMS)
def test_parts_of_a_claim_are_told_apart(claim):
    """No part twice; variants of a number each with a name, in a claim that is no extension some part asserted."""
    told = [(part.cases, part.what, part.expected.words, part.statement) for part in claim.parts]
    assert len(told) == len(set(told))
    for part in claim.parts:
        assert bool(part.number) >= bool(part.variant)
    if not claim.extension:
        assert any(part.asserted for part in claim.parts)


def test_no_number_stands_twice_and_all_ids_are_of_their_paper():
    ids = [claim.id for of in PAPERS for claim in of.claims]
    assert len(ids) == len(set(ids))
    assert all(re.fullmatch(r"P[1-4]\.(E?\d+|\d+t)", one) for one in ids)
    every = [claim for of in PAPERS for claim in of.claims if not claim.extension]
    assert {one.paper for one in every} == {"P1", "P2", "P3", "P4"}
    for paper in ("P1", "P2", "P3", "P4"):
        numbers = sorted(int(one.id.partition(".")[2]) for one in every if one.paper == paper)
        assert numbers == list(range(1, len(numbers) + 1))
