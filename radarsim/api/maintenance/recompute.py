"""A stored result computed again: some of its blocks, or all of it from its config; and its tables from the sums."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.api import configs
from radarsim.api.case_work import CaseWork
from radarsim.api.maintenance.compare_tables import OTHER_SHAPE, differs
from radarsim.api.maintenance.inspection import Inspection
from radarsim.api.maintenance.self_test import tolerance
from radarsim.api.result_content import case_tables
from radarsim.api.simulate_cases import SimulatedCases, collected_results
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.blocks import Node, Partial, simulate_piece
from radarsim.engine.collect import collect, read_stored
from radarsim.engine.machine import platform_name
from radarsim.engine.store.audit import Audit
from radarsim.engine.store.block_file import block_path
from radarsim.engine.sums import Sums
from radarsim.errors import count_text
from radarsim.extensions import extensions
from radarsim.report import atomic_files, csv_text, provenance
from radarsim.report.old_columns import with_current_columns

TOLERANCE_FACTOR = 10  # for a power p ≤ 4 of an error, and heavy tails in it
MAX_RECOMPUTED_SCANS = 10**9  # realisations times scans of all that is computed again: minutes, whatever a record says
Progress = Callable[[int, int], None]


class CountedWork:
    """A work that reports how many of its realisations are done."""

    def __init__(self, work: CaseWork, report: Callable[[int], None]):
        self._work, self._report = work, report
        self.identity, self.block, self.size, self.explain = work.identity, work.block, work.size, work.explain

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of the work, see `CaseWork.simulate`."""
        sums = self._work.simulate(first, count)
        self._report(count)
        return sums


class Counter:
    """Adds up realisations for a progress(done, total)."""

    def __init__(self, progress: Progress | None, total: int):
        self.done, self._progress, self._total = 0, progress, total

    def add(self, count: int) -> None:
        """So many more are done."""
        self.done += count
        if self._progress is not None:
            self._progress(self.done, self._total)


class WorkBudget:
    """What may be computed again, in realisations times scans: a record may name any number of realisations."""

    def __init__(self, scans: int = MAX_RECOMPUTED_SCANS):
        self.left = scans

    def take(self, work: CaseWork, realisations: int) -> bool:
        """Whether so many realisations of a work are within what is left, which then has less."""
        scans = realisations * len(work.plan.axes.k)
        if scans > self.left:
            return False
        self.left -= scans
        return True


def recompute_result(
    inspection: Inspection,
    record: Mapping[str, Any],
    experiment: Experiment,
    audits: Mapping[str, Audit],
    max_pieces: int,
    out: Path,
    budget: WorkBudget,
    progress: Progress | None = None,
) -> None:
    """Compute again up to max_pieces stored pieces of each audited case, the smallest first, and all of the cases
    without blocks or with those of other sources; then the tables from the sums, and compare everything. Nothing is
    written, and no more computed than the budget has.

    experiment: of the record; out: the directory of its blocks. Faults, notes and what could not be computed again are
    added to the inspection."""
    cases = {case.name: case for case in experiment.cases if case.realisations}
    works = {name: CaseWork(case) for name, case in cases.items()}
    changed = [name for name, audit in audits.items() if name in works and works[name].identity != audit.path.name]
    if changed:
        inspection.notes.append(_changed_sentence(changed, record))
    usable = {name: audit for name, audit in audits.items() if name in works and name not in changed}
    chosen = {
        name: _affordable_pieces(usable[name], works[name], max_pieces, budget) for name in works if name in usable
    }
    too_large = [name for name, pieces in chosen.items() if max_pieces and usable[name].nodes() and not pieces]
    without_blocks = [name for name in works if name not in usable]
    unaffordable = [name for name in without_blocks if not budget.take(works[name], cases[name].realisations)]
    total = sum(piece.realisations(works[name].block)[1] for name, pieces in chosen.items() for piece in pieces)
    total += sum(cases[name].realisations for name in without_blocks if name not in unaffordable)
    counter = Counter(progress, total)
    for name, pieces in chosen.items():
        _recompute_pieces(inspection, usable[name], works[name], pieces, counter)
    if too_large or unaffordable:
        inspection.not_checked.append(_too_much_sentence(too_large + unaffordable, cases))
    if inspection.faults or unaffordable:
        return
    simulated = SimulatedCases()
    for name, case in cases.items():
        sums = read_stored(works[name], case.realisations, out) if name in usable else None
        if sums is None:
            sums = collect(works[name], case.realisations, progress=partial(_add_difference, counter, [0]))
            inspection.from_config.append(name)
            inspection.realisations += case.realisations
        simulated.cases.append((case, works[name], sums))
    _compare_tables(inspection, record, experiment, simulated, out)


def _add_difference(counter: Counter, last: list[int], done: int, *_: int) -> None:
    """Report the progress of a case to a counter over several."""
    counter.add(done - last[0])
    last[0] = done


def _changed_sentence(names: Sequence[str], record: Mapping[str, Any]) -> str:
    """That cases were made by other sources, and of which version."""
    versions = f" ({_versions_sentence(record)})" if _versions_sentence(record) else ""
    return (
        f"{', '.join(names)}: the sources that compute have changed since its blocks were made{versions}: "
        "computed again from the config instead"
    )


def _versions_sentence(record: Mapping[str, Any]) -> str:
    """Which version made a result, and which this is; empty where they are the same."""
    before, now = record.get("versions", {}).get("radarsim"), provenance.versions()["radarsim"]
    return f"radarsim {before} made it, this is {now}" if before != now else ""


