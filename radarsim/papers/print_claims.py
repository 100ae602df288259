"""What the terminal shows of claims: verdicts of a run, lists of claims, and verdicts under every interpretation."""

import shlex
import shutil
import sys
from collections.abc import Collection, Mapping, Sequence
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from radarsim.api import configs, repeat_command
from radarsim.cli.console import PIPED_WIDTH, print_field, print_line
from radarsim.language.translate import join_names, plural, term, tr
from radarsim.papers.claim_rows import (
    NOT_COUNTED,
    cell_number,
    claim_ranges,
    class_count,
    class_text,
    classes_in_words,
    decisive_value_words,
    expected_words,
    group_by_claim,
    is_extension,
    measured_words,
    verdict_sentence,
)
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN
from radarsim.papers.reasons import translate_reason
from radarsim.papers.result_claims import claims_by_class, claims_judged_only_as_shipped, unjudged_claims
from radarsim.papers.verdict_classes import is_judged_only_as_shipped
from radarsim.papers.verdict_rule import DEPENDS

if TYPE_CHECKING:
    from radarsim.api.result import Result
    from radarsim.papers.interpretation_verdicts import InterpretationVerdicts
    from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts

Row = Mapping[str, Any]

MAX_STATEMENT_WORDS = 12  # of a claim in a list
MAX_NAMED_CONFIGS = 6  # that would judge claims; of more, one line says what runs them all
NOTHING_IS_RUN = term(
    "nothing is run here: `make reproduce-figures` runs all configs of the four papers; "
    "docs/claims.md, which `make docs` builds, has their results at full size"
)


def verdict_lines(result: "Result") -> list[tuple[str, str]]:
    """The claims of a run by their class over all interpretations, with those that differ as shipped."""
    shipped = configs.shipped(configs.shipped_stem(result.experiment)) or ()
    if any(case.user_filters for case in result.cases) and not any(case.user_filters for case in shipped):
        return []  # the paper's claims are none of a filter that a user has added
    by_class, as_shipped = claims_by_class(result), claims_by_class(result, "as_shipped")
    lines = []
    for kind, names in by_class.items():
        lines.append(("claims", f"{class_count(kind, len(names))}: {claim_ranges(names)}"))
        if differing := _shipped_classes_of(
            names,
            {shipped_kind: claim_names for shipped_kind, claim_names in as_shipped.items() if shipped_kind != kind},
        ):
            lines.append(("", tr("as shipped {claims}", claims=differing)))
    for reason, names in unjudged_claims(result).items():
        text = tr("not judged: {names}: {reason}", names=", ".join(names), reason=translate_reason(reason))
        lines.append(("", text))
    if names := claims_judged_only_as_shipped(result):
        text = tr(
            "only as shipped: {names}; `radarsim interpretations {paper}` judges under every one that the paper allows",
            names=claim_ranges(names),
            paper=names[0].partition(".")[0],
        )
        lines.append(("", text))
    if by_class and result.written is not None:
        command = repeat_command.command(result.experiment, (), result.written.folder.parent, verb="claims")
        lines.append(("", tr("`{command}` describes each of them", command=command)))
    return lines


def _shipped_classes_of(names: Sequence[str], as_shipped: Mapping[str, Sequence[str]]) -> str:
    """Which of these claims have which other class as shipped."""
    differing = {kind: [name for name in claims if name in names] for kind, claims in as_shipped.items()}
    return "; ".join(f"{class_text(kind)}: {claim_ranges(claims)}" for kind, claims in differing.items() if claims)


def print_claims(
    rows: Sequence[dict[str, Any]],
    detailed: Collection[str] = (),
    out: str = repeat_command.RESULTS,
    names: Sequence[str] = (),
) -> None:
    """Print a line for each claim: number, class, first words; for detailed ones all of it with measured values.

    The commands that are shown are for the directory `out` and for the requested names. For experiments other than the
    paper's, a line for each reason, with the claims that cannot be judged."""
    judged_rows = [row for row in rows if not _is_of_another_experiment(row)]
    claims = group_by_claim(judged_rows)
    width = max((len(_class_words(parts)) for parts in claims if parts[0]["claim"] not in detailed), default=0)
    room = (shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPED_WIDTH) - width - 9
    for parts in claims:
        if parts[0]["claim"] in detailed:
            _print_claim(parts)
        else:
            statement = shorten(_opening_words(parts[0]), room, placeholder=" …", break_on_hyphens=False)
            print_line(f"{parts[0]['claim']:<6} {_class_words(parts):<{width}}  {statement}")
    for (stem, why), claim_names in _claims_of_other_experiments(rows).items():
        values = {"stem": stem, "names": claim_ranges(claim_names), "reason": translate_reason(why)}
        print_line(tr("{stem}: not judged: {names}: {reason}", **values))
    missing = _claims_not_run(judged_rows)
    for stem, claim_names in missing.items():
        command = f"radarsim run {shlex.quote(stem)}{repeat_command.out_option(out)}"
        print_line(tr("`{command}` judges {names}", command=command, names=claim_ranges(claim_names)))
    bracketed = any(is_extension(parts) and parts[0]["claim"] not in detailed for parts in claims)
    print_line(
        (classes_in_words(judged_rows) or tr("this experiment judges no claims")) + bracketed * tr(" (in brackets)")
    )
    if len(missing) > MAX_NAMED_CONFIGS and all(row["class"] == NOT_RUN for row in judged_rows):
        print_line(tr(NOTHING_IS_RUN))
    elif any(row["class"] != NOT_RUN and row["claim"] not in detailed for row in judged_rows):
        _print_command_for_details(judged_rows[0]["claim"], names, out)


