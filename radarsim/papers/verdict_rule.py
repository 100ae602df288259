"""The rule by which one part of a claim is judged: numbers in, a verdict out. Written before anything was measured.

docs/verdicts.md gives it in words. A judged part holds the measured value, the exact value where known, the range that
the paper's words allow, and the margin of these words."""

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

CONFIRMED, REFUTED, IMMATERIAL = "confirmed", "refuted", "no material difference"
CONTRADICTORY, UNJUDGEABLE = "the print contradicts itself", "not judgeable as stated"
UNDECIDED, DEPENDS = "not yet decided", "depends on"
VOID = "void"  # of a part: the truth itself would fail it
CLASSES = (CONFIRMED, REFUTED, DEPENDS, IMMATERIAL, CONTRADICTORY, UNJUDGEABLE, UNDECIDED)
FIXED_CLASSES = (CONTRADICTORY, UNJUDGEABLE)
# Kinds of margin. Of the first five the margin belongs to the words: a value within it is what the paper says.
PRINT, ABOUT, GRID, SAME = "print", "about", "grid", "same"
SAMPLE = "sample"  # a printed result of simulated runs, which has a sampling error of its own
LIMIT = "limit"  # "more than 50 %": just outside, within the margin, is no material difference
MATERIAL = "material"  # "better": within the margin of equality, on either side, is no material difference
INCLUSIVE_MARGINS = (PRINT, ABOUT, GRID, SAME, SAMPLE)
EQUIVALENT, UNSTATED, AGAINST = "E", "U", "N"  # kinds of interpretations; the last contradicts the print
Z95 = NormalDist().inv_cdf(0.975)
ROUNDING = 1e-12  # of a margin
# A verdict is the same however its number of realisations came about: by one run, by `--decide`, or by a person who
# extends undecided runs. So each counts as one of all looks that may be taken, one for each doubling: at fewer than
# 2000 realisations, at 2000·2^m, and at the most that a run may have, 10¹². `report.precision.look_counts` makes them.
MAX_LOOKS = 31


@dataclass(frozen=True)
class JudgedPart:
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
    def is_known_exactly(self) -> bool:
        """Whether the exact value is known; it then decides."""
        return not math.isnan(self.exact)

    @property
    def value(self) -> float:
        """The judged value: the exact one, or the measured one."""
        return self.exact if self.is_known_exactly else self.measured

    @property
    def has_number(self) -> bool:
        """Whether there is a value to judge; of a measure that gives NaN there is none."""
        return not math.isnan(self.value)

    @property
    def is_void(self) -> bool:
        """Whether a perfect estimator would fail: then the part tests nothing."""
        return not math.isnan(self.ceiling) and _miss_of_value(self.ceiling, self) > 1

    @property
    def is_sampled(self) -> bool:
        """Whether it has a sampling error."""
        return not self.is_known_exactly and self.lo != self.hi


def widen(lo: float, value: float, hi: float, factor: float) -> tuple[float, float]:
    """An interval with its two half-widths times a factor."""
    return value - factor * (value - lo), value + factor * (hi - value)


def widening_factor(parts: int) -> float:
    """Factor on half-widths so that as many intervals hold at once, at all `MAX_LOOKS` looks, in 95 % of runs.

    One factor at every look (Pocock, Biometrika 64, 1977, 191-199), by the union bound over looks and parts: whatever
    their correlation, at most 5 % of runs err. For one part the exact recursion over looks gives 4.0 %; a factor for
    exactly 5 % would save 4 % of the realisations."""
    return NormalDist().inv_cdf(1 - 0.025 / MAX_LOOKS / max(parts, 1)) / Z95