def _too_much_sentence(names: Sequence[str], cases: Mapping[str, Case]) -> str:
    """That cases are larger than what is computed again here."""
    largest = max(cases[name].realisations for name in names)
    return (
        f"{', '.join(names)}: not computed again: {count_text(largest)} realisations are more than is computed here, "
        f"{MAX_RECOMPUTED_SCANS:.0e} realisations times scans; `radarsim run` computes them"
    )


def _affordable_pieces(audit: Audit, work: CaseWork, max_pieces: int, budget: WorkBudget) -> list[Node | Partial]:
    """Of the smallest pieces those that are within a budget."""
    pieces = _smallest_pieces(audit, work.block, work.case.realisations, max_pieces)
    return [piece for piece in pieces if budget.take(work, piece.realisations(work.block)[1])]


def _smallest_pieces(audit: Audit, block: int, done: int, max_pieces: int) -> list[Node | Partial]:
    """Some stored pieces of the first `done` realisations of a case, the smallest first; of later ones, if there are no
    others, as after a larger run."""
    spans = {piece: piece.realisations(block) for piece in audit.pieces if isinstance(piece, Node | Partial)}
    by_size = sorted(spans, key=lambda piece: (spans[piece][1], spans[piece][0]))
    chosen: list[Node | Partial] = []
    for piece in [piece for piece in by_size if sum(spans[piece]) <= done] or by_size:
        first, count = spans[piece]
        if len(chosen) < max_pieces and not any(
            first < sum(spans[earlier]) and spans[earlier][0] < first + count for earlier in chosen
        ):
            chosen.append(piece)
    return chosen


def _recompute_pieces(
    inspection: Inspection, audit: Audit, work: CaseWork, pieces: list[Node | Partial], counter: Counter
) -> None:
    """Compute stored pieces of a case again, and compare the sums."""
    this_platform, other_platforms = platform_name(), set[str]()
    counted = CountedWork(work, counter.add)
    for piece in pieces:
        header, values = audit.pieces[piece]
        path = block_path(audit.path, piece)
        inspection.realisations += max(0, min(header["count"], work.case.realisations - header["first"]))
        inspection.recomputed.append(str(path))
        if header["block"] != work.block or values.size != work.size:
            inspection.faults.append(f"{path}: has other blocks than this program makes")
            continue
        other_platforms |= {*header["platforms"]} - {this_platform}
        if not sums_agree(work, simulate_piece(counted, piece), values, {*header["platforms"], this_platform}):
            inspection.faults.append(f"{path}: computed again, the sums differ")
    if other_platforms:
        allowed = f"{tolerance(work.case.study).sampled:.0e} of sigma"
        inspection.notes.append(
            f"{audit.path}: made on {'; '.join(sorted(other_platforms))}: compared to within {allowed}"
        )


def sums_agree(work: CaseWork, computed: Sums, stored: np.ndarray, platforms: set[str]) -> bool:
    """Whether sums agree with the stored ones: to the last bit on one platform, else as far as conditioning allows.

    An estimate may differ by the study's `Tolerance` in σ, so a sum of n errors to the power p by about n p σᵖ times
    that; other sums by that part of the largest in their array. σ is the largest of a filter and component over scans:
    with few realisations that of a single scan may be tiny by chance."""
    if len(platforms) < 2:
        return computed.values.tobytes() == stored.tobytes()
    allowed = TOLERANCE_FACTOR * tolerance(work.case.study).sampled
    for name, computed_sums in work.plan.layout.unpack(computed.values).items():
        stored_sums = work.plan.layout.unpack(stored)[name]
        scale = np.abs(computed_sums).max(initial=0.0)
        if name == "error":
            sigma = np.sqrt(computed_sums[..., 1].max(axis=1, keepdims=True) / computed.count)
            powers = np.stack([sigma, sigma**2, sigma**3, sigma**4], axis=-1) * computed.count
            scale = np.maximum(powers, np.abs(computed_sums) * [0, 1, 1, 1])  # the sum of e itself may have either sign
        if not (np.abs(computed_sums - stored_sums) <= allowed * scale).all():
            return False
    return True


def _compare_tables(
    inspection: Inspection, record: Mapping[str, Any], experiment: Experiment, simulated: SimulatedCases, out: Path
) -> None:
    """Make the tables from the sums, and compare them with the stored ones."""
    tables_by_name = case_tables(collected_results(simulated), configs.shipped_stem(experiment))
    free_columns: dict[str, Sequence[str]] = {}
    for extension in extensions():
        free_columns |= extension.columns_from_elsewhere
        tables_by_name.update(extension.updated_tables(tables_by_name, experiment.study, out))
    to_rounding = []
    for name, table in tables_by_name.items():
        path = inspection.folder / f"{name}.csv"
        if path.name not in record["outputs"]:
            continue
        stored = with_current_columns(experiment.study, name, atomic_files.read(path))
        computed = csv_text.to_csv(table)
        inspection.tables.append(path.name)
        if difference := differs(experiment.study, name, stored, computed, free_columns.get(name, ())):
            if difference.startswith(OTHER_SHAPE) and (versions := _versions_sentence(record)):
                inspection.not_checked.append(f"{path.name} could not be compared: it {difference}: {versions}")
                continue
            origin = "that its config gives" if inspection.from_config else "of these sums"
            inspection.faults.append(f"{path}: is not the table {origin}: {difference}")
        elif stored != computed and name not in free_columns:
            to_rounding.append(path.name)
    if to_rounding:
        inspection.notes.append(f"equal to rounding, not to the last digit: {', '.join(to_rounding)}")
