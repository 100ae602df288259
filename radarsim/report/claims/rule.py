"""The rule by which a claim is judged: numbers in, verdicts out. Written down before anything was measured.

docs/verdicts.md gives it in words. A judged part holds the measured value, the exact value where known, the range that
the paper's words allow and the margin of these words. `verdict` judges one part, `claim` all parts of a claim,
`over_interpretations` a claim under all interpretations that its paper allows.

Ranges and margins from a paper's words; these functions see the words alone, never a measurement.

Reasons why a claim is not judged, in the current language: claims.csv and interpretations.csv have them in English."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist
from typing import NamedTuple

from radarsim.language import numeral, term, tr

# ---- rule ------------------------------------------------------------------------------------------------------------
CONFIRMED, REFUTED, IMMATERIAL = "confirmed", "refuted", "no material difference"
CONTRADICTORY, UNJUDGEABLE = "the print contradicts itself", "not judgeable as stated"
UNDECIDED, DEPENDS = "not yet decided", "depends on"
VOID = "void"  # of a part: the truth itself would fail it
CLASSES = (CONFIRMED, REFUTED, DEPENDS, IMMATERIAL, CONTRADICTORY, UNJUDGEABLE, UNDECIDED)
NO_READING_MENDS = (CONTRADICTORY, UNJUDGEABLE)

# Kinds of margin. Of the first four the margin belongs to the words: a value within it is what the paper says.
PRINT, ABOUT, GRID, SAME = "print", "about", "grid", "same"
LIMIT = "limit"  # "more than 50 %": just outside, within the margin, is no material difference
MATERIAL = "material"  # "better": within the margin of equality, on either side, is no material difference
INCLUSIVE = (PRINT, ABOUT, GRID, SAME)

EQUIVALENT, UNSTATED, AGAINST = "E", "U", "N"  # kinds of interpretations; the last contradicts the print
Z95 = NormalDist().inv_cdf(0.975)
ROUNDING = 1e-12  # of a margin
# A verdict is the same however its number of realisations came about: by one run, by `--decide`, or by a person who
# extends undecided runs. So each counts as one of all looks that may be taken, one for each doubling: at fewer than
# 2000 realisations, at 2000·2^m, and at the most that a run may have, 10¹². report.precision.looks makes them.
LOOKS = 31


@dataclass(frozen=True)
class Judged:
    """One measured part of a claim; all numbers in the part's own unit.

    lo and hi bound 95 %. exact is NaN where unknown. expected_lo and expected_hi are the range of the words, infinite
    at an open end; margin > 0 is their resolution, kind its origin. ceiling is the score of a perfect estimator, NaN
    where that does not apply.

    statement names the part's sentence where a claim has several, all of which must be true. Parts of one `number` are
    variants of it: one suffices. variant is this one's name, against_print whether it takes a value that the paper
    contradicts. A part that the paper does not assert is an extension: shown, not counted."""

    measured: float
    lo: float
    hi: float
    expected_lo: float
    expected_hi: float
    margin: float
    kind: str = PRINT
    exact: float = math.nan
    ceiling: float = math.nan
    n: int = 0
    statement: str = ""
    number: str = ""
    variant: str = ""
    against_print: bool = False
    asserted: bool = True

    @property
    def known(self) -> bool:
        """Whether the exact value is known; it then decides."""
        return not math.isnan(self.exact)

    @property
    def value(self) -> float:
        """The judged value: the exact one, or the measured one."""
        return self.exact if self.known else self.measured

    @property
    def void(self) -> bool:
        """Whether a perfect estimator would fail: then the part tests nothing."""
        return not math.isnan(self.ceiling) and _miss(self.ceiling, self) > 1

    @property
    def sampled(self) -> bool:
        """Whether it has a sampling error."""
        return not self.known and self.lo != self.hi


@dataclass(frozen=True)
class Outcome:
    """The outcome of a claim: its class, the words, how many numbers held and failed, and the worst miss in margins.

    needed: realisations that would decide it, if undecided; None: no number would."""

    kind: str
    held: int
    failed: int
    of: int
    miss: float
    needed: int | None = None
    depends_on: tuple[str, ...] = ()
    holds_in: int | None = None
    interpretations: int | None = None

    @property
    def words(self) -> str:
        """The class, and its dependence on choices."""
        return f"{self.kind} {', '.join(self.depends_on)}".rstrip() if self.kind == DEPENDS else self.kind


# ---- one part -----------------------------------------------------------------------------------------------------
def widened(lo: float, value: float, hi: float, factor: float) -> tuple[float, float]:
    """An interval with its two half-widths times a factor."""
    return value - factor * (value - lo), value + factor * (hi - value)


def level(parts: int) -> float:
    """Factor on half-widths so that as many intervals hold at once, at all LOOKS, in 95 % of runs.

    One factor at every look (Pocock, Biometrika 64, 1977, 191-199), by the union bound over looks and parts: whatever
    their correlation, at most 5 % of runs err. For one part the exact recursion over looks gives 4.0 %; a factor for
    exactly 5 % would save 4 % of the realisations."""
    return NormalDist().inv_cdf(1 - 0.025 / LOOKS / max(parts, 1)) / Z95


def ends(part: Judged, parts: int = 1) -> tuple[float, float]:
    """The judged interval: the exact value twice, or the 95 % interval widened for so many parts."""
    if part.known:
        return part.exact, part.exact
    if part.lo == part.hi:
        return part.lo, part.hi
    if not (math.isfinite(part.measured) and math.isfinite(part.lo) and math.isfinite(part.hi)):
        return part.lo, part.hi
    return widened(part.lo, part.measured, part.hi, level(parts))


def miss(part: Judged) -> float:
    """How far the value lies outside the words, in margins; 0 inside."""
    return _miss(part.value, part)


def _miss(value: float, part: Judged) -> float:
    outside = max(part.expected_lo - value, value - part.expected_hi, 0.0)
    return outside / part.margin if outside > ROUNDING * part.margin else 0.0


def verdict(part: Judged, parts: int = 1) -> str:
    """The verdict on one part of a claim that has so many parts with a sampling error."""
    lo, hi = ends(part, parts)
    if part.void:
        return VOID
    if not lo <= hi:
        return UNDECIDED
    low, high = part.expected_lo - part.margin, part.expected_hi + part.margin
    if hi < low or lo > high:
        return REFUTED
    if part.kind == MATERIAL and _near_equality(lo, hi, part):
        return IMMATERIAL
    if part.expected_lo <= lo and hi <= part.expected_hi:
        return CONFIRMED
    if low <= lo and hi <= high:
        if part.kind in INCLUSIVE:
            return CONFIRMED
        if part.kind == LIMIT:
            return IMMATERIAL
    return UNDECIDED


def _near_equality(lo: float, hi: float, part: Judged) -> bool:
    """Whether an interval lies within the margin of an end of the range, on either side."""
    equal = (end for end in (part.expected_lo, part.expected_hi) if math.isfinite(end))
    return any(end - part.margin <= lo and hi <= end + part.margin for end in equal)


def harmless(part: Judged, parts: int = 1) -> bool:
    """Whether an undecided part can at worst become no material difference."""
    lo, hi = ends(part, parts)
    return part.expected_lo - part.margin <= lo and hi <= part.expected_hi + part.margin


def needed(part: Judged, parts: int = 1) -> int | None:
    """How many realisations would likely decide a part: the interval shrinks with 1/√n about the measured value.

    0 where it is decided; None where the value lies on a border, or its interval is unknown."""
    if verdict(part, parts) != UNDECIDED:
        return 0
    lo, hi = ends(part, parts)
    if part.known or not part.n or not (math.isfinite(lo) and math.isfinite(hi) and lo < hi):
        return None
    found = [one for one in (_shrunk(part, parts, border) for border in _borders(part)) if one is not None]
    return min(found, default=None)


def _borders(part: Judged) -> list[float]:
    """The values at which verdicts change."""
    ways = (-part.margin, part.margin) if part.kind == MATERIAL else (0.0,)
    out = (part.expected_lo - part.margin, part.expected_hi + part.margin)
    inner = [end + way for end in (part.expected_lo, part.expected_hi) for way in ways]
    return sorted({one for one in (*out, *(() if part.kind in INCLUSIVE else inner)) if math.isfinite(one)})


def _shrunk(part: Judged, parts: int, border: float) -> int | None:
    """Realisations at which the interval no longer reaches a border, if no other one is reached then either."""
    lo, hi = ends(part, parts)
    gap = abs(part.measured - border)
    half = part.measured - lo if border < part.measured else hi - part.measured
    if not 0 < gap < half:
        return None
    share = gap / half * (1 - 1e-9)
    low, high = widened(part.lo, part.measured, part.hi, share)
    decided = verdict(replace(part, lo=low, hi=high), parts) != UNDECIDED
    return math.ceil(part.n / share**2) if decided else None


# ---- a claim ------------------------------------------------------------------------------------------------------
# For variants of a number the first of these that one has; CONTRADICTORY where only one against the print holds.
BEST = (CONFIRMED, IMMATERIAL, UNDECIDED, CONTRADICTORY, REFUTED)
# For the sentences of a claim the first of these that one has.
WORST = (REFUTED, CONTRADICTORY, UNDECIDED, UNJUDGEABLE, IMMATERIAL, CONFIRMED)


def claim(parts: Sequence[Judged], *, unstated: bool = False, joint: bool = False, internal: bool = False) -> Outcome:
    """The outcome of a claim with these parts; of an extension without asserted parts, as if all were.

    unstated: the paper omits what the statement is about, so that it cannot be judged. joint: one variant has to
    give every number; where each is reproduced in some variant and no variant gives all, the print contradicts itself.
    internal: both sides are printed; where they differ, the print contradicts itself."""
    asserted = [part for part in parts if part.asserted] or list(parts)
    many = sum(part.sampled and not part.void for part in asserted)
    if joint:
        return _joint(asserted, many)
    numbers = _numbers(asserted)
    said = {name: _best(own, many) for name, own in numbers.items()}
    kind = UNJUDGEABLE if unstated else _kind(numbers, said, many)
    if internal and kind == REFUTED:
        kind = CONTRADICTORY
    misses = [min(miss(part) for part in own) for name, own in numbers.items() if said[name] != VOID]
    open_ = [part for name, own in numbers.items() if said[name] == UNDECIDED for part in own]
    return Outcome(
        kind,
        held=sum(one in (CONFIRMED, IMMATERIAL) for one in said.values()),
        failed=sum(one in (REFUTED, CONTRADICTORY) for one in said.values()),
        of=sum(one != VOID for one in said.values()),
        miss=max(misses, default=math.nan),
        needed=most_needed(needed(part, many) for part in open_) if kind == UNDECIDED else None,
    )


def _numbers(parts: Sequence[Judged]) -> dict[tuple[str, str], list[Judged]]:
    """Parts by statement and number; a part without number stands for itself."""
    numbers: dict[tuple[str, str], list[Judged]] = {}
    for i, part in enumerate(parts):
        numbers.setdefault((part.statement, part.number or f"#{i}"), []).append(part)
    return numbers


def _best(variants: Sequence[Judged], many: int) -> str:
    """The verdict on a number from those on its variants."""
    said = []
    for part in variants:
        one = verdict(part, many)
        if part.against_print and one in (CONFIRMED, IMMATERIAL):
            one = CONTRADICTORY
        if one != VOID:
            said.append(REFUTED if part.against_print and one == UNDECIDED else one)
    return min(said, key=BEST.index) if said else VOID


def _kind(numbers: Mapping[tuple[str, str], Sequence[Judged]], said: Mapping[tuple[str, str], str], many: int) -> str:
    sentences = []
    for sentence in dict.fromkeys(name for name, _ in numbers):
        own = {key: said[key] for key in numbers if key[0] == sentence and said[key] != VOID}
        safe = all(harmless(part, many) for key, one in own.items() if one == UNDECIDED for part in numbers[key])
        sentences.append(_sentence(list(own.values()), safe))
    return min(sentences, key=WORST.index) if sentences else UNJUDGEABLE


def _sentence(said: Sequence[str], safe: bool) -> str:
    """The verdict on a sentence: one material miss refutes it, immaterial ones neither refute nor confirm."""
    for bad in (REFUTED, CONTRADICTORY):
        if bad in said:
            return bad
    if UNDECIDED in said and not (safe and CONFIRMED in said):
        return UNDECIDED
    if CONFIRMED in said:
        return CONFIRMED
    return IMMATERIAL if said else UNJUDGEABLE


def most_needed(every: Iterable[int | None]) -> int | None:
    """The largest number of realisations; None where there is none, or one is None."""
    known = list(every)
    return None if not known or None in known else max(one for one in known if one is not None)


def roughly(n: float) -> int:
    """A number of realisations rounded for people: up to two digits, never fewer."""
    step = 10 ** max(len(str(math.ceil(n))) - 2, 0)
    return math.ceil(n / step) * step


def _joint(parts: Sequence[Judged], many: int) -> Outcome:
    by_variant: dict[str, list[str]] = {}
    by_number: dict[str, list[str]] = {}
    for part in parts:
        said = verdict(part, many)
        by_variant.setdefault(part.variant, []).append(said)
        by_number.setdefault(part.number, []).append(said)
    held = {name: sum(one in (CONFIRMED, IMMATERIAL) for one in said) for name, said in by_variant.items()}
    best = max(held, key=lambda name: held[name])
    if held[best] == len(by_number):
        kind = CONFIRMED
    elif any(UNDECIDED in said and REFUTED not in said for said in by_variant.values()):
        kind = UNDECIDED
    else:
        kind = CONTRADICTORY if all(CONFIRMED in said for said in by_number.values()) else REFUTED
    worst = max(miss(part) for part in parts if part.variant == best)
    return Outcome(kind, held[best], len(by_number) - held[best], len(by_number), worst)


# ---- over interpretations
# ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Interpretation:
    """A claim under one interpretation: its kind (E, U or N), its alternatives, and the class of the claim under it.

    outcome is empty where the interpretation is impossible to fly or design."""

    name: str
    kind: str
    choices: Mapping[str, str] = field(default_factory=dict)
    outcome: str = ""


def over_interpretations(own: Outcome, interpretations: Sequence[Interpretation]) -> Outcome:
    """The outcome of a claim from that of the default interpretation and those of all: only E and U count. Confirmed
    only if true in all of them, refuted only if false in all, else it depends on the choices. Some outcomes hold under
    every interpretation: a print that contradicts itself, a statement that cannot be judged."""
    counted = [one for one in interpretations if one.kind in (EQUIVALENT, UNSTATED) and one.outcome]
    if not counted:
        return own
    said = Counter(one.outcome for one in counted)
    holds = said[CONFIRMED]
    kind: str = own.kind
    on: tuple[str, ...] = ()
    if own.kind not in NO_READING_MENDS:
        if len(said) == 1:
            (kind,) = said
        elif set(said) == {CONFIRMED, IMMATERIAL}:
            kind = own.kind
        elif set(said) <= {CONFIRMED, IMMATERIAL, UNDECIDED} or set(said) == {REFUTED, UNDECIDED}:
            kind = UNDECIDED
        else:
            kind, on = DEPENDS, flips(counted)
    return replace(own, kind=kind, depends_on=on, holds_in=holds, interpretations=len(counted))


def flips(interpretations: Sequence[Interpretation]) -> tuple[str, ...]:
    """The choices that change the outcome, the strongest first, equal ones in their order.

    A choice is one of them if two interpretations that differ in it alone have different outcomes. Where no two
    interpretations differ in one choice alone: those by whose values the interpretations differ most in the share that
    holds; where none holds, in the share that is refuted."""
    asked = CONFIRMED if any(one.outcome == CONFIRMED for one in interpretations) else REFUTED
    choices = list(dict.fromkeys(key for one in interpretations for key in one.choices))
    found: Counter[str] = Counter()
    alone = False
    for choice in choices:
        for own in _alike_but(choice, choices, interpretations).values():
            held = [sum(one.outcome == asked for one in alike) for alike in own.values()]
            missed = [len(alike) - count for alike, count in zip(own.values(), held, strict=True)]
            found[choice] += sum(held) * sum(missed) - sum(a * b for a, b in zip(held, missed, strict=True))
            alone = alone or len(own) > 1
    if alone and +found:
        return tuple(name for name, _ in (+found).most_common())
    spread = {name: _spread(name, interpretations, asked) for name in choices}
    most = max(spread.values(), default=0.0)
    return tuple(name for name, one in spread.items() if one and math.isclose(one, most))


def _alike_but(
    choice: str, choices: Sequence[str], interpretations: Sequence[Interpretation]
) -> dict[tuple[str | None, ...], dict[str | None, list[Interpretation]]]:
    """Interpretations grouped by all their other choices, then by their alternative of this one."""
    found: dict[tuple[str | None, ...], dict[str | None, list[Interpretation]]] = {}
    for one in interpretations:
        rest = tuple(one.choices.get(key) for key in choices if key != choice)
        found.setdefault(rest, {}).setdefault(one.choices.get(choice), []).append(one)
    return found


def _spread(choice: str, interpretations: Sequence[Interpretation], asked: str) -> float:
    """Largest less least share of interpretations with this outcome, over the values of a choice."""
    shares: dict[str, list[bool]] = {}
    for one in interpretations:
        shares.setdefault(one.choices.get(choice, ""), []).append(one.outcome == asked)
    held = [sum(own) / len(own) for own in shares.values()]
    return max(held) - min(held)


# ---- reasons ---------------------------------------------------------------------------------------------------------
NUMBER = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
PLACE = re.compile(r"\{(\w+)\}")
WHOLE = (  # `changed` is made of differences, case by case
    term("not the paper's experiment: {changed}"),
    term("{case} ends at {end} s, the paper's run at {duration} s"),
    term("the run of RLS {number} ends at {end} s, before {asked} s"),
    term(
        "exact value and simulation differ by more than {errors} standard errors: exact {exact}, simulated {simulated} "
        "[{lo}, {hi}]"
    ),
    term("its measure fails: {error}"),
    term("no filter {name}; there are {names}"),
    term("no component {name}; there are {names}"),
    term("filter {name} is the baseline: it has no gain"),
)
DIFFERENCES = (
    term("{missing} of the paper's {count} {key} changed or missing"),
    term("{key} differs from the paper's"),
    term("{key} is {own}, the paper's {printed}"),
)
AND_MORE = term("and {count} more")
SAID_WHOLE = (
    *(term("no such experiment is shipped"), term("a required case is missing"), term("there is no gain")),
    *(term("there is nothing to measure it with"), term("no such scans"), term("not known exactly")),
    *(term("no Kalman filter with manoeuvre variance"), term("gains against growing memory")),
    *(term("the run ends before the manoeuvre does"),),
    term("(15) has no root: with the phase in it, its left side exceeds c at every length"),
)


def said(why: object) -> str:
    """A reason in the current language; an unknown one unchanged."""
    text = str(why)
    for message in WHOLE:
        found = _pattern(message).fullmatch(text)
        if found:
            places = _said(found)
            return tr(message, **places | {"changed": "; ".join(_by_case(places.get("changed", "")))})
    return tr(text)


def _by_case(changed: str) -> Iterator[str]:
    """Differences by case: `rls2: radar.sigma_range_m is 30, the paper's 25; and 2 more`."""
    for part in changed.split("; "):
        case, _, differences = part.rpartition(": ")
        found = _pattern(AND_MORE).fullmatch(part)
        if found:
            yield tr(AND_MORE, **_said(found))
        else:
            yield (f"{case}: " if case else "") + ", ".join(map(_difference, _apart(differences)))


def _apart(differences: str) -> list[str]:
    """A list of differences split; the second half of one begins with a comma as well."""
    return re.split(r", (?!the paper's )(?=\S+ is |\d+ of the paper's |\S+ differs from )", differences)


def _difference(text: str) -> str:
    for message in DIFFERENCES:
        found = _pattern(message).fullmatch(text.removesuffix(" …"))
        if found:
            return tr(message, **_said(found)) + (" …" if text.endswith(" …") else "")
    return tr(text)


def _said(found: re.Match[str]) -> dict[str, str]:
    """The values in the placeholders, numbers as the language writes them."""
    return {name: numeral(text) if NUMBER.fullmatch(text) else text for name, text in found.groupdict().items()}


def _pattern(message: str) -> re.Pattern[str]:
    """The pattern of a message with its placeholders filled."""
    parts = PLACE.split(message)
    return re.compile("".join(f"(?P<{one}>.+?)" if i % 2 else re.escape(one) for i, one in enumerate(parts)))


# ---- ranges ----------------------------------------------------------------------------------------------------------
class Range(NamedTuple):
    """The range of the words, ends included, the words, their margin, and the kind of rule that gives it.

    strict is the range of the rule of version 0.1, for `old_verdict`."""

    lo: float
    hi: float
    words: str
    margin: float
    kind: str
    strict: tuple[float, float]


def digit(text: str) -> float:
    """The unit of a printed number's last digit."""
    return 10.0 ** -len(text.partition(".")[2])