def judged_interval(part: JudgedPart, parts: int = 1) -> tuple[float, float]:
    """The judged interval: the exact value twice, or the 95 % interval widened for so many parts."""
    if part.is_known_exactly:
        return part.exact, part.exact
    if part.lo == part.hi:
        return part.lo, part.hi
    if not (math.isfinite(part.measured) and math.isfinite(part.lo) and math.isfinite(part.hi)):
        return part.lo, part.hi
    return widen(part.lo, part.measured, part.hi, widening_factor(parts))


def miss_in_margins(part: JudgedPart) -> float:
    """How far the value lies outside the words, in margins; 0 inside."""
    return _miss_of_value(part.value, part)


def _miss_of_value(value: float, part: JudgedPart) -> float:
    outside = max(part.expected_lo - value, value - part.expected_hi, 0.0)
    return outside / part.margin if outside > ROUNDING * part.margin else 0.0


def part_verdict(part: JudgedPart, parts: int = 1) -> str:
    """The verdict on one part of a claim that has so many parts with a sampling error."""
    lo, hi = judged_interval(part, parts)
    if part.is_void:
        return VOID
    if not lo <= hi:
        return UNDECIDED
    low, high = part.expected_lo - part.margin, part.expected_hi + part.margin
    if hi < low or lo > high:
        return REFUTED
    if part.kind == MATERIAL and _is_near_equality(lo, hi, part):
        return IMMATERIAL
    if part.expected_lo <= lo and hi <= part.expected_hi:
        return CONFIRMED
    if low <= lo and hi <= high:
        if part.kind in INCLUSIVE_MARGINS:
            return CONFIRMED
        if part.kind == LIMIT:
            return IMMATERIAL
    return UNDECIDED


def _is_near_equality(lo: float, hi: float, part: JudgedPart) -> bool:
    """Whether an interval lies within the margin of an end of the range, on either side."""
    equal = (end for end in (part.expected_lo, part.expected_hi) if math.isfinite(end))
    return any(end - part.margin <= lo and hi <= end + part.margin for end in equal)


def is_within_margins(part: JudgedPart, parts: int = 1) -> bool:
    """Whether an undecided part can at worst become no material difference."""
    lo, hi = judged_interval(part, parts)
    return part.expected_lo - part.margin <= lo and hi <= part.expected_hi + part.margin


def needed_realisations(part: JudgedPart, parts: int = 1) -> int | None:
    """How many realisations would likely decide a part: the interval shrinks with 1/√n about the measured value.

    0 where it is decided; None where the value lies on a border, or its interval is unknown."""
    if part_verdict(part, parts) != UNDECIDED:
        return 0
    lo, hi = judged_interval(part, parts)
    if part.is_known_exactly or not part.n or not (math.isfinite(lo) and math.isfinite(hi) and lo < hi):
        return None
    numbers = [
        number
        for number in (_realisations_clear_of(part, parts, border) for border in _verdict_borders(part))
        if number is not None
    ]
    return min(numbers, default=None)


def _verdict_borders(part: JudgedPart) -> list[float]:
    """The values at which verdicts change."""
    offsets = (-part.margin, part.margin) if part.kind == MATERIAL else (0.0,)
    outer = (part.expected_lo - part.margin, part.expected_hi + part.margin)
    inner = [end + offset for end in (part.expected_lo, part.expected_hi) for offset in offsets]
    return sorted(
        {border for border in (*outer, *(() if part.kind in INCLUSIVE_MARGINS else inner)) if math.isfinite(border)}
    )


def _realisations_clear_of(part: JudgedPart, parts: int, border: float) -> int | None:
    """Realisations at which the interval no longer reaches a border, if no other one is reached then either."""
    lo, hi = judged_interval(part, parts)
    gap = abs(part.measured - border)
    half = part.measured - lo if border < part.measured else hi - part.measured
    if not 0 < gap < half:
        return None
    share = gap / half * (1 - 1e-9)
    low, high = widen(part.lo, part.measured, part.hi, share)
    decided = part_verdict(replace(part, lo=low, hi=high), parts) != UNDECIDED
    return math.ceil(part.n / share**2) if decided else None
