"""The page of a paper's readings: open choices, claims over all readings, printed numbers by reading."""

import math
import re
from collections.abc import Sequence

import numpy as np

from radarsim.language import Term, current, numeral, plural, term, tr
from radarsim.report.claims.over import Choice, Joint, Key, Over, PaperReadings, Search, Together
from radarsim.report.claims.page import expected, plain, words
from radarsim.report.claims.rule import said

PAPERS = "ru"  # the language of the quoted papers
SHOWN = 12  # readings of the table of claims by reading
EVERY, NOWHERE, BUT = term("all"), term("none"), "all but "
RANGES = re.compile(r"[\d.,e… +-]+")
PRINTED = (term("claim"), term("number"), term("printed"))  # columns
KINDS = term("E: equivalent in every respect; U: the paper does not say; N: against its print.")
COUNTED = term(
    "The count covers the numbers, limits and comparisons that the claims of this page assert, each "
    "once. A number matches the print if its exact value, or its 95 % interval (joint over the "
    "claim), lies in the range that rounds to the print. It is within margins if it lies in the "
    "margin of the words, and undecided if the interval is too wide. Below: bold, matches the print; "
    "plain, within margins; –, beyond them; ?, undecided."
)
INTRODUCTION = term(
    "Written by `radarsim readings {paper} --markdown`; every number by reading is in "
    "`results/readings/readings.csv`, beside a specification curve for each claim. The rule: [how a "
    "claim is judged](verdicts.md)."
)


def page(of: PaperReadings, cited: str, over: Sequence[Over], counted: Search | Joint) -> str:
    """The page as Markdown; counted: the result of the paper's joint search."""
    parts = [tr("# {paper} by reading", paper=of.paper), f"{tr(cited)}. {tr(INTRODUCTION, paper=of.paper)}"]
    parts += [f"**{counted.sentence()}**"]
    parts += [tr("## Claims over all readings"), _claims(over)]
    changed = _changed(over)
    if changed:
        words = tr("What would have to change: readings against the print that give a claim another verdict.")
        parts += [words, changed]
    impossible = _impossible(over)
    if impossible:
        parts += [tr("Readings that cannot be flown, designed or measured:"), impossible]
    if isinstance(counted, Joint):
        numbers, windows = f"{_best(counted)}\n\n{_printed(counted)}", _alternatives(counted)
    else:
        numbers, windows = _numbers(counted), _windows(counted)
    parts += [tr("## Printed numbers by reading"), numbers, tr("## Where each number matches"), windows]
    parts += [*left_open(of)]
    return "\n\n".join(parts) + "\n"


