"""Claims in YAML: what they become, and what is said of a mistake in one."""

import math
import re
import subprocess
import sys
from types import ModuleType

import numpy as np
import pytest
from scipy import stats

from radarsim.errors import ConfigError
from radarsim.language.current import use_language
from radarsim.language.translate import tr
from radarsim.papers import evidence
from radarsim.papers.claim_files import load_choices, load_claims, with_arguments, with_cases
from radarsim.papers.evidence import ExactNumber
from radarsim.papers.expected_ranges import above, printed
from radarsim.papers.sonar.measures import CASE_FINDERS
from radarsim.papers.study_claims import claims_of, interpretations_of, paper_claims
from radarsim.papers.verdict_rule import REFUTED, SAMPLE, JudgedPart, part_verdict
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

HEAD = "paper: P9\nconfig: walk\nnames: {PAIRS: [[2, 3], [4, 5]], R: [range]}\nclaims:\n"
CLAIM = "- id: 1\n  place: section 1\n  statement: It gains\n  parts:\n"
PART = "  - {of: [1], what: gain, measure: {gain: {pick: first}}, expected: {above: 0}}\n"


class Evidence(evidence.Evidence):
    """One that knows a number of a case."""

    def known(self, key: int, times: float = 1.0) -> float:
        return 7.0 * key * times


def gain(evidence: Evidence, key: int, pick: str, scan: int = 1) -> Estimate:
    return Estimate(key, scan, len(pick))


def exact_gain(evidence: Evidence, key: int, pick: str, scan: int = 1) -> float:
    return 10.0 * key


@pytest.mark.parametrize("key", ["interpretation", "reading"])
def test_interpretation_may_be_given_under_its_earlier_name(claims, key):
    (claim,) = claims(f"{HEAD}{CLAIM}{PART}".replace("  parts:", f"  {key}: at the end\n  parts:"))
    assert claim.interpretation == "at the end"


@pytest.fixture
def claims(tmp_path):
    """A function that reads claims of this text."""
    module = ModuleType("measures")
    vars(module).update(Evidence=Evidence, gain=gain, exact_gain=exact_gain)

    def read(text):
        file = tmp_path / "claims.yaml"
        file.write_text(text, encoding="utf-8")
        load_claims.cache_clear()
        return load_claims(file, module)

    return read


def test_a_claim_is_what_is_written(claims):
    (claim,) = claims(HEAD + CLAIM + PART)
    (part,) = claim.parts
    assert (claim.id, claim.place, claim.statement, claim.config) == ("P9.1", "section 1", "It gains", "walk")
    assert (part.cases, part.what, part.unit, part.expected, part.asserted) == ((1,), "gain", "", above(0), True)
    seen = Evidence((), {}, {})
    assert part.measure(seen) == Estimate(1, 1, 5)
    assert part.exact(seen) == 10
    assert with_cases(part, 4).measure(seen) == Estimate(4, 1, 5)
    assert with_arguments(part, scan=0).measure(seen) == Estimate(1, 0, 5)


def test_each_makes_a_part_of_every_combination_in_order(claims):
    part = """  - {of: [$n], each: {n: [1, 2], "times, text": [[3, "1.5"], [4, "2.50"]]}, unit: $text,
     what: "$n of ${text}s", measure: {known: {times: $times}}, expected: {printed: $text}}\n"""
    (claim,) = claims(HEAD + CLAIM + part)
    assert [one.what for one in claim.parts] == ["1 of 1.5s", "1 of 2.50s", "2 of 1.5s", "2 of 2.50s"]
    assert [one.cases for one in claim.parts] == [(1,), (1,), (2,), (2,)]
    assert claim.parts[1].expected == printed("2.50")
    seen = Evidence((), {}, {})
    assert [one.measure(seen).value for one in claim.parts] == [21, 28, 42, 56]
    assert isinstance(claim.parts[0].measure(seen), ExactNumber)


