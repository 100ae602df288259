"""The page of a paper's readings: what it leaves open, its claims over all readings, its printed numbers by reading."""

import math
from collections.abc import Sequence

import numpy as np

from radarsim.report.claims.joint import Joint, Key, Together
from radarsim.report.claims.over import Over
from radarsim.report.claims.page import plain
from radarsim.report.claims.readings import PaperReadings
from radarsim.report.claims.search import Search

SHOWN = 12  # readings of the table of claims by reading
KINDS = "E: equivalent in every respect; U: the paper does not say; N: against its print."
COUNTED = (
    "Counted are the numbers, limits and comparisons that the claims of this page assert, each once. One comes out to "
    "the print where its 95 % interval, all of a claim's at once, or its exact value lies in the range that the print "
    "rounds to; within margins where it lies in the margin of the words; undecided where the interval is too wide to "
    "say. Below: bold to the print, plain within margins, – beyond them, ? undecided."
)
INTRODUCTION = (
    "Written by `radarsim readings {paper} --markdown`; every number by reading stands in "
    "`results/readings/readings.csv`, and beside it a specification curve a claim. The rule: "
    "[how a claim is judged](verdicts.md)."
)


def page(of: PaperReadings, cited: str, over: Sequence[Over], counted: Search | Joint) -> str:
    """The page as Markdown; counted is what the joint search of the paper came to."""
    parts = [f"# {of.paper} by reading", f"{cited}. {INTRODUCTION.format(paper=of.paper)}"]
    parts += [f"**{counted.sentence()}**"]
    parts += ["## Claims over all readings", _claims(over)]
    changed = _changed(over)
    if changed:
        words = "What would have to be changed: readings against the print under which a claim comes out otherwise."
        parts += [words, changed]
    impossible = _impossible(over)
    if impossible:
        parts += ["Readings that cannot be flown, designed or measured:", impossible]
    if isinstance(counted, Joint):
        numbers, windows = f"{_best(counted)}\n\n{_printed(counted)}", _alternatives(counted)
    else:
        numbers, windows = _numbers(counted), _windows(counted)
    parts += ["## Printed numbers by reading", numbers, "## Where each number comes out", windows]
    parts += ["## What the paper leaves open", KINDS, *(_choice(of, number) for number in range(len(of.choices)))]
    return "\n\n".join(parts) + "\n"


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join(lines + ["| " + " | ".join(_cell(one) for one in row) + " |" for row in rows])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _claims(over: Sequence[Over]) -> str:
    rows = []
    for one in over:
        found = one.outcome
        holds = f"{found.holds_in or 0} of {found.readings or 0}" if found else ""
        rows.append((one.claim.id, one.claim.statement, found.words if found else "not judged", holds))
    return _table(("claim", "statement", "verdict", "holds in"), rows)


def _changed(over: Sequence[Over]) -> str:
    rows = [
        (one.claim.id, reading.name, reading.outcome.kind)
        for one in over
        for reading in one.against_print
        if reading.outcome is not None
    ]
    return _table(("claim", "reading", "comes out"), rows) if rows else ""


def _impossible(over: Sequence[Over]) -> str:
    reasons: dict[tuple[str, str], list[str]] = {}
    for one in over:
        for reading in one.impossible:
            reasons.setdefault((one.claim.id, reading.why), []).append(reading.name)
    rows = [(claim, str(len(names)), names[0], why) for (claim, why), names in reasons.items()]
    return _table(("claim", "readings", "such as", "why not"), rows) if rows else ""


def _best(of: Joint) -> str:
    """The readings that give most numbers, and the shipped one."""
    best = of.every[:SHOWN]
    rows = [
        (
            *(one.name, one.kind, f"{one.count(False)} of {len(one.outcomes)}", str(one.count(True)), str(one.open)),
            *(f"{len(one.held)} of {len(one.judged)}", ", ".join(one.held)),
        )
        for one in [*best, *([] if of.shipped in best else [of.shipped])]
    ]
    columns = ("reading", "kind", "to the print", "within margins", "undecided", "claims that hold", "which")
    return f"{COUNTED}\n\n{_table(columns, rows)}"


