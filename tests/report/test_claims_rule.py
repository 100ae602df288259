"""The rule, case by case, by hand."""

import itertools
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from radarsim.report.claims import rule
from radarsim.report.claims.rule import (
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
    Interpretation,
    Judged,
)

INF = math.inf
NUMBER = Judged(25, 24.9, 25.1, 25, 25, 2.5)  # a 25 among multiples of five
OVER = Judged(51, 50.9, 51.1, 50, INF, 0.5, LIMIT)
BETTER = Judged(5, 4.9, 5.1, 0, INF, 1.0, MATERIAL)  # gain in σ, %


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
    assert rule.verdict(at(part, value)) == said


def test_a_comparison_the_other_way_round():
    less = Judged(-0.5, -0.6, -0.4, -INF, 0, 1.0, MATERIAL)
    assert rule.verdict(less) == IMMATERIAL
    assert rule.verdict(at(less, -3)) == CONFIRMED
    assert rule.verdict(at(less, 3)) == REFUTED
    assert rule.miss(at(less, 3)) == 3


def test_exact_first():
    wide = at(NUMBER, 22.0, half=3.0)
    assert rule.verdict(wide) == UNDECIDED
    assert rule.verdict(replace(wide, exact=22.6)) == CONFIRMED
    assert rule.verdict(replace(wide, exact=22.4)) == REFUTED
    assert rule.miss(replace(wide, exact=22.0)) == 1.2  # 3 of 2.5
    assert rule.miss(at(NUMBER, 25)) == 0
    never = Judged(INF, 13, INF, 0, INF, 1, MATERIAL, exact=INF)
    assert rule.verdict(never) == CONFIRMED


def test_level_is_of_all_parts():
    digits = 0.5e-4 / 3.1535 + 0.5e-5 / 1.95996  # the last ones of quantiles as they are printed
    assert rule.level(1) == rule.level(0) == pytest.approx(3.1535 / 1.95996, rel=digits)
    assert rule.level(50) == pytest.approx(4.1569 / 1.95996, rel=digits)
    one = at(BETTER, -2.0, half=0.8 / rule.level(1))
    assert rule.verdict(one, 1) == REFUTED
    assert rule.verdict(one, 50) == UNDECIDED
    certain = Judged(7, 7, 7, 5, 5, 0.5)
    assert rule.verdict(certain, 1000) == REFUTED


def test_what_the_truth_cannot_pass_is_void():
    share = Judged(0.90, 0.89, 0.91, 0.99, 1, 0.005, ceiling=0.939)
    assert rule.verdict(share) == VOID
    assert rule.verdict(replace(share, ceiling=0.995)) == REFUTED
    assert rule.claim([share]).kind == UNJUDGEABLE
    assert rule.claim([share, NUMBER]).kind == CONFIRMED
    assert rule.claim([share, NUMBER]).of == 1


def test_one_immaterial_part_in_fifty_refutes_nothing():
    fifty = [at(BETTER, 5)] * 49 + [at(BETTER, -0.2)]
    assert rule.claim(fifty).kind == CONFIRMED
    assert rule.claim(fifty).miss == 0.2
    assert rule.claim([*fifty[1:], at(BETTER, -3)]).kind == REFUTED
    assert rule.claim([at(BETTER, -0.2)] * 3).kind == IMMATERIAL


def test_sentences_of_a_claim_are_judged_each():
    first, second = at(BETTER, 5, statement="a"), at(BETTER, 0.1, statement="b")
    assert rule.claim([first, second]).kind == IMMATERIAL
    assert rule.claim([first, replace(second, statement="a")]).kind == CONFIRMED


def test_undecided_only_where_it_may_yet_be_refuted():
    half = 1.2 / rule.level(2)
    open_ = at(BETTER, 0.5, half=half)  # −0.7 … 1.7: at worst immaterial
    assert rule.verdict(open_) == UNDECIDED
    assert rule.claim([at(BETTER, 5), replace(open_, exact=math.nan)]).kind == CONFIRMED
    assert rule.claim([open_]).kind == UNDECIDED
    assert rule.claim([at(BETTER, 5), at(BETTER, 0, half=half)]).kind == UNDECIDED