def test_a_method_is_that_of_the_evidence_at_hand(claims):
    class Other(Evidence):
        def known(self, key, times=1.0):
            return -1.0

    (claim,) = claims(HEAD + CLAIM + PART.replace("{gain: {pick: first}}", "known"))
    assert claim.parts[0].measure(Other((), {}, {})).value == -1


def test_the_parts_of_claims_before_it(claims):
    first, second = claims(HEAD + CLAIM + PART + CLAIM.replace("id: 1", "id: 2").replace("parts:", "parts_of: [P9.1]"))
    assert first.parts == second.parts


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "what: gain",
            "what: $more",
            "claims.yaml:9:21: claims.0.parts.0.what: $more is not given under names or each",
        ),
        (
            "{gain: {pick",
            "{gian: {pick",
            "parts.0.measure: must be one of them; did you mean gain? allowed: known, gain, exact_gain, got",
        ),
        ("pick: first", "pik: first", "measure.gain: gain(key, pick, scan): missing a required argument: 'pick', got "),
        ("pick: first", "pick: first, scan: 1.5", "measure.gain.scan: must be a whole number, got 1.5"),
        ("pick: first", "pick: first, scan: true", "measure.gain.scan: must be a whole number, got true"),
        ("pick: first", "pick: true", "measure.gain.pick: must be text, got true"),
        ("{pick: first}", "first", "measure.gain: must have its arguments by name, got 'first'"),
        ("above: 0", "above: high", "expected.above.value: must be a number, got 'high'"),
        ("above: 0", "printed: 5", "expected.printed.text: must be text, got 5"),
        ("above: 0", "between: [2, 1]", "expected.between.low: must be text; its ends must rise, got 2"),
        ("above: 0", "between: [1, 2]", "expected.between.low: must be text, got 1"),
        ("above: 0", "same: [1, 0]", "expected: must be a range from low to high with a margin > 0, got '1 ± 0'"),
        ("above: 0", "same: [1, -0.1]", "must be a range from low to high with a margin > 0, got '1 ± -0.1'"),
        ("above: 0", "within: [2, 1]", "must be a range from low to high with a margin > 0, got '2 to 1'"),
        ("above: 0", "more: 0", "parts.0.expected: must be one of them; allowed: printed, between"),
        ("of: [1]", "of: 1", "parts.0.of: must be a list of cases, got 1"),
        ("of: [1]", "of: [1], each: {n: 1}", "parts.0.each.n: must be a list, got 1"),
        ("of: [1]", 'of: [1], each: {"n, m": [[1]]}', "each.n, m: must be a list of lists of 2, got [[1]]"),
        ("of: [1]", "of: [1], unti: m", "parts.0.unti: unknown key; did you mean unit? allowed: what, of"),
        ("what: gain, ", "", "parts.0.what: required key is missing"),
        ("what: gain", "what: costs $ 5", "what: must name a value after each $, got 'costs $ 5'"),
    ],
)
def test_a_mistake_is_named_with_its_line_and_what_is_allowed(claims, old, new, said):
    assert old in PART
    with pytest.raises(ConfigError) as raised:
        claims(HEAD + CLAIM + PART.replace(old, new))
    assert said in str(raised.value)
    assert "claims.yaml:9:" in str(raised.value)


def test_no_two_claims_have_one_number(claims):
    with pytest.raises(ConfigError, match=r"claims.yaml:10:7: claims.1.id: stands there already, got '1'"):
        claims(HEAD + (CLAIM + PART) * 2)


def test_parts_of_a_claim_that_is_not_there(claims):
    with pytest.raises(ConfigError, match=r"parts_of: must be of the claims before it; allowed: none, got 'P9.7'"):
        claims(HEAD + CLAIM.replace("parts:", "parts_of: [P9.7]"))


def test_every_case_that_p3_names_is_one_that_is_looked_for():
    keys = {
        key
        for of in paper_claims()
        for claim in of.claims
        if claim.paper == "P3"
        for p in claim.parts
        for key in p.cases
    }
    assert {key if isinstance(key, str) else key[0] for key in keys} == set(CASE_FINDERS)