def _is_of_another_experiment(row: Row) -> bool:
    """Whether a claim cannot be judged because the experiment is not the paper's."""
    return bool(row["class"] == NOT_JUDGED and not row["quantity"])


def _claims_of_other_experiments(rows: Sequence[Row]) -> dict[tuple[str, str], list[str]]:
    """The claims that experiments other than the paper's cannot judge, by config and reason."""
    claims: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if _is_of_another_experiment(row):
            claims.setdefault((row["config"], row["reason"]), []).append(row["claim"])
    return claims


def _claims_not_run(rows: Sequence[Row]) -> dict[str, list[str]]:
    """The claims without stored results, by the config that would judge them."""
    claims: dict[str, dict[str, None]] = {}
    for row in rows:
        if row["class"] == NOT_RUN:
            claims.setdefault(str(row["config"]), {})[row["claim"]] = None
    return {stem: list(names) for stem, names in claims.items()}


def _print_command_for_details(claim: str, names: Sequence[str], out: str) -> None:
    if names:
        command = f"radarsim claims {shlex.join(names)} --parts{repeat_command.out_option(out)}"
        print_line(tr("`{command}` shows what was measured", command=command))
    else:
        command = f"radarsim claims {claim}{repeat_command.out_option(out)}"
        print_line(tr("`{command}` shows what was measured; --parts shows it for all of them", command=command))


def _opening_words(row: Row) -> str:
    words = tr(row["statement"]).split()
    return " ".join([*words[:MAX_STATEMENT_WORDS], *["…"] * (len(words) > MAX_STATEMENT_WORDS)])


def _class_words(parts: Sequence[Row]) -> str:
    """The class of a claim in a few words; in brackets if it is not counted."""
    kind = tr("depends") if parts[0]["class"] == DEPENDS else tr(parts[0]["class"])
    kind = tr("{own} as shipped", own=kind) if is_judged_only_as_shipped(parts[0]) else kind
    return f"({kind})" if is_extension(parts) else kind


def _print_claim(parts: Sequence[Row]) -> None:
    """Print a claim with its place, config, original sentence and a line for each part."""
    first = parts[0]
    verdict, place = verdict_sentence(parts).replace("*", ""), f"{tr(first['paper'])}, {tr(first['place'])}"
    print_line(f"{first['claim']:<6} {verdict}: {tr(first['statement'])} [{place}; {first['config']}]")
    if first["original"]:
        print_line(f"       «{first['original']}»")
    width = max(len(tr(row["verdict"])) for row in parts)
    for row in parts if first["class"] != NOT_RUN else ():
        print_line(f"       {tr(row['verdict']):<{width}}  {'; '.join(_part_words(row, parts))}")


def _part_words(row: Row, parts: Sequence[Row]) -> list[str]:
    """What a line says of a part: case and quantity, the value that decides, what was measured where that is exact,
    and why there is no verdict."""
    words = [": ".join(filter(None, (str(row["case"]), tr(str(row["quantity"])))))]
    if cell_number(row["measured"]) is not None:
        words.append(decisive_value_words(row) + tr("; expected {words}", words=expected_words(row["expected"])))
        measured = measured_words(row)
        if cell_number(row["exact"]) is not None and "[" in measured:  # with a sampling error
            words.append(tr("measured {value}", value=measured))
    if row["verdict"] == NOT_JUDGED:
        words.append(translate_reason(row["reason"]))
    if is_extension([row]) and not is_extension(parts):
        words.append(tr(NOT_COUNTED))
    return words


def print_interpretations(verdicts: "InterpretationVerdicts", detailed: bool) -> None:
    """Print a line for each claim, for single claims one for each interpretation too, and where the files are."""
    for claim in verdicts.claims:
        if detailed:
            _print_each_interpretation(claim)
        kind = tr(claim.outcome.kind) if claim.outcome else tr("not judged")  # the sentence says on what it depends
        print_line(f"{claim.claim.id:<6} {kind:<28} {claim.sentence()}")
    if verdicts.files:
        curves = sum(name.endswith(".svg") for name in verdicts.files)
        file = str(verdicts.folder / "interpretations.csv")
        curve_count = plural("{count} curve", "{count} curves", curves)
        print_field("table", tr("{file}, with {curves}", file=file, curves=curve_count) if curves else file)
    if verdicts.outdated:
        command = f"radarsim report {shlex.join(verdicts.outdated)}{repeat_command.out_option(verdicts.folder.parent)}"
        text = tr(
            "claims.csv and report.html of {configs} hold older verdicts: `{command}` updates them",
            configs=join_names(verdicts.outdated),
            command=command,
        )
        print_field("note", text)


def _print_each_interpretation(claim: "ClaimVerdicts") -> None:
    kinds = [tr(verdict.outcome.kind) if verdict.outcome else tr("not possible") for verdict in claim.verdicts]
    width = max(map(len, kinds))
    for verdict, kind in zip(claim.verdicts, kinds, strict=True):
        why = f" ({translate_reason(verdict.why)})" if verdict.why else ""
        print_line(
            f"       {verdict.kind}  {kind:<{width}}  {claim.interpretations.describe(verdict.interpretation)}{why}"
        )
