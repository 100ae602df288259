"""`radarsim run --decide`: as many realisations as it takes until each claim of the config is decided.

It looks at declared numbers of realisations only, 2000·2^m, as a precision does, and each verdict accounts for all
these looks (verdict_rule.LOOKS): were each look judged at 95 %, chance would refute up to a fifth of the claims that
are true at a border."""

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from radarsim.app import configs, result, run
from radarsim.app.ahead import Progress
from radarsim.app.run import RunOptions, SimulatedCases
from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError
from radarsim.papers.claim_outcome import round_up
from radarsim.papers.claim_rows import cell_number, group_by_claim, is_extension
from radarsim.papers.study_claims import claims_of
from radarsim.papers.verdict_rule import UNDECIDED
from radarsim.report.precision import looks
from radarsim.studies import registry


def check_config_has_claims(experiment: Experiment) -> None:
    """ConfigError for a config that no claim names."""
    of = claims_of(registry.study(experiment.study))
    if of is None or all(claim.config != experiment.stem for claim in of.claims):
        configs = sorted({claim.config for claim in of.claims}) if of else []
        hint = f"; claims of its study name {', '.join(configs)}" if configs else ""
        raise ConfigError(f"{experiment.path or experiment.stem}: decide: no claim names this config{hint}")


def simulate_until_decided(
    experiment: Experiment, options: RunOptions, progress: Progress | None = None
) -> SimulatedCases:
    """The cases at the first look at which every claim is decided, or at the last permitted look; progress is towards
    that one."""
    most = max(case.realisations for case in experiment.cases)
    each = [realisations for _, realisations in dict(run.keyed(experiment))]
    before = 0  # realisations of the looks before

    def towards(done: int, _: int, held: int) -> None:
        if progress is not None:
            progress(before + done - held, sum(each), before)

    with ExitStack() as stack:
        if options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        best: SimulatedCases | None = None
        for n in dict.fromkeys((*looks(most), most)):
            cases = tuple(replace(case, realisations=min(n, case.realisations)) for case in experiment.cases)
            if before:
                towards(0, 0, 0)  # judging is not in the rate
            found = run.simulate(replace(experiment, cases=cases), options, progress=progress and towards)
            before = sum(min(n, one) for one in each)
            if found.stopped and best is not None and len(found.cases) < len(best.cases):
                return replace(best, stopped=found.stopped)
            best = found
            if found.stopped or not _undecided_rows(_claim_rows(experiment, found)):
                break
    assert best is not None  # there is a look at `most`
    return best


def _claim_rows(experiment: Experiment, found: SimulatedCases) -> list[dict[str, Any]]:
    """The rows of claims.csv so far."""
    results = run.finished(found)
    if len(results) < len(experiment.cases):
        return []
    table = result.case_tables(results, configs.shipped_stem(experiment))["claims"]
    return list(table.to_dict("records"))


def undecided_messages(experiment: Experiment, found: SimulatedCases) -> list[str]:
    """Lines on claims that stayed undecided or, where the time was up before all cases, unjudged."""
    if len(found.cases) == len(experiment.cases):
        return _undecided_rows(_claim_rows(experiment, found))
    of = claims_of(registry.study(experiment.study))
    names = [claim.id for claim in of.claims if claim.config == experiment.stem] if of else []
    return [
        f"{len(found.cases)} of {len(experiment.cases)} cases were done by then, too few to decide {', '.join(names)}"
    ]


def _undecided_rows(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each undecided claim, with the realisations that it would take."""
    lines = []
    for parts in group_by_claim(rows):
        if parts[0]["as_shipped"] != UNDECIDED or is_extension(parts):
            continue
        needed = cell_number(parts[0]["needed"])
        would = (
            "its value lies on a border: more realisations would not decide"
            if needed is None
            else f"about {round_up(needed):,} would"
        )
        most = max(cell_number(part["n"]) or 0.0 for part in parts)
        lines.append(f"{parts[0]['claim']} not yet decided at {most:,.0f} realisations; {would}")
    return lines
