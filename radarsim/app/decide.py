"""`radarsim run --decide`: as many realisations as it takes until each claim of the config is decided.

It looks at declared numbers of realisations only, 2000·2^m, as a precision does, and each verdict is one of all these
looks (report.claims.rule.LOOKS): were each judged at 95 %, chance would refute up to a fifth of the claims that are
true at a border.
"""

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from radarsim.app import output, simulation
from radarsim.app.simulation import Progress, RunOptions, SimulatedCases
from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.report.claims import page
from radarsim.report.claims.rule import UNDECIDED, roughly
from radarsim.report.precision import looks
from radarsim.studies import registry


def check(experiment: Experiment) -> None:
    """ConfigError for a config that no claim names."""
    of = registry.study(experiment.study).claims()
    if of is None or all(claim.config != experiment.stem for claim in of.claims):
        configs = sorted({claim.config for claim in of.claims}) if of else []
        hint = f"; claims of its study name {', '.join(configs)}" if configs else ""
        raise ConfigError(f"{experiment.path or experiment.stem}: decide: no claim names this config{hint}")


def simulated(experiment: Experiment, options: RunOptions, progress: Progress | None = None) -> SimulatedCases:
    """The cases at the first look at which every claim is decided, or at the last one that they may have."""
    most = max(case.realisations for case in experiment.cases)
    with ExitStack() as stack:
        if options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        best: SimulatedCases | None = None
        for n in dict.fromkeys((*looks(most), most)):
            cases = tuple(replace(case, realisations=min(n, case.realisations)) for case in experiment.cases)
            found = simulation.simulated(replace(experiment, cases=cases), options, progress=progress)
            if found.stopped and best is not None and len(found.cases) < len(best.cases):
                return replace(best, stopped=found.stopped)
            best = found
            if found.stopped or not undecided(rows_of(experiment, found)):
                break
    assert best is not None  # there is a look at `most`
    return best


def rows_of(experiment: Experiment, found: SimulatedCases) -> list[dict[str, Any]]:
    """The rows of claims.csv of what is done."""
    results: list[CaseResult] = [simulation.result_of(*one) for one in found.cases]
    if len(results) < len(experiment.cases):
        return []
    table = output.tables(results, stem=experiment.stem)["claims"]
    return list(table.to_dict("records"))


def left(experiment: Experiment, found: SimulatedCases) -> list[str]:
    """What is to be said of claims that were not decided, or, where the time was up before all cases, not judged."""
    if len(found.cases) == len(experiment.cases):
        return undecided(rows_of(experiment, found))
    of = registry.study(experiment.study).claims()
    names = [claim.id for claim in of.claims if claim.config == experiment.stem] if of else []
    return [
        f"{len(found.cases)} of {len(experiment.cases)} cases were done by then, too few to decide {', '.join(names)}"
    ]


def undecided(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each claim that is not yet decided, with the realisations that it would take."""
    lines = []
    for parts in page.grouped(rows):
        if parts[0]["as_shipped"] != UNDECIDED or page.extension(parts):
            continue
        needed = page.number(parts[0]["needed"])
        would = "its value lies on a border: no number would" if needed is None else f"about {roughly(needed):,} would"
        lines.append(f"{parts[0]['claim']} not yet decided at {_most(parts):,.0f} realisations; {would}")
    return lines


def _most(parts: Sequence[Any]) -> float:
    return max(page.number(part["n"]) or 0.0 for part in parts)
