"""Rows of claims.csv for people: counts by class, verdicts in sentences, values with units and intervals."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from radarsim.language.numerals import numeral
from radarsim.language.translate import plural, term, tr
from radarsim.papers.claim_outcome import round_up
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN
from radarsim.papers.reasons import translate_reason
from radarsim.papers.verdict_classes import verdict_words
from radarsim.papers.verdict_rule import (
    CLASSES,
    CONFIRMED,
    CONTRADICTORY,
    DEPENDS,
    REFUTED,
    UNDECIDED,
    UNJUDGEABLE,
    VOID,
)
from radarsim.report.wording import interval

BOLD_CLASSES = (CONFIRMED, REFUTED)  # in bold
EXTENSION_ENDING = ", extension"  # of the class of claims that are ours, apart from the paper's
CLASS_ORDER = (*CLASSES, NOT_JUDGED, NOT_RUN)
NOT_COUNTED = term("extension, not counted")  # a claim, or a part of one, that is not the paper's own


def claim_ranges(claims: Sequence[str]) -> str:
    """Names of claims, consecutive numbers as a range: `P1.1–P1.34`."""
    runs: list[list[str]] = []
    for name in claims:
        paper, _, end = name.rpartition(".")
        follows = runs and end.isdecimal() and runs[-1][-1] == f"{paper}.{int(end) - 1}"
        runs[-1].append(name) if follows else runs.append([name])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def class_text(kind: str) -> str:
    """A class in words, also one of extensions."""
    own_class = kind.removesuffix(EXTENSION_ENDING)
    return tr(own_class) if own_class == kind else tr("{kind} (extension)", kind=tr(own_class))


def class_count(kind: str, count: int) -> str:
    """The number of claims of a class, in words, also of one of extensions."""
    own_class = kind.removesuffix(EXTENSION_ENDING)
    if own_class != kind:
        return tr("{kind} (extension)", kind=class_count(own_class, count))
    if kind == DEPENDS:
        return plural(
            "{count} depends on what the paper leaves open", "{count} depend on what the paper leaves open", count
        )
    if kind == CONTRADICTORY:
        return tr("{count} where the print contradicts itself", count=count)
    return tr("{count} {kind}", count=count, kind=term(kind))


def count_classes(rows: Sequence[Mapping]) -> tuple[dict[str, int], int]:
    """How many claims are in each class, in the order of the rule, and how many extensions there are besides."""
    counts: Counter[str] = Counter()
    extensions = 0
    for parts in group_by_claim(rows):
        if is_extension(parts):
            extensions += 1
        else:
            counts[parts[0]["class"]] += 1
    return {kind: counts[kind] for kind in CLASS_ORDER if counts[kind]}, extensions


def group_by_claim(rows: Sequence[Mapping]) -> list[list[Mapping]]:
    """The rows of each claim."""
    groups: dict[tuple[str, str], list[Mapping]] = {}
    for row in rows:
        groups.setdefault((row["paper"], row["claim"]), []).append(row)
    return list(groups.values())


def is_extension(parts: Sequence[Mapping]) -> bool:
    """Whether nothing of a claim is the paper's own: ours, or reported from others."""
    return all(str(part["extension"]).lower() == "true" for part in parts)


def classes_in_words(rows: Sequence[Mapping]) -> str:
    """How many claims are in which class, in words."""
    classes, extensions = count_classes(rows)
    counts = ", ".join(class_count(kind, count) for kind, count in classes.items())
    extension_count = (
        plural("{count} extension not counted", "{count} extensions not counted", extensions) if extensions else ""
    )
    return "; ".join(filter(None, (counts, extension_count)))


def verdict_sentence(parts: Sequence[Mapping]) -> str:
    """The verdict on a claim, with the interpretations under which it is true, and what would decide an undecided
    one."""
    first, notes = parts[0], []
    text = verdict_words(first)
    if first["overall"] in BOLD_CLASSES:
        text = f"**{text}**"
    needed = cell_number(first["needed"])
    if UNDECIDED in (first["class"], first["as_shipped"]) and needed is not None:
        notes.append(tr("{needed} realisations would decide", needed=numeral(str(round_up(needed)))))
    if interpretations := cell_number(first["of"]):
        holds = cell_number(first["holds"])
        notes.append(
            tr("true under all {of:.0f} interpretations", of=interpretations)
            if holds == interpretations
            else tr("true under {holds:.0f} of {of:.0f} interpretations", holds=holds, of=interpretations)
        )
    if first["class"] in (UNJUDGEABLE, NOT_JUDGED) and first["reason"]:
        notes.append(translate_reason(first["reason"]))
    if is_extension(parts):
        notes.append(tr(NOT_COUNTED))
    return f"{text} ({'; '.join(notes)})" if notes else text