def test_realisations_that_would_decide():
    assert rule.needed(NUMBER) == 0
    wide = rule.level(1)
    edge = at(NUMBER, 22.4, half=0.2 / wide, n=1000)  # border 22.5
    assert rule.needed(edge) in (4000, 4001)  # the next whole number
    assert rule.verdict(at(NUMBER, 22.4, half=0.0999 / wide)) == REFUTED
    assert rule.needed(at(NUMBER, 22.5, half=0.2 / wide, n=1000)) is None
    two = at(BETTER, 0.5, half=1.2 / wide, n=1000)  # to 1 it has 0.5, to −1 more than it needs
    assert rule.needed(two) in (5760, 5761)  # (1.2 / 0.5)² as many
    assert rule.claim([edge]).needed == rule.needed(edge)
    assert rule.claim([NUMBER]).needed is None


def test_realisations_are_said_to_two_digits_and_never_fewer():
    assert [rule.roughly(n) for n in (1, 99, 100, 101, 1_589_927, 64_000)] == [1, 99, 100, 110, 1_600_000, 64_000]


def test_variants_of_a_number_one_suffices():
    right, wrong = at(NUMBER, 25, number="T", variant="a"), at(NUMBER, 50, number="T", variant="b")
    assert rule.claim([right, wrong]).kind == CONFIRMED
    assert rule.claim([right, wrong]).of == 1
    assert rule.claim([wrong]).kind == REFUTED
    assert rule.claim([replace(right, against_print=True), wrong]).kind == CONTRADICTORY
    assert rule.claim([replace(wrong, against_print=True), right]).kind == CONFIRMED


def test_a_joint_interpretation():
    def of(first, second):
        return [
            at(NUMBER, 25 if ok else 50, number=number, variant=variant)
            for variant, both in (("a", first), ("b", second))
            for number, ok in zip("TS", both, strict=True)
        ]

    assert rule.claim(of((True, True), (False, False)), joint=True).kind == CONFIRMED
    assert rule.claim(of((True, False), (False, True)), joint=True).kind == CONTRADICTORY
    assert rule.claim(of((True, False), (True, False)), joint=True).kind == REFUTED


def test_extensions_and_what_is_not_stated():
    ours = at(NUMBER, 50, asserted=False)
    assert rule.claim([NUMBER, ours]).kind == CONFIRMED
    assert rule.claim([ours]).kind == REFUTED
    assert rule.claim([NUMBER], unstated=True).kind == UNJUDGEABLE


def interpretation(outcome, kind="U", **choices):
    return Interpretation(str(choices), kind, choices, outcome)


def test_over_interpretations():
    own = rule.claim([at(NUMBER, 50)])
    assert rule.over_interpretations(own, []) == own
    false = [interpretation(REFUTED, a="1"), interpretation(REFUTED, a="2")]
    assert rule.over_interpretations(own, false).kind == REFUTED
    mixed = rule.over_interpretations(
        own, [*false, interpretation(CONFIRMED, a="3"), interpretation(CONFIRMED, "N", a="4")]
    )
    assert (mixed.kind, mixed.words) == (DEPENDS, "depends on a")
    assert (mixed.holds_in, mixed.interpretations) == (1, 3)
    assert (
        rule.over_interpretations(own, [interpretation(CONFIRMED, a="1"), interpretation("", a="2")]).kind == CONFIRMED
    )
    assert (
        rule.over_interpretations(own, [interpretation(CONFIRMED, a="1"), interpretation(UNDECIDED, a="2")]).kind
        == UNDECIDED
    )
    assert (
        rule.over_interpretations(own, [interpretation(REFUTED, a="1"), interpretation(UNDECIDED, a="2")]).kind
        == UNDECIDED
    )
    never = rule.over_interpretations(own, [interpretation(REFUTED, a="1"), interpretation(IMMATERIAL, a="2")])
    assert (never.kind, never.depends_on, never.holds_in) == (DEPENDS, ("a",), 0)
    assert rule.over_interpretations(own, [*false, interpretation(CONFIRMED, "N", a="4")]).kind == REFUTED


def test_the_choice_that_flips():
    grid = [
        interpretation(CONFIRMED if flight == "weave" else REFUTED, flight=flight, start=start)
        for flight in ("weave", "pull", "turn")
        for start in ("plots", "truth")
    ]
    assert rule.flips(grid) == ("flight",)
    apart = [
        interpretation(CONFIRMED, a="1", b="1"),
        interpretation(REFUTED, a="2", b="2"),
        interpretation(CONFIRMED, a="1", b="2"),
    ]
    assert rule.flips(apart) == ("a",)


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
    assert rule.flips(interpretations) == tuple(sorted(found, key=lambda key: (-found[key], key)))