def _printed(of: Joint) -> str:
    """Every number under the shipped reading and the best ones."""
    places = {"as shipped": of.shipped, "most to the print": of.best(False), "most within margins": of.best(True)}
    places = {name: one for i, (name, one) in enumerate(places.items()) if one not in list(places.values())[:i]}
    rows = []
    for key, number in of.numbers.items():
        printed = f"{number.words} {number.unit}".strip()
        rows.append((number.claim, number.what, printed, *(_came(one, key) for one in places.values())))
    words = [f"*{name}*: {one.name}." for name, one in places.items() if one != of.shipped]
    return "\n\n".join([_table(("claim", "number", "printed", *places), rows), *words])


def _came(of: Together, key: Key) -> str:
    if key not in of.outcomes:
        return "not judged"
    outcomes = of.outcomes[key]
    text = plain(outcomes.value) if math.isfinite(outcomes.value) else "none"
    if outcomes.strict:
        return f"**{text}**"
    return text if outcomes.granular else f"{text} ?" if outcomes.open else f"{text} –"


def _alternatives(of: Joint) -> str:
    """Choices as columns, those that change anything; what comes out everywhere, or nowhere, is left out."""
    windows = {choice.key: of.windows(choice.key) for choice in of.of.choices}
    kept = {key: own for key, own in windows.items() if set(own.values()) - {"all", "none"}}
    rows = [
        (number.claim, number.what, *(own[key] for own in kept.values()))
        for key, number in of.numbers.items()
        if any(own[key] not in ("all", "none") for own in kept.values())
    ]
    words = "Values of one choice, all others as shipped, with which a number comes out to the print."
    return f"{words}\n\n{_table(('claim', 'number', *kept), rows)}"


def _numbers(search: Search) -> str:
    best = {rule: search.best(rule) for rule in (False, True)}
    places = {"as shipped": search.place, "most to the digit": best[False], "most to the print's steps": best[True]}
    places = {name: place for i, (name, place) in enumerate(places.items()) if place not in list(places.values())[:i]}
    rows = []
    for number, one in enumerate(search.printed):
        cells = [_value(search, number, place) for place in places.values()]
        rows.append((one.claim, one.what, f"{one.printed} {one.unit}".strip(), *cells))
    for rule, name in ((False, "come out to the digit"), (True, "come out to the print's steps")):
        counts = [str(int(search.count(rule)[place])) for place in places.values()]
        rows.append(("", name, str(len(search.printed)), *counts))
    words = [f"*{name}*: {search.words(place)}." for name, place in places.items() if place != search.place]
    return "\n\n".join([_table(("claim", "number", "printed", *places), rows), *words])


def _value(search: Search, number: int, place: tuple[int, ...]) -> str:
    value = float(search.measured(place)[number])
    text = f"{value:.6g}" if math.isfinite(value) else "none"
    return f"**{text}**" if search.strict[(number, *place)] else text


def _windows(search: Search) -> str:
    """Choices as columns, those that change anything; what comes out everywhere is left out."""
    windows = {key: search.windows(key) for key in search.axes}
    kept = {key: own for key, own in windows.items() if len(set(own) - {"all", "none"}) or len(set(own)) > 1}
    rows = [
        (one.claim, f"{one.what}: {one.printed} {one.unit}".strip(), *(own[number] for own in kept.values()))
        for number, one in enumerate(search.printed)
        if any(own[number] != "all" for own in kept.values())
    ]
    words = "Values of one choice, all others as shipped, with which a number comes out to the printed digit."
    never = int(np.sum(~search.strict.reshape(len(search.printed), -1).any(axis=1)))
    if never:
        words += f" {never} come out under no combination."
    return f"{words}\n\n{_table(('claim', 'number', *kept), rows)}"


def _choice(of: PaperReadings, number: int) -> str:
    choice = of.choices[number]
    rows = [(one.name, one.kind, one.reason) for one in choice.alternatives]
    on = f" Bears on {', '.join(choice.claims)}." if choice.claims else ""
    return "\n\n".join(
        [
            f"### `{choice.key}`",
            f"{choice.asks}.{on}",
            f"> {choice.original}\n>\n> {choice.english}",
            _table(("value", "kind", "why"), rows),
        ]
    )
