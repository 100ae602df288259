"""The page of a paper's interpretations in Markdown: open choices, and claims over all interpretations."""

from collections.abc import Sequence

from radarsim.language import Term, current, term, tr
from radarsim.papers.interpretations import Choice, PaperInterpretations
from radarsim.papers.reasons import translate_reason
from radarsim.papers.verdict_classes import class_words
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts

QUOTATION_LANGUAGE = "ru"  # the language of the quoted papers
KINDS_EXPLAINED = term("E: equivalent in every respect; U: the paper does not say; N: against its print.")
INTRODUCTION = term(
    "Written by `radarsim interpretations {paper} --markdown`; every number by interpretation is in "
    "`results/interpretations/interpretations.csv`, beside a specification curve for each claim. The rule: [how a "
    "claim is judged](verdicts.md)."
)


def interpretations_page(of: PaperInterpretations, cited: str, over: Sequence[ClaimVerdicts]) -> str:
    """The page as Markdown."""
    parts = [tr("# {paper} by interpretation", paper=of.paper), f"{tr(cited)}. {tr(INTRODUCTION, paper=of.paper)}"]
    parts += [tr("## Claims over all interpretations"), _claims_table(over)]
    changed = _changed_verdicts(over)
    if changed:
        words = tr("What would have to change: interpretations against the print that give a claim another verdict.")
        parts += [words, changed]
    impossible = _impossible_interpretations(over)
    if impossible:
        parts += [tr("Interpretations that cannot be flown, designed or measured:"), impossible]
    parts += [*open_choices(of)]
    return "\n\n".join(parts) + "\n"


def open_choices(of: PaperInterpretations) -> list[str]:
    """The open choices of the paper, each with its alternatives and their reasons: paragraphs of Markdown."""
    return [tr("## What the paper leaves open"), tr(KINDS_EXPLAINED), *map(_choice_section, of.choices)]


def markdown_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; terms among the columns are translated."""
    lines = [
        "| " + " | ".join(tr(one) if isinstance(one, Term) else one for one in columns) + " |",
        "|" + "---|" * len(columns),
    ]
    return "\n".join(lines + ["| " + " | ".join(_cell(one) for one in row) + " |" for row in rows])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _claims_table(over: Sequence[ClaimVerdicts]) -> str:
    rows = []
    for one in over:
        found = one.outcome
        holds = tr("{count} of {of}", count=found.holds_in or 0, of=found.interpretations or 0) if found else ""
        said = class_words(found.kind, found.kind, one.of.asked(found.depends_on), tr) if found else tr("not judged")
        verdict = "; ".join(filter(None, (said, one.still_open())))
        rows.append((one.claim.id, tr(one.claim.statement), verdict, holds))
    return markdown_table((term("claim"), term("statement"), term("verdict"), term("holds in")), rows)


def _changed_verdicts(over: Sequence[ClaimVerdicts]) -> str:
    rows = [
        (one.claim.id, one.of.said(interpretation.interpretation), tr(interpretation.outcome.kind))
        for one in over
        for interpretation in one.against_print
        if interpretation.outcome is not None
    ]
    return markdown_table((term("claim"), term("interpretation"), term("matches")), rows) if rows else ""


def _impossible_interpretations(over: Sequence[ClaimVerdicts]) -> str:
    reasons: dict[tuple[str, str], list[str]] = {}
    for one in over:
        for interpretation in one.impossible:
            reasons.setdefault((one.claim.id, interpretation.why), []).append(
                one.of.said(interpretation.interpretation)
            )
    rows = [(claim, str(len(names)), names[0], translate_reason(why)) for (claim, why), names in reasons.items()]
    return (
        markdown_table((term("claim"), term("interpretations"), term("such as"), term("why not")), rows) if rows else ""
    )


def _choice_section(choice: Choice) -> str:
    rows = [(one.name, one.kind, tr(one.reason)) for one in choice.alternatives]
    quoted = (
        choice.original
        if current() == QUOTATION_LANGUAGE or choice.original == choice.english
        else f"{choice.original}\n>\n> {choice.english}"
    )
    return "\n\n".join(
        [
            f"### `{choice.key}`: {tr(choice.asks)}",
            *([tr("Affects {claims}.", claims=", ".join(choice.claims))] if choice.claims else []),
            f"> {quoted}",
            markdown_table((term("value"), term("kind"), term("why")), rows),
        ]
    )
