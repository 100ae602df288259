"""The rule, case by case, by hand."""

import itertools
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from radarsim.papers.claim_outcome import claim_outcome, round_up
from radarsim.papers.interpretation_outcome import InterpretationOutcome, decisive_choices, outcome_over_interpretations
from radarsim.papers.verdict_rule import (
    CONFIRMED,
    CONTRADICTORY,
    DEPENDS,
    IMMATERIAL,
    LIMIT,
    MATERIAL,
    REFUTED,
    UNDECIDED,
    UNJUDGEABLE,
    VOID,
    JudgedPart,
    miss_in_margins,
    needed_realisations,
    part_verdict,
    widening_factor,
)

INF = math.inf
NUMBER = JudgedPart(25, 24.9, 25.1, 25, 25, 2.5)  # a 25 among multiples of five
OVER = JudgedPart(51, 50.9, 51.1, 50, INF, 0.5, LIMIT)
BETTER = JudgedPart(5, 4.9, 5.1, 0, INF, 1.0, MATERIAL)  # gain in σ, %


def at(part, value, half=0.1, **more):
    return replace(part, measured=value, lo=value - half, hi=value + half, **more)


@pytest.mark.parametrize(
    ("part", "value", "said"),
    [
        (NUMBER, 22.9, CONFIRMED),
        (NUMBER, 22.3, REFUTED),
        (NUMBER, 22.45, UNDECIDED),
        (NUMBER, 27.45, UNDECIDED),
        (NUMBER, 27.7, REFUTED),
        (OVER, 50.2, CONFIRMED),
        (OVER, 49.8, IMMATERIAL),
        (OVER, 50.05, IMMATERIAL),
        (OVER, 49.45, UNDECIDED),
        (OVER, 49.3, REFUTED),
        (BETTER, 1.5, CONFIRMED),
        (BETTER, 1.05, CONFIRMED),
        (BETTER, 0.5, IMMATERIAL),
        (BETTER, -0.5, IMMATERIAL),
        (BETTER, -1.05, UNDECIDED),
        (BETTER, -1.2, REFUTED),
    ],
)
def test_parts(part, value, said):
    assert part_verdict(at(part, value)) == said


def test_a_comparison_the_other_way_round():
    less = JudgedPart(-0.5, -0.6, -0.4, -INF, 0, 1.0, MATERIAL)
    assert part_verdict(less) == IMMATERIAL
    assert part_verdict(at(less, -3)) == CONFIRMED
    assert part_verdict(at(less, 3)) == REFUTED
    assert miss_in_margins(at(less, 3)) == 3


def test_exact_first():
    wide = at(NUMBER, 22.0, half=3.0)
    assert part_verdict(wide) == UNDECIDED
    assert part_verdict(replace(wide, exact=22.6)) == CONFIRMED
    assert part_verdict(replace(wide, exact=22.4)) == REFUTED
    assert miss_in_margins(replace(wide, exact=22.0)) == 1.2  # 3 of 2.5
    assert miss_in_margins(at(NUMBER, 25)) == 0
    never = JudgedPart(INF, 13, INF, 0, INF, 1, MATERIAL, exact=INF)
    assert part_verdict(never) == CONFIRMED


def test_level_is_of_all_parts():
    digits = 0.5e-4 / 3.1535 + 0.5e-5 / 1.95996  # the last ones of quantiles as they are printed
    assert widening_factor(1) == widening_factor(0) == pytest.approx(3.1535 / 1.95996, rel=digits)
    assert widening_factor(50) == pytest.approx(4.1569 / 1.95996, rel=digits)
    one = at(BETTER, -2.0, half=0.8 / widening_factor(1))
    assert part_verdict(one, 1) == REFUTED
    assert part_verdict(one, 50) == UNDECIDED
    certain = JudgedPart(7, 7, 7, 5, 5, 0.5)
    assert part_verdict(certain, 1000) == REFUTED


