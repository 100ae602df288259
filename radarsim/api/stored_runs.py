"""A result made again from stored blocks, and what is missing for it."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import arguments, configs
from radarsim.api import repeat_command as api_repeat_command
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import Config, Overrides, load
from radarsim.api.load_experiments import combine_overrides, user_code_lines
from radarsim.api.repeat_command import command, repeat_command
from radarsim.api.run_facts import run_facts
from radarsim.api.simulate_cases import SimulatedCases, collected_results
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.blocks import Total
from radarsim.engine.collect import read_stored
from radarsim.engine.store.inventory import Inventory, take_inventory
from radarsim.engine.store.store import Store
from radarsim.errors import ConfigError, count_text
from radarsim.language.translate import join_names, shorten_names, tr
from radarsim.report.stored_tables import find_record
from radarsim.studies import registry

if TYPE_CHECKING:
    from radarsim.api.result import Result


def store_gap_sentence(experiment: Experiment, out: str | os.PathLike[str]) -> str | None:
    """The realisations that a store with gaps lacks, in a sentence; None without gaps, as where nothing is stored."""
    incomplete: dict[str, tuple[CaseWork, Inventory]] = {}
    for case in experiment.cases:
        work = CaseWork(case)
        pieces = Store(out, work).pieces()
        if pieces and Total(case.realisations) not in pieces:
            stock = take_inventory(work, case.realisations, out)
            if stock.has_loose_blocks and stock.missing:
                incomplete.setdefault(work.identity, (work, stock))
    if not incomplete:
        return None
    (work, stock), *further_cases = incomplete.values()
    values: dict[str, Any] = {"config": experiment.stem, "case": work.case.name, "count": len(incomplete)}
    inventories = [inventory for _, inventory in incomplete.values()]
    values |= {
        "asked": sum(inventory.requested for inventory in inventories),
        "stored": sum(inventory.stored for inventory in inventories),
    }
    values["missing"] = missing_realisations(stock)
    sentence = tr("{config}: {stored:,} of {asked:,} realisations are stored; missing: {missing}", **values)
    return sentence + (tr(" (of {case}, the first of {count} such cases)", **values) if further_cases else "")


def missing_realisations(stock: Inventory) -> str:
    """Which realisations a store lacks, and which shares these look like."""
    runs = shorten_names([tr("{first:,} to {last:,}", first=first, last=last) for first, last in stock.missing], 3)
    if stock.part != (1, 1):
        number, share_count = stock.part
        counts = {
            "number": number,
            "of": share_count,
            "missing": stock.missing_blocks,
            "blocks": stock.blocks,
            "runs": runs,
        }
        return tr("share {number} of {of}: {missing} of {blocks} pieces missing, realisations {runs}", **counts)
    if stock.shares is None:
        return tr("realisations {runs}", runs=runs)
    numbers, share_count = stock.shares
    values = {"number": join_names([str(number) for number in numbers]), "of": share_count}
    if len(numbers) > 1:
        return tr("realisations {runs}; perhaps shares {number} of {of} were not copied", runs=runs, **values)
    share = tr("share {number} of {of}", **values)
    return tr("realisations {runs}; perhaps {share} was not copied", runs=runs, share=share)


def stored_realisations(cases: Sequence[Case], out: str | os.PathLike[str] | None) -> int:
    """The most realisations that a run under `out` has reported of each of these cases; 0 where one has none."""
    if out is None or not cases or not (Path(out) / ".blocks").is_dir():
        return 0
    counts: set[int] | None = None
    for case in cases:
        totals = {piece.count for piece in Store(out, CaseWork(case)).pieces() if isinstance(piece, Total)}
        counts = totals if counts is None else counts & totals
        if not counts:
            return 0
    return max(counts or {0})


def stored_result(
    config: Config, *, out: str | os.PathLike[str] = api_repeat_command.RESULTS, overrides: Overrides = ()
) -> "Result":
    """Load the stored result of an experiment from `out`; computes and writes nothing.

    config and overrides as for `run`; of as many realisations as the last run reported, unless overrides say. `write`
    of the result makes tables, figures and report, as `radarsim report` does. Raises ConfigError, with the command to
    run, if something is missing.

    >>> import radarsim, tempfile
    >>> with tempfile.TemporaryDirectory() as out:
    ...     ran = radarsim.run("rls2", realisations=2000, out=out, figures=False)
    ...     loaded = radarsim.load("rls2", out=out)
    >>> loaded.curves.equals(ran.curves)
    True
    """
    arguments.check_directory(out)
    overrides = combine_overrides(overrides)
    experiment = configured = load(config, overrides)
    if not any(override.split("=")[0].strip() == "realisations" for override in overrides):
        experiment = with_stored_realisations(experiment, Path(out))
    stored, missing = SimulatedCases(), []
    for case in experiment.cases:
        work = CaseWork(case)
        if not case.realisations:  # the last run was stopped before it came to this case
            continue
        collected = read_stored(work, case.realisations, out)
        if collected is None:
            missing.append(
                missing_blocks_line(case.name, take_inventory(work, case.realisations, out), Store(out, work))
            )
        else:
            stored.cases.append((case, work, collected))
    if missing:
        counts = {case.realisations for case in experiment.cases}
        configured_counts = {case.realisations for case in configured.cases}
        if experiment is not configured and counts != configured_counts and len(counts) == 1:
            overrides = combine_overrides(overrides, counts.pop(), None)
        raise ConfigError(*missing, f"`{command(configured, overrides, out)}` computes them")
    repeat = repeat_command(configured, stored.done, overrides, None)
    filter_warnings = config_filter_warnings(experiment)  # of which the answer's first sentence takes some
    result = make_result(experiment, stored, run_facts(stored, 0, 0.0), repeat)
    result.facts["warnings"] += filter_warnings
    return result


def config_filter_warnings(experiment: Experiment) -> list[str]:
    """Warnings on the user filters that the config names, from a trial on a few realisations."""
    if not user_code_lines([experiment]):
        return []
    from radarsim.api.filter_checks import check_user_filter

    user_filters = [(case, member) for case in experiment.cases for member in case.user_filters if member.written]
    return list(dict.fromkeys(line for case, member in user_filters for line in check_user_filter(case, member)))


def missing_blocks_line(name: str, stock: Inventory, store: Store) -> str:
    """A line on a case that is not completely stored: what is stored and what is missing, or why nothing is stored."""
    out = store.path.parent.parent
    if not stock.stored:
        reasons = [*store.warnings, *(["those there are of other sources, as before an edit"] * store.superseded())]
        return "; ".join([f"{name}: {count_text(stock.requested)} realisations are not stored in {out}", *reasons])
    missing = missing_realisations(stock)
    counts = f"{count_text(stock.stored)} of {count_text(stock.requested)} realisations"
    return f"{name}: {counts} are stored in {out}; missing: {missing}"


def make_result(experiment: Experiment, simulated: SimulatedCases, facts: dict[str, Any], repeat: str) -> "Result":
    """The result, with `repeat`, the command that repeats it, and the warnings on the config."""
    from radarsim.api.result import Result

    facts["warnings"] += [*configs.shadow_warnings(experiment), *registry.study(experiment.study).warnings(experiment)]
    return Result(experiment, collected_results(simulated), facts | {"command": repeat})


def with_stored_realisations(experiment: Experiment, out: Path) -> Experiment:
    """The experiment with each case's realisations as in the run.json under `out`, if there is one."""
    record = find_record(out / experiment.stem)
    if record is None:
        return experiment
    numbers = {name: case["done"] for name, case in record["cases"].items()}
    cases = tuple(replace(case, realisations=numbers.get(case.name, case.realisations)) for case in experiment.cases)
    return replace(experiment, cases=cases, realisations=max(case.realisations for case in cases))
