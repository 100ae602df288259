"""What every declared claim must have, of all studies: a sentence, a place, a margin that a rule gives."""

import math
import re

import pytest

from radarsim.api import configs
from radarsim.papers.study_claims import paper_claims
from radarsim.papers.verdict_rule import ABOUT, GRID, LIMIT, MATERIAL, PRINT, SAME

PAPERS = paper_claims()
CLAIMS = [claim for of in PAPERS for claim in of.claims]
ORIGINAL = re.compile("[А-Яа-я]{3}")  # the papers are in Russian
SENTENCE = {PRINT, ABOUT, GRID, SAME}  # a range, or a value, of the words
ONE_SIDED = {LIMIT, MATERIAL}


@pytest.mark.slow
def test_a_claim_carries_its_sentence_and_its_place():
    for claim in CLAIMS:
        assert claim.statement, claim.id
        assert not claim.statement.endswith("."), claim.id
        assert claim.place, claim.id
        assert claim.extension or ORIGINAL.search(claim.original), claim.id
        assert claim.parts, claim.id
        assert configs.load(claim.config).stem == claim.config, claim.id


def test_no_expected_value_is_without_a_rule():
    for name, part in [(claim.id, part) for claim in CLAIMS for part in claim.parts]:
        of, where = part.expected, (name, part.what)
        assert of.kind in SENTENCE | ONE_SIDED, where
        assert 0 < of.margin < math.inf, where
        assert of.lo <= of.hi, where
        assert of.words, where
        assert of.strict[0] <= of.strict[1], where
        bounded = math.isfinite(of.lo) and math.isfinite(of.hi)
        assert bounded or math.isfinite(of.lo) or math.isfinite(of.hi), where
        if of.kind in ONE_SIDED:
            assert not bounded, where
        elif of.kind != SAME:  # "no loss" is the same or better
            assert bounded, where


def test_parts_of_a_claim_are_told_apart():
    """No part twice; variants of a number each with a name, in a claim that is no extension some part asserted."""
    for claim in CLAIMS:
        told = [(part.cases, part.what, part.expected.words, part.statement) for part in claim.parts]
        assert len(told) == len(set(told)), claim.id
        assert all(bool(part.number) >= bool(part.variant) for part in claim.parts), claim.id
        assert claim.extension or any(part.asserted for part in claim.parts), claim.id


def test_no_number_stands_twice_and_all_ids_are_of_their_paper():
    ids = [claim.id for of in PAPERS for claim in of.claims]
    assert len(ids) == len(set(ids))
    assert all(re.fullmatch(r"P[1-4]\.(E?\d+|\d+t)", one) for one in ids)
    every = [claim for of in PAPERS for claim in of.claims if not claim.extension]
    assert {one.paper for one in every} == {"P1", "P2", "P3", "P4"}
    for paper in ("P1", "P2", "P3", "P4"):
        numbers = sorted(int(one.id.partition(".")[2]) for one in every if one.paper == paper)
        assert numbers == list(range(1, len(numbers) + 1))
