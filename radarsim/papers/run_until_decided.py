"""`radarsim run --decide`: as many realisations as it takes until each claim of the config is decided.

It looks at declared numbers of realisations only, 2000·2^m, as a precision does, and each verdict accounts for all
these looks (`verdict_rule.MAX_LOOKS`): were each look judged at 95 %, chance would refute up to a fifth of the claims
that are true at a border."""

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from radarsim.api import configs, result_content, simulate_cases
from radarsim.api.progress import Progress
from radarsim.api.simulate_cases import RunOptions, SimulatedCases
from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError, count_text
from radarsim.papers.claim_outcome import round_up
from radarsim.papers.claim_rows import cell_number, group_by_claim, is_extension
from radarsim.papers.study_claims import claims_of
from radarsim.papers.verdict_rule import UNDECIDED
from radarsim.report.precision import look_counts
from radarsim.studies import registry


def check_config_has_claims(experiment: Experiment) -> None:
    """ConfigError for a config that no claim names."""
    paper_claims = claims_of(registry.study(experiment.study))
    if paper_claims is None or all(claim.config != experiment.stem for claim in paper_claims.claims):
        configs = sorted({claim.config for claim in paper_claims.claims}) if paper_claims else []
        hint = f"; claims of its study name {', '.join(configs)}" if configs else ""
        raise ConfigError(f"{experiment.path or experiment.stem}: decide: no claim names this config{hint}")


def simulate_until_decided(
    experiment: Experiment, options: RunOptions, progress: Progress | None = None
) -> SimulatedCases:
    """The cases at the first look at which every claim is decided, or at the last permitted look; progress is towards
    that one."""
    max_realisations = max(case.realisations for case in experiment.cases)
    case_realisations = [realisations for _, realisations in dict(simulate_cases.works_by_identity(experiment))]
    done_before = 0  # realisations of the looks before

    def report(done: int, _: int, stored: int) -> None:
        if progress is not None:
            progress(done_before + done - stored, sum(case_realisations), done_before)

    with ExitStack() as stack:
        if options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        latest: SimulatedCases | None = None
        for n in dict.fromkeys((*look_counts(max_realisations), max_realisations)):
            cases = tuple(replace(case, realisations=min(n, case.realisations)) for case in experiment.cases)
            if done_before:
                report(0, 0, 0)  # judging is not in the rate
            simulated = simulate_cases.simulate(replace(experiment, cases=cases), options, progress=progress and report)
            done_before = sum(min(n, realisations) for realisations in case_realisations)
            if simulated.stopped and latest is not None and len(simulated.cases) < len(latest.cases):
                return replace(latest, stopped=simulated.stopped)
            latest = simulated
            if simulated.stopped or not _undecided_rows(_claim_rows(experiment, simulated)):
                break
    assert latest is not None  # there is a look at `most`
    return latest


def _claim_rows(experiment: Experiment, simulated: SimulatedCases) -> list[dict[str, Any]]:
    """The rows of claims.csv so far."""
    results = simulate_cases.collected_results(simulated)
    if len(results) < len(experiment.cases):
        return []
    table = result_content.case_tables(results, configs.shipped_stem(experiment))["claims"]
    return list(table.to_dict("records"))


def undecided_messages(experiment: Experiment, simulated: SimulatedCases) -> list[str]:
    """Lines on claims that stayed undecided or, where the time was up before all cases, unjudged."""
    if len(simulated.cases) == len(experiment.cases):
        return _undecided_rows(_claim_rows(experiment, simulated))
    paper_claims = claims_of(registry.study(experiment.study))
    names = [claim.id for claim in paper_claims.claims if claim.config == experiment.stem] if paper_claims else []
    done = f"{len(simulated.cases)} of {len(experiment.cases)} cases were done by then"
    return [f"{done}, too few to decide {', '.join(names)}"]


def _undecided_rows(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each undecided claim, with the realisations that it would take."""
    lines = []
    for parts in group_by_claim(rows):
        if parts[0]["as_shipped"] != UNDECIDED or is_extension(parts):
            continue
        needed = cell_number(parts[0]["needed"])
        remedy = (
            "its value lies on a border: more realisations would not decide"
            if needed is None
            else f"about {count_text(round_up(needed))} would"
        )
        max_realisations = max(cell_number(part["n"]) or 0.0 for part in parts)
        lines.append(f"{parts[0]['claim']} not yet decided at {count_text(max_realisations)} realisations; {remedy}")
    return lines