def test_what_the_truth_cannot_pass_is_void():
    share = JudgedPart(0.90, 0.89, 0.91, 0.99, 1, 0.005, ceiling=0.939)
    assert part_verdict(share) == VOID
    assert part_verdict(replace(share, ceiling=0.995)) == REFUTED
    assert claim_outcome([share]).kind == UNJUDGEABLE
    assert claim_outcome([share, NUMBER]).kind == CONFIRMED
    assert claim_outcome([share, NUMBER]).number_count == 1


def test_one_immaterial_part_in_fifty_refutes_nothing():
    fifty = [at(BETTER, 5)] * 49 + [at(BETTER, -0.2)]
    assert claim_outcome(fifty).kind == CONFIRMED
    assert claim_outcome(fifty).miss == 0.2
    assert claim_outcome([*fifty[1:], at(BETTER, -3)]).kind == REFUTED
    assert claim_outcome([at(BETTER, -0.2)] * 3).kind == IMMATERIAL


def test_sentences_of_a_claim_are_judged_each():
    first, second = at(BETTER, 5, statement="a"), at(BETTER, 0.1, statement="b")
    assert claim_outcome([first, second]).kind == IMMATERIAL
    assert claim_outcome([first, replace(second, statement="a")]).kind == CONFIRMED


def test_undecided_only_where_it_may_yet_be_refuted():
    half = 1.2 / widening_factor(2)
    open_ = at(BETTER, 0.5, half=half)  # −0.7 … 1.7: at worst immaterial
    assert part_verdict(open_) == UNDECIDED
    assert claim_outcome([at(BETTER, 5), replace(open_, exact=math.nan)]).kind == CONFIRMED
    assert claim_outcome([open_]).kind == UNDECIDED
    assert claim_outcome([at(BETTER, 5), at(BETTER, 0, half=half)]).kind == UNDECIDED


def test_realisations_that_would_decide():
    assert needed_realisations(NUMBER) == 0
    wide = widening_factor(1)
    edge = at(NUMBER, 22.4, half=0.2 / wide, n=1000)  # border 22.5
    assert needed_realisations(edge) in (4000, 4001)  # the next whole number
    assert part_verdict(at(NUMBER, 22.4, half=0.0999 / wide)) == REFUTED
    assert needed_realisations(at(NUMBER, 22.5, half=0.2 / wide, n=1000)) is None
    two = at(BETTER, 0.5, half=1.2 / wide, n=1000)  # to 1 it has 0.5, to −1 more than it needs
    assert needed_realisations(two) in (5760, 5761)  # (1.2 / 0.5)² as many
    assert claim_outcome([edge]).needed == needed_realisations(edge)
    assert claim_outcome([NUMBER]).needed is None


def test_realisations_are_said_to_two_digits_and_never_fewer():
    assert [round_up(n) for n in (1, 99, 100, 101, 1_589_927, 64_000)] == [1, 99, 100, 110, 1_600_000, 64_000]


def test_variants_of_a_number_one_suffices():
    right, wrong = at(NUMBER, 25, number="T", variant="a"), at(NUMBER, 50, number="T", variant="b")
    assert claim_outcome([right, wrong]).kind == CONFIRMED
    assert claim_outcome([right, wrong]).number_count == 1
    assert claim_outcome([wrong]).kind == REFUTED
    assert claim_outcome([replace(right, against_print=True), wrong]).kind == CONTRADICTORY
    assert claim_outcome([replace(wrong, against_print=True), right]).kind == CONFIRMED


def test_a_joint_interpretation():
    def of(first, second):
        return [
            at(NUMBER, 25 if ok else 50, number=number, variant=variant)
            for variant, both in (("a", first), ("b", second))
            for number, ok in zip("TS", both, strict=True)
        ]

    assert claim_outcome(of((True, True), (False, False)), joint=True).kind == CONFIRMED
    assert claim_outcome(of((True, False), (False, True)), joint=True).kind == CONTRADICTORY
    assert claim_outcome(of((True, False), (True, False)), joint=True).kind == REFUTED