def printed(text: str, step: float | None = None) -> Range:
    """A printed number; step: its resolution where numbers are read off a graph. Default: its last digit."""
    return _inclusive(text, text, text, step, PRINT)


def between(low: str, high: str, step: float | None = None) -> Range:
    """A printed range, both its ends as `printed`."""
    return _inclusive(low, high, f"{low} to {high}", step, PRINT)


def _inclusive(low: str, high: str, words: str, step: float | None, kind: str) -> Range:
    half = max(digit(low), digit(high)) / 2
    margin = half if step is None else step / 2
    strict = (float(low) - digit(low) / 2, float(high) + digit(high) / 2)
    return Range(float(low), float(high), f"{words} ± {margin:g}", margin, kind, strict)


def about(low: str, high: str | None = None, margin: float | None = None, kind: str = ABOUT) -> Range:
    """A positive number or range with "about"; margin where the paper or its grid is coarser than 10 %."""
    high = high or low
    words = f"about {low}" + (f" to {high}" if high != low else "")
    wide = 0.1 * float(high) if margin is None else margin
    strict = (0.9 * float(low), 1.1 * float(high))
    return Range(float(low), float(high), f"{words} ± {wide:g}", wide, kind, strict)


def _half_digit(value: float) -> float:
    return digit(f"{value:.12f}".rstrip("0").rstrip(".")) / 2