def cell_number(value: Any) -> float | None:
    """A number of a row, None where it has none."""
    if value in ("", None):
        return None
    return None if math.isnan(float(value)) else float(value)


def worst_part(parts: Sequence[Mapping]) -> Mapping | None:
    """The part furthest from its words, of variants of a number the nearest; None where none was measured."""
    counted = is_extension(parts)
    best: dict[str, Mapping] = {}
    for i, row in enumerate(parts):
        ours = is_extension([row]) and not counted
        if cell_number(row["measured"]) is None or row["verdict"] == VOID or ours:
            continue
        key = str(row["variants_of"]) or f"#{i}"
        if key not in best or row_distance(_decisive_value(row), row) < row_distance(
            _decisive_value(best[key]), best[key]
        ):
            best[key] = row
    return max(best.values(), key=lambda row: row_distance(_decisive_value(row), row), default=None)


def row_distance(value: float, row: Mapping) -> float:
    """Distance of a value from the words, in margins: 0 at an end of the range, negative inside."""
    lo, hi = cell_number(row["expected_lo"]), cell_number(row["expected_hi"])
    below = -math.inf if lo is None else lo - value
    above = -math.inf if hi is None else value - hi
    return max(below, above) / (cell_number(row["margin"]) or 1.0)


def _decisive_value(row: Mapping) -> float:
    exact = cell_number(row["exact"])
    return float(row["measured"]) if exact is None else exact


def part_name(row: Mapping, parts: Sequence[Mapping]) -> str:
    """Description of a part, with its case where another part has the same words."""
    alike = sum(part["quantity"] == row["quantity"] for part in parts)
    return row["quantity"] if alike == 1 else f"`{row['case']}`: {row['quantity']}"


def decisive_value_words(row: Mapping) -> str:
    """The value that decides a part: the exact one where known, else the measured one with its interval."""
    exact = cell_number(row["exact"])
    if cell_number(row["measured"]) is None:
        return "–"
    if exact is None:
        return measured_words(row)
    return tr("{value} (exact)", value=f"{four_digits(exact)} {unit_after(exact, row['unit'])}".rstrip())


def unit_after(value: float, unit: str) -> str:
    """A unit after a number: a counted thing in its plural form, that of two after a fraction."""
    count = abs(int(value)) if value == value // 1 else 2
    if unit == "scans":
        return plural("scan", "scans", count)
    if unit == "plots":
        return plural("plot", "plots", count)
    if unit == "points":
        return plural("point", "points", count)
    return "" if unit == "1" else tr(unit)


def expected_words(words: str, unit: str = "") -> str:
    """The expected range, in the current language: `about 20 to 30 ± 10`; with the unit if given."""
    text = " ".join(tr(word) if word.isalpha() else numeral(word) for word in words.split())
    last = re.findall(r"\d[\d.]*", words)[-1:]
    return f"{text} {unit_after(float(last[0]), unit) if last else tr(unit)}".rstrip() if unit else text


EXPECTED_WORDS = (term("about"), term("to"), term("few"))  # the words in it


def four_digits(value: float) -> str:
    """A number at four digits."""
    return numeral(f"{value:.4g}").replace("inf", "∞")


def measured_words(row: Mapping) -> str:
    """Value and unit, with the interval where there is a sampling error, both to two figures of its half-width."""
    value, (lo, hi) = float(row["measured"]), shown_interval(row)
    half = (hi - lo) / 2
    if not 0 < half < math.inf:
        text = numeral(f"{value:.4g}").replace("inf", "∞")
    else:
        is_whole = all(number == round(number) for number in (value, lo, hi))
        digits = 0 if is_whole else max(0, 1 - math.floor(math.log10(half)))
        middle, low, high = (numeral(f"{round(number, digits) + 0.0:.{digits}f}") for number in (value, lo, hi))
        text = f"{middle} {interval(low, high)}"
    return f"{text} {unit_after(value, row['unit'])}".rstrip().replace("-", "\N{MINUS SIGN}")


def shown_interval(row: Mapping) -> tuple[float, float]:
    """The interval shown for a part: the judged one, or, if it is known exactly, its own 95 %."""
    names = ("judged_lo", "judged_hi") if cell_number(row["exact"]) is None else ("lo", "hi")
    lo, hi = (math.nan if row[name] == "" else float(row[name]) for name in names)
    return lo, hi