def test_a_list_reads_no_claims():
    program = (
        "import sys\n"
        "from radarsim.cli import entry\n"
        "try: entry()\n"
        "finally: assert 'radarsim.papers.claim_files' not in sys.modules"
    )
    for argument in ("list", "--help"):
        subprocess.run([sys.executable, "-c", program, argument], check=True, capture_output=True)


def test_what_a_paper_leaves_open_is_what_is_written(tmp_path):
    file = tmp_path / "interpretations.yaml"
    file.write_text(
        "paper: P9\nnames: {FAST: [1, 3]}\nchoices:\n- key: start\n  asks: how it starts\n  original: nothing\n"
        "  claims: [$FAST, 5t]\n  alternatives:\n  - {name: slow, kind: U, reason: none, sets: {rate: 2}}\n"
    )
    (choice,) = load_choices(file)
    assert (choice.key, choice.original, choice.english) == ("start", "nothing", "nothing")
    assert choice.claims == ("P9.1", "P9.3", "P9.5t")
    assert (choice.default, choice["slow"].sets, choice.contradicts) == ("slow", {"rate": 2}, False)
    file.write_text(file.read_text().replace("kind: U", "kind: X").replace("$FAST", "$SLOW"))
    with pytest.raises(ConfigError, match=r"interpretations.yaml:9:24: .*kind: must be one of E, U, N, got 'X'"):
        load_choices(file)


def test_a_choice_bears_on_claims_that_there_are():
    for name in registry.SHIPPED:
        interpretations = interpretations_of(registry.study(name))
        known = {claim.id for claim in claims_of(registry.study(name)).claims} if interpretations else set()
        assert interpretations is None or {one for choice in interpretations.choices for one in choice.claims} <= known


@pytest.mark.parametrize("language", ["en", "ru"])
def test_a_choice_is_named_by_few_words_within_a_sentence(language):
    """In a list of several, and beside a figure."""
    with use_language(language):
        said = [
            tr(one.asks)
            for name in registry.SHIPPED
            if (of := interpretations_of(registry.study(name)))
            for one in of.choices
        ]
    assert [words for words in said if len(words) > 36 or ", " in words or re.match("[A-ZА-Я][a-zа-я ]", words)] == []


def test_how_long_fast_radars_are_watched_bears_on_all_claims_that_look_at_one():
    study = registry.study("range_doppler")
    points = next(one for one in interpretations_of(study).choices if one.key == "points")
    looked = {}
    for claim in claims_of(study).claims:
        cases = [case for part in claim.parts if part.asserted for case in part.cases]
        looked[claim.id] = {case[0] if isinstance(case, tuple) else case for case in cases}
    algebra, level = {"P1.16", "P1.31", "P1.34", "P1.36"}, {"P1.20"}  # what a curve converges to
    assert set(points.claims) == {one for one, radars in looked.items() if radars & {3, 5}} - algebra - level


def test_a_printed_mean_over_runs_has_the_margin_of_its_own_sampling_error(claims):
    words = 'printed: "0.374", runs: 100, variance: 0.015'
    ((part,),) = (claim.parts for claim in claims(HEAD + CLAIM + PART.replace("above: 0", words)))
    se = math.sqrt(0.015 / 100 + 0.001**2 / 12)
    assert part.expected.margin == pytest.approx(stats.t.ppf(0.975, 99) * se, rel=1e-6)
    assert (part.expected.lo, part.expected.hi, part.expected.kind) == (0.374, 0.374, SAMPLE)
    assert part.expected.words == "0.374 ± 0.024"


def test_a_printed_number_may_have_a_standard_error_and_a_resolution(claims):
    words = 'se: 0.02, printed: ["3.5", 0.5]'  # in any order
    (claim,) = claims(HEAD + CLAIM + PART.replace("above: 0", words))
    assert claim.parts[0].expected.margin == pytest.approx(1.959964 * math.hypot(0.02, 0.5 / math.sqrt(12)))