def above(value: float, margin: float | None = None) -> Range:
    """More than a value. Over zero: better, a difference of at least the margin, by default 1 %."""
    kind, wide = _one_sided(value, margin)
    return Range(math.nextafter(value, math.inf), math.inf, f"> {value:g}", wide, kind, (value, math.inf))


def below(value: float, margin: float | None = None) -> Range:
    """Less than a value. Under zero: better, as in `above`."""
    kind, wide = _one_sided(value, margin)
    return Range(-math.inf, math.nextafter(value, -math.inf), f"< {value:g}", wide, kind, (-math.inf, value))


def _one_sided(value: float, margin: float | None) -> tuple[str, float]:
    if value == 0:
        return MATERIAL, 1.0 if margin is None else margin
    return LIMIT, _half_digit(value) if margin is None else margin


def at_most(value: float, margin: float | None = None) -> Range:
    """No more than a value."""
    wide = _half_digit(value) if margin is None else margin
    return Range(-math.inf, value, f"≤ {value:g}", wide, LIMIT, (-math.inf, value))


def at_least(value: float, margin: float | None = None) -> Range:
    """No less than a value."""
    wide = _half_digit(value) if margin is None else margin
    return Range(value, math.inf, f"≥ {value:g}", wide, LIMIT, (value, math.inf))