def test_extensions_and_what_is_not_stated():
    ours = at(NUMBER, 50, asserted=False)
    assert claim_outcome([NUMBER, ours]).kind == CONFIRMED
    assert claim_outcome([ours]).kind == REFUTED
    assert claim_outcome([NUMBER], unstated=True).kind == UNJUDGEABLE


def interpretation(outcome, kind="U", **choices):
    return InterpretationOutcome(str(choices), kind, choices, outcome)


def test_over_interpretations():
    own = claim_outcome([at(NUMBER, 50)])
    assert outcome_over_interpretations(own, []) == own
    false = [interpretation(REFUTED, a="1"), interpretation(REFUTED, a="2")]
    assert outcome_over_interpretations(own, false).kind == REFUTED
    mixed = outcome_over_interpretations(
        own, [*false, interpretation(CONFIRMED, a="3"), interpretation(CONFIRMED, "N", a="4")]
    )
    assert (mixed.kind, mixed.words) == (DEPENDS, "depends on a")
    assert (mixed.holds_in, mixed.interpretations) == (1, 3)
    assert (
        outcome_over_interpretations(own, [interpretation(CONFIRMED, a="1"), interpretation("", a="2")]).kind
        == CONFIRMED
    )
    assert (
        outcome_over_interpretations(own, [interpretation(CONFIRMED, a="1"), interpretation(UNDECIDED, a="2")]).kind
        == UNDECIDED
    )
    assert (
        outcome_over_interpretations(own, [interpretation(REFUTED, a="1"), interpretation(UNDECIDED, a="2")]).kind
        == UNDECIDED
    )
    never = outcome_over_interpretations(own, [interpretation(REFUTED, a="1"), interpretation(IMMATERIAL, a="2")])
    assert (never.kind, never.depends_on, never.holds_in) == (DEPENDS, ("a",), 0)
    assert outcome_over_interpretations(own, [*false, interpretation(CONFIRMED, "N", a="4")]).kind == REFUTED


def test_the_choice_that_flips():
    grid = [
        interpretation(CONFIRMED if flight == "weave" else REFUTED, flight=flight, start=start)
        for flight in ("weave", "pull", "turn")
        for start in ("plots", "truth")
    ]
    assert decisive_choices(grid) == ("flight",)
    apart = [
        interpretation(CONFIRMED, a="1", b="1"),
        interpretation(REFUTED, a="2", b="2"),
        interpretation(CONFIRMED, a="1", b="2"),
    ]
    assert decisive_choices(apart) == ("a",)


def pairwise_flips(interpretations):
    """How often two interpretations that differ in one choice alone come out differently, by looking at every pair."""
    found = Counter()
    for one, other in itertools.combinations(interpretations, 2):
        differ = [key for key in ("a", "b", "c", "d") if one.choices.get(key) != other.choices.get(key)]
        if len(differ) == 1 and (one.outcome == CONFIRMED) != (other.outcome == CONFIRMED):
            found[differ[0]] += 1
    return found


@pytest.mark.parametrize("seed", range(20))
def test_the_choices_that_flip_are_those_of_every_pair(seed):
    """The strongest first, equal ones as they are declared; choices left out and interpretations met twice included."""
    draw = np.random.default_rng(seed)
    interpretations = []
    for values in itertools.product("123", "12", "1234", "12"):
        choices = {key: value for key, value in zip("abcd", values, strict=True) if (key, value) != ("d", "2")}
        true = values[0] == "2" or (values[2] == "4" and draw.random() < 0.5)
        interpretations += [interpretation(CONFIRMED if true else REFUTED, **choices)] * (draw.random() < 0.8) * 2
    found = pairwise_flips(interpretations)
    assert decisive_choices(interpretations) == tuple(sorted(found, key=lambda key: (-found[key], key)))
