"""The page of a paper's interpretations in Markdown: open choices, and claims over all interpretations."""

from collections.abc import Sequence

from radarsim.language.current import current_language
from radarsim.language.translate import Term, term, tr
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


def interpretations_page(interpretations: PaperInterpretations, cited: str, claims: Sequence[ClaimVerdicts]) -> str:
    """The page as Markdown."""
    parts = [
        tr("# {paper} by interpretation", paper=interpretations.paper),
        f"{tr(cited)}. {tr(INTRODUCTION, paper=interpretations.paper)}",
    ]
    parts += [tr("## Claims over all interpretations"), _claims_table(claims)]
    changed = _changed_verdicts(claims)
    if changed:
        words = tr("What would have to change: interpretations against the print that give a claim another verdict.")
        parts += [words, changed]
    impossible = _impossible_interpretations(claims)
    if impossible:
        parts += [tr("Interpretations that cannot be flown, designed or measured:"), impossible]
    parts += [*open_choices(interpretations)]
    return "\n\n".join(parts) + "\n"


def open_choices(interpretations: PaperInterpretations) -> list[str]:
    """The open choices of the paper, each with its alternatives and their reasons: paragraphs of Markdown."""
    return [tr("## What the paper leaves open"), tr(KINDS_EXPLAINED), *map(_choice_section, interpretations.choices)]


def markdown_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; terms among the columns are translated."""
    lines = [
        "| " + " | ".join(tr(cell) if isinstance(cell, Term) else cell for cell in columns) + " |",
        "|" + "---|" * len(columns),
    ]
    return "\n".join(lines + ["| " + " | ".join(_cell(cell) for cell in row) + " |" for row in rows])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _claims_table(claims: Sequence[ClaimVerdicts]) -> str:
    rows = []
    for claim in claims:
        outcome = claim.outcome
        holds = tr("{count} of {of}", count=outcome.holds_in or 0, of=outcome.interpretations or 0) if outcome else ""
        class_text = (
            class_words(outcome.kind, outcome.kind, claim.interpretations.list_choices(outcome.depends_on), tr)
            if outcome
            else tr("not judged")
        )
        verdict = "; ".join(filter(None, (class_text, claim.undecided_sentence())))
        rows.append((claim.claim.id, tr(claim.claim.statement), verdict, holds))
    return markdown_table((term("claim"), term("statement"), term("verdict"), term("holds in")), rows)


def _changed_verdicts(claims: Sequence[ClaimVerdicts]) -> str:
    rows = [
        (claim.claim.id, claim.interpretations.describe(verdict.interpretation), tr(verdict.outcome.kind))
        for claim in claims
        for verdict in claim.against_print
        if verdict.outcome is not None
    ]
    return markdown_table((term("claim"), term("interpretation"), term("matches")), rows) if rows else ""


def _impossible_interpretations(claims: Sequence[ClaimVerdicts]) -> str:
    reasons: dict[tuple[str, str], list[str]] = {}
    for claim in claims:
        for verdict in claim.impossible:
            reasons.setdefault((claim.claim.id, verdict.why), []).append(
                claim.interpretations.describe(verdict.interpretation)
            )
    rows = [(claim, str(len(names)), names[0], translate_reason(why)) for (claim, why), names in reasons.items()]
    return (
        markdown_table((term("claim"), term("interpretations"), term("such as"), term("why not")), rows) if rows else ""
    )


def _choice_section(choice: Choice) -> str:
    rows = [(alternative.name, alternative.kind, tr(alternative.reason)) for alternative in choice.alternatives]
    quoted = (
        choice.original
        if current_language() == QUOTATION_LANGUAGE or choice.original == choice.english
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