def test_the_print_of_a_true_value_is_refuted_as_seldom_as_its_interval_misses():
    """A measured value without error of its own, against prints of ten runs each, rounded to a digit."""
    rng, refuted, trials = np.random.default_rng(5), 0, 4000
    for _ in range(trials):
        runs = rng.normal(2.0, 0.3, 10)
        words = printed(f"{runs.mean():.1f}", runs=10, variance=float(runs.var(ddof=1)))
        part = JudgedPart(2.0, 2.0, 2.0, words.lo, words.hi, words.margin, words.kind)
        refuted += part_verdict(part) == REFUTED
    assert refuted / trials < 0.05 + 4 * math.sqrt(0.05 * 0.95 / trials)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ('printed: "1", runs: 100', "expected: printed: needs both runs and variance"),
        ('printed: "1", variance: 0.1', "expected: printed: needs both runs and variance"),
        ('printed: "1", runs: 1, variance: 0.1', "needs at least 2 runs, and a variance > 0"),
        ('printed: "1", runs: 10, variance: -1', "needs at least 2 runs, and a variance > 0"),
        ('printed: "1", se: 0', "se must be > 0"),
        ('printed: "1", se: 0.1, runs: 10', "takes se alone, or runs and variance"),
        ('printed: "1", runz: 10', "printed(text, step, runs, variance, se): got an unexpected keyword argument"),
        ('printed: "1", runs: many', "expected.printed.runs: must be a whole number, got 'many'"),
        ('printed: "1", about: "2"', "expected: must be one of them; allowed: printed"),
        ('about: "1", runs: 10', "about(low, high, margin, kind): got an unexpected keyword argument 'runs'"),
        ("printed: one", "expected: printed: must be a number as it is printed, such as 0.374"),
    ],
)
def test_what_a_printed_sample_lacks_is_named(claims, words, said):
    with pytest.raises(ConfigError) as raised:
        claims(HEAD + CLAIM + PART.replace("above: 0", words))
    assert said in str(raised.value)
    assert "claims.yaml:9:" in str(raised.value)


CHOICE = "choices:\n- {key: KEY, asks: how, original: nothing, alternatives: [{name: a, kind: U, reason: b}]}\n"


@pytest.mark.parametrize("key", ["measured", "kind", "n", "reading"])
def test_a_choice_is_not_called_like_a_column(tmp_path, key):
    file = tmp_path / "interpretations.yaml"
    file.write_text("paper: P9\n" + CHOICE.replace("KEY", key), encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"choices.0.key: is a column of interpretations.csv .*, got '{key}'"):
        load_choices(file)
    file.write_text("paper: P9\n" + CHOICE.replace("KEY", "start") + CHOICE.partition("\n")[2].replace("KEY", "start"))
    with pytest.raises(ConfigError, match=r"choices.1.key: stands there already"):
        load_choices(file)


OPEN_POINT = "paper: P9\nchoices:\n- {key: k, asks: how, original: nothing, claims: [], alternatives: [A]}\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("claims: []", "claims: zzz", "choices.0.claims: must be a list of claims, by their id without the paper"),
        ("claims: []", "claims: {a: 1}", "must be a list of claims"),
        ("claims: []", "claims: 7", "must be a list of claims"),
        ("claims: []", "claims: [[[1]]]", "must be a list of claims"),
        ("[A]", "[]", ":3:68: choices.0.alternatives: must hold at least 1"),
        ("[A]", "[A, A]", "choices.0.alternatives.1.name: stands there already, got 'a'"),
        ("name: a", "name: ''", "choices.0.alternatives.0.name: must not be empty"),
    ],
)
def test_a_mistake_in_choices_is_named_with_its_line_and_what_is_allowed(tmp_path, old, new, words):
    (tmp_path / "interpretations.yaml").write_text(
        OPEN_POINT.replace("A]", "{name: a, kind: U, reason: r}]").replace(old, new, 1)
        if old.startswith("name")
        else OPEN_POINT.replace(old, new, 1).replace("A", "{name: a, kind: U, reason: r}")
    )
    with pytest.raises(ConfigError, match=re.escape(words)):
        load_choices(tmp_path / "interpretations.yaml")