def greater(margin: float = 0.01) -> Range:
    """A ratio of two σ over one: the first is the worse."""
    return above(1.0, margin)._replace(kind=MATERIAL)


def less(margin: float = 0.01) -> Range:
    """A ratio of two σ under one: the first is the better."""
    return below(1.0, margin)._replace(kind=MATERIAL)


def within(low: float, high: float, margin: float = 0.5) -> Range:
    """From low to high as they stand: counts of scans (half a scan is their margin), shares."""
    words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return Range(low, high, words, margin, PRINT, (low, high))


def same(value: float = 0.0, margin: float = 1.0, strict: float | None = None) -> Range:
    """Coincidence: a value to within a margin, by default 1 % of σ."""
    old = margin if strict is None else strict
    return Range(value, value, f"{value:g} ± {margin:g}", margin, SAME, (value - old, value + old))


def kept(margin: float = 1.0, strict: float = 0.5) -> Range:
    """No loss, in % of σ: a gain, or a loss within the margin."""
    return Range(0.0, math.inf, f"≥ 0 ± {margin:g}", margin, SAME, (-strict, math.inf))


def on_grid(low: float, high: float, step: float, strict: tuple[float, float]) -> Range:
    """A time, or a ratio of times, no finer than the grid on which it is read."""
    words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return Range(low, high, f"{words} ± {step:g}", step, GRID, strict)
