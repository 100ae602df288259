"""Stored blocks, and what there is to run, on the terminal."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from radarsim.cli.console import print_line, print_table
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, plural, shorten_names, term, tr

if TYPE_CHECKING:
    from radarsim.api.inventory import Inventory
    from radarsim.api.maintenance.clean import RemovedBlocks
    from radarsim.api.maintenance.doctor import Inspection


DROPPED_TEXT = term("dropped {files} in {folders} of {path}: {size:.2f} MB")


def print_inspection(inspection: "Inspection") -> None:
    """Findings about a result; faults are reported as errors."""
    outputs = plural("{count} output", "{count} outputs", inspection.outputs)
    pieces = plural("{count} stored piece", "{count} stored pieces", inspection.pieces)
    print_line(
        tr("{folder}: {outputs} and {pieces} checked", folder=str(inspection.folder), outputs=outputs, pieces=pieces)
    )
    for note in inspection.notes:
        print_line(tr("note: {words}", words=note))
    print_recomputed(inspection)
    if inspection.faults:
        print_line(plural("{count} fault found", "{count} faults found", len(inspection.faults)))
    elif not inspection.not_checked:
        print_line(tr("all intact"))


def print_recomputed(inspection: "Inspection") -> None:
    """How much of a result was computed again, and which tables were compared."""
    if not inspection.realisations:
        return
    parts = [plural("{count} piece", "{count} pieces", len(inspection.recomputed))] * bool(inspection.recomputed)
    if inspection.from_config:
        parts.append(tr("{cases} from the config", cases=shorten_names(inspection.from_config, 3)))
    values = {"done": inspection.realisations, "total": inspection.total, "pieces": join_names(parts)}
    values["percent"] = significant_share(inspection.realisations, inspection.total)
    print_line(tr("computed again: {pieces}: {done:,} of {total:,} realisations ({percent} %)", **values))
    if inspection.tables and not inspection.faults:
        count = plural("{count} table", "{count} tables", len(inspection.tables))
        print_line(tr("compared: {tables} made from the sums, equal to those stored", tables=count))


def recomputed_share(inspections: "Mapping[str, Inspection]") -> str:
    """How much of several results was computed again."""
    done = sum(inspection.realisations for inspection in inspections.values())
    total = sum(inspection.total for inspection in inspections.values())
    percent = significant_share(done, total)
    return tr(
        "{done:,} of {total:,} realisations computed again ({percent} %)", done=done, total=total, percent=percent
    )


def significant_share(part: int, whole: int) -> str:
    """A share in per cent, rounded down, so that only the whole is 100."""
    return numeral(f"{math.floor(1000 * part / whole) / 10:g}") if whole else "0"


def print_removed_blocks(cleaned: "RemovedBlocks", dry_run: bool) -> None:
    """The amount dropped, or to be dropped."""
    amount = {
        "files": plural("{count} file", "{count} files", cleaned.files),
        "folders": plural("{count} folder", "{count} folders", cleaned.identities),
        "path": str(cleaned.path),
        "size": cleaned.size / 1e6,
    }
    would = tr("would drop {files} in {folders} of {path}: {size:.2f} MB", **amount)
    print_line(would if dry_run else tr(DROPPED_TEXT, **amount))
    if cleaned.not_judged:
        words = tr(
            "blocks of {cases} are left: filters of your own code run only where you name the config: "
            "`radarsim clean CONFIG --other-sources`",
            cases=shorten_names(cleaned.not_judged),
        )
        print_line(tr("note: {words}", words=words))


def print_names(inventory: "Inventory") -> None:
    """The numbers of configs, scenarios, studies and filters, and their names, those of configs by paper."""
    (_, _, configs), (_, _, scenarios), (_, _, studies), (_, _, filters) = inventory
    print_line(plural("{count} config (radarsim run NAME)", "{count} configs (radarsim run NAME)", len(configs)))
    for paper in dict.fromkeys(paper for _, paper, _ in configs):
        print_line(f"{paper}  {', '.join(name for name, config_paper, _ in configs if config_paper == paper)}")
    count_texts = (
        plural("{count} scenario (target: NAME)", "{count} scenarios (target: NAME)", len(scenarios)),
        plural("{count} study (study: NAME)", "{count} studies (study: NAME)", len(studies)),
        plural("{count} filter", "{count} filters", len(filters)),
    )
    print_line(", ".join(count_texts))
    print_line(tr("A line each: `radarsim list configs`, scenarios, studies, filters, P2, any word"))


def print_inventory(inventory: "Inventory", folded: Mapping[str, int]) -> None:
    """Filters, studies, scenarios and configs, with a line on each: the most useful last. folded: how many variants of
    a config are left out."""
    for n, (title, columns, rows) in enumerate(reversed(inventory)):
        if n:
            print_line("")
        print_table(tr(title), columns, [(*row[:-1], tr(row[-1])) for row in rows])
    for name, count in folded.items():
        print_line(
            plural(
                "{count} variant of {name}: `radarsim list {name}`",
                "{count} variants of {name}: `radarsim list {name}`",
                count,
                name=name,
            )
        )