def left_open(of: PaperReadings) -> list[str]:
    """The open choices of the paper, each with its alternatives and their reasons: paragraphs of Markdown."""
    return [tr("## What the paper leaves open"), tr(KINDS), *map(_choice, of.choices)]


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; terms among the columns are translated."""
    lines = [
        "| " + " | ".join(tr(one) if isinstance(one, Term) else one for one in columns) + " |",
        "|" + "---|" * len(columns),
    ]
    return "\n".join(lines + ["| " + " | ".join(_cell(one) for one in row) + " |" for row in rows])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _claims(over: Sequence[Over]) -> str:
    rows = []
    for one in over:
        found = one.outcome
        holds = tr("{count} of {of}", count=found.holds_in or 0, of=found.readings or 0) if found else ""
        said = words(found.kind, found.kind, one.of.asked(found.depends_on), tr) if found else tr("not judged")
        verdict = "; ".join(filter(None, (said, one.still_open())))
        rows.append((one.claim.id, tr(one.claim.statement), verdict, holds))
    return table((term("claim"), term("statement"), term("verdict"), term("holds in")), rows)


def _changed(over: Sequence[Over]) -> str:
    rows = [
        (one.claim.id, one.of.said(reading.reading), tr(reading.outcome.kind))
        for one in over
        for reading in one.against_print
        if reading.outcome is not None
    ]
    return table((term("claim"), term("reading"), term("matches")), rows) if rows else ""


def _impossible(over: Sequence[Over]) -> str:
    reasons: dict[tuple[str, str], list[str]] = {}
    for one in over:
        for reading in one.impossible:
            reasons.setdefault((one.claim.id, reading.why), []).append(one.of.said(reading.reading))
    rows = [(claim, str(len(names)), names[0], said(why)) for (claim, why), names in reasons.items()]
    return table((term("claim"), term("readings"), term("such as"), term("why not")), rows) if rows else ""


def _best(of: Joint) -> str:
    """The readings with most numbers, and the shipped one."""
    best = of.every[:SHOWN]
    rows = [
        (
            *(one.name, one.kind, tr("{count} of {of}", count=one.count(False), of=len(one.outcomes))),
            *(str(one.count(True)), str(one.open)),
            *(tr("{count} of {of}", count=len(one.held), of=len(one.judged)), ", ".join(one.held)),
        )
        for one in [*best, *([] if of.shipped in best else [of.shipped])]
    ]
    columns = (
        *(term("reading"), term("kind"), term("to the print"), term("within margins"), term("undecided")),
        *(term("claims that hold"), term("which")),
    )
    return f"{tr(COUNTED)}\n\n{table(columns, rows)}"


def _printed(of: Joint) -> str:
    """Every number under the shipped reading and the best ones."""
    places = {
        term("as shipped"): of.shipped,
        term("most to the print"): of.best(False),
        term("most within margins"): of.best(True),
    }
    places = {name: one for i, (name, one) in enumerate(places.items()) if one not in list(places.values())[:i]}
    rows = []
    for key, number in of.numbers.items():
        printed = expected(number.words, number.unit)
        rows.append((number.claim, tr(number.what), printed, *(_came(one, key) for one in places.values())))
    words = [f"*{tr(name)}*: {one.name}." for name, one in places.items() if one != of.shipped]
    return "\n\n".join([table((*PRINTED, *places), rows), *words])


def _came(of: Together, key: Key) -> str:
    if key not in of.outcomes:
        return tr("not judged")
    outcomes = of.outcomes[key]
    text = plain(outcomes.value) if math.isfinite(outcomes.value) else tr("none")
    if outcomes.strict:
        return f"**{text}**"
    return text if outcomes.granular else f"{text} ?" if outcomes.open else f"{text} –"


def _alternatives(of: Joint) -> str:
    """Choices as columns, those that change anything; numbers reproduced everywhere, or nowhere, are left out."""
    windows = {choice.key: of.windows(choice.key) for choice in of.of.choices}
    kept = {key: own for key, own in windows.items() if set(own.values()) - {"all", "none"}}
    rows = [
        (number.claim, tr(number.what), *(_listed(own[key]) for own in kept.values()))
        for key, number in of.numbers.items()
        if any(own[key] not in ("all", "none") for own in kept.values())
    ]
    words = tr("Values of one choice, all others as shipped, for which a number matches the print.")
    return f"{words}\n\n{table((*PRINTED[:2], *map(tr, map(of.of.asks.__getitem__, kept))), rows)}"


def _numbers(search: Search) -> str:
    best = {rule: search.best(rule) for rule in (False, True)}
    places = {
        term("as shipped"): search.place,
        term("most to the digit"): best[False],
        term("most to the print's steps"): best[True],
    }
    places = {name: place for i, (name, place) in enumerate(places.items()) if place not in list(places.values())[:i]}
    rows = []
    for number, one in enumerate(search.printed):
        cells = [_value(search, number, place) for place in places.values()]
        rows.append((one.claim, tr(one.what), expected(one.printed, one.unit), *cells))
    for rule, name in ((False, tr("match to the digit")), (True, tr("match to the print's steps"))):
        counts = [str(int(search.count(rule)[place])) for place in places.values()]
        rows.append(("", name, str(len(search.printed)), *counts))
    words = [f"*{tr(name)}*: {search.words(place)}." for name, place in places.items() if place != search.place]
    return "\n\n".join([*([tr(search.read_as)] if search.read_as else []), table((*PRINTED, *places), rows), *words])


def _value(search: Search, number: int, place: tuple[int, ...]) -> str:
    value = float(search.measured(place)[number])
    text = numeral(f"{value:.6g}") if math.isfinite(value) else tr("none")
    return f"**{text}**" if search.strict[(number, *place)] else text


def _windows(search: Search) -> str:
    """Choices as columns, those that change anything; numbers reproduced everywhere are left out."""
    windows = {key: search.windows(key) for key in search.axes}
    kept = {key: own for key, own in windows.items() if len(set(own) - {"all", "none"}) or len(set(own)) > 1}
    rows = [
        (
            one.claim,
            f"{tr(one.what)}: {expected(one.printed, one.unit)}",
            *(_listed(own[number]) for own in kept.values()),
        )
        for number, one in enumerate(search.printed)
        if any(own[number] != "all" for own in kept.values())
    ]
    words = tr("Values of one choice, all others as shipped, for which a number matches to the printed digit.")
    never = int(np.sum(~search.strict.reshape(len(search.printed), -1).any(axis=1)))
    if never:
        words += plural(" {count} matches under no combination.", " {count} match under no combination.", never)
    return f"{words}\n\n{table((*PRINTED[:2], *(tr(search.asks.get(key, key)) for key in kept)), rows)}"


def _listed(window: str) -> str:
    """Alternatives or ranges of numbers, translated; the names of alternatives are those typed by the user."""
    if window in (EVERY, NOWHERE):
        return tr(window)
    if window.startswith(BUT):
        return tr("all but {names}", names=window.removeprefix(BUT))
    return numeral(window) if RANGES.fullmatch(window) else window


def _choice(choice: Choice) -> str:
    rows = [(one.name, one.kind, tr(one.reason)) for one in choice.alternatives]
    quoted = (
        choice.original
        if current() == PAPERS or choice.original == choice.english
        else f"{choice.original}\n>\n> {choice.english}"
    )
    return "\n\n".join(
        [
            f"### `{choice.key}`: {tr(choice.asks)}",
            *([tr("Affects {claims}.", claims=", ".join(choice.claims))] if choice.claims else []),
            f"> {quoted}",
            table((term("value"), term("kind"), term("why")), rows),
        ]
    )
