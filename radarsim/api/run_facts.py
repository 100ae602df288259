"""The facts of a run for run.json: seconds, memory, versions, warnings."""

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from radarsim.api.case_work import CaseWork
from radarsim.api.simulate_cases import SimulatedCases
from radarsim.language.translate import shorten_names, tr
from radarsim.studies import registry
from radarsim.studies.identity import user_packages


def run_facts(simulated: SimulatedCases, threads: int, seconds: float) -> dict[str, Any]:
    """The facts of a run for run.json: stop reason, threads, times, warnings, identities, precision reached."""
    collected = [c for _, _, c in simulated.cases]
    facts: dict[str, Any] = {
        "stop": "; ".join(simulated.unmet) or "done",
        "unmet": simulated.unmet,
        "threads": threads,
        "seconds": seconds,
        "kernel_seconds": sum(c.kernel_seconds for c in collected),
        "realisations_computed": sum(c.computed for c in collected),
        "realisations_from_store": sum(c.from_store for c in collected),
        "warnings": [
            *dict.fromkeys(warning for c in collected for warning in c.warnings),
            *superseded_blocks([case.name for case, _, c in simulated.cases if c.superseded]),
            *cache_troubles(),
        ],
        "identities": {case.name: work.identity for case, work, _ in simulated.cases},
    }
    packages = [user_packages(case) for case, _, _ in simulated.cases]
    if any(packages):
        facts["packages"] = {name: package._asdict() for by_name in packages for name, package in by_name.items()}
    if measured := seconds_per_update(work for _, work, _ in simulated.cases):
        facts["seconds_per_update"] = measured
    if simulated.precision is None:
        return facts
    widest = {
        name: asdict(cell) | {"percent": finite_or_none(cell.percent), "of": cell.of.name}
        for name, cell in simulated.cells.items()
    }
    return facts | {"precision": {"asked_percent": simulated.precision, "widest": widest}}


MAX_NAMED_CASES = 3  # in a line


def superseded_blocks(cases: Sequence[str]) -> list[str]:
    """A line on stored blocks of these cases that other sources made; empty without cases."""
    if not cases:
        return []
    return [
        tr(
            "stored blocks of {cases} were made by other sources, as before an edit, and are not used; "
            "`radarsim clean CONFIG --other-sources` removes them",
            cases=shorten_names(list(dict.fromkeys(cases)), MAX_NAMED_CASES),
        )
    ]


def cache_troubles() -> list[str]:
    """Faults of the compiler and its cache in this process, a line for each kind. A kernel that could not be read or
    kept was compiled, as on a new machine."""
    cache = sys.modules.get("radarsim.kernels.cache")  # nothing is compiled where it is not loaded
    return list(cache.troubles.values()) if cache else []


def seconds_per_update(works: Iterable[CaseWork]) -> dict[str, dict[str, float]]:
    """CPU seconds of one update of one realisation, by case and filter, in studies that measure it; never in a CSV."""
    seconds_by_case = {
        work.case.name: dict(registry.study(work.case.study).seconds_per_update(work.plan)) for work in works
    }
    return {name: seconds for name, seconds in seconds_by_case.items() if seconds}


def finite_or_none(value: float) -> float | None:
    """The number, or None where JSON cannot hold it."""
    return value if math.isfinite(value) else None
