"""`radarsim interpretations`: verdicts under every interpretation, computed exactly or by small stored runs."""

import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from radarsim.api import arguments
from radarsim.api.progress import Progress, TimedProgress
from radarsim.api.simulate_cases import RunOptions
from radarsim.engine.stop_conditions import AnyStop, Signals, Stop, TimeLimit
from radarsim.errors import ConfigError, argument, count_text
from radarsim.papers.claim_outcome import round_up
from radarsim.papers.interpretation_files import outdated_configs, write_files
from radarsim.papers.interpretation_runs import FIGURE_S, InterpretationRuns
from radarsim.papers.interpretation_verdicts import InterpretationVerdicts, PaperVerdicts
from radarsim.papers.interpretations import PaperInterpretations
from radarsim.papers.open_papers import JudgingRequest, judging_requests
from radarsim.papers.stored_verdicts import TABLE
from radarsim.papers.verdict_rule import UNDECIDED
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts
from radarsim.system.threads import ThreadLimit


def judge_requests(
    requests: Sequence[JudgingRequest],
    *,
    out: str | Path,
    realisations: int | None = None,
    decide: bool = False,
    options: RunOptions | None = None,
    progress: Progress | None = None,
    figures: bool = True,
    stop: Signals | None = None,
    write: bool = True,
) -> InterpretationVerdicts:
    """Judge claims under every interpretation and, unless disabled, write table and specification curves into
    out/interpretations.

    wanted: of `judging_requests`. realisations of each run, where runs are needed; default: the number declared by the
    paper's interpretations. decide: runs behind undecided claims are extended, up to 2000·2^m realisations, until each
    claim is decided; `realisations` is then the limit. Runs go through the store of blocks under out, so that a second
    call continues. Raises TargetUnmet where a time limit left something undone, Interrupted on a signal seen by
    `stop`."""
    if realisations is not None and realisations < 1:
        raise ConfigError(f"{argument('realisations')}: must be >= 1, got {realisations}")
    options = replace(options or RunOptions(), out=out)
    all_runs = [
        InterpretationRuns(request, _first_realisations(request.paper.interpretations, realisations, decide))
        for request in requests
    ]

    def estimate() -> None:
        for runs in all_runs:
            runs.estimate(forecast, options.threads)

    forecast = TimedProgress(progress, estimate)
    for runs, request in zip(all_runs, requests, strict=True):
        runs.forecast_runs(forecast, realisations or request.paper.interpretations.max_realisations if decide else 0)
    if write and figures:
        claims_with_curves = [
            claim
            for request in requests
            for claim in request.claims
            if len(request.paper.interpretations.for_claim(claim.id)) > 1
        ]
        forecast.add("figure", FIGURE_S, len(claims_with_curves))
    papers, undecided = [], []
    for runs, request in zip(all_runs, requests, strict=True):
        claims = runs.judge(options, forecast, stop)
        if decide:
            claims = runs.decide(
                claims, realisations or request.paper.interpretations.max_realisations, options, forecast, stop
            )
            undecided += [line for claim_verdicts in claims if (line := _undecided_message(claim_verdicts))]
        papers.append(PaperVerdicts(request.paper, claims))
    verdicts = InterpretationVerdicts(papers, Path(out) / TABLE.parent, undecided_messages=tuple(undecided))
    if write:
        verdicts.files = write_files(verdicts, figures, forecast)
        verdicts.outdated = outdated_configs(verdicts)
    return verdicts


def interpretations(
    *names: str,
    realisations: float | None = None,
    decide: bool = False,
    threads: int | None = None,
    time_limit: float | Stop | None = None,
    out: str | os.PathLike[str] | None = None,
    figures: bool = True,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> InterpretationVerdicts:
    """Judge claims (P1.4) or whole papers (P1) under every interpretation that the papers allow; default: all.

    Interpretations are judged exactly where possible, otherwise by runs of `realisations`, by default the number that
    the paper's interpretations declare. decide: extend the runs, up to `realisations`, until each claim is decided.
    time_limit is in seconds. out: directory for interpretations.csv, a figure for each claim, and the stored runs.

    `table` is interpretations.csv: a row for each claim, interpretation and part. Raises ConfigError for unknown names,
    TargetUnmet if the time did not suffice. progress is called with the milliseconds that have passed, those that all
    is expected to take, and 0.

    >>> interpretations("P1.4")
    P1.4 depends on: holds in 4 of 6 interpretations; depends on how the filter starts
    """
    arguments.check_arguments(threads=threads, time_limit=time_limit, out=out, figures=figures)
    arguments.check_texts(names)
    requests = judging_requests(names)
    limit = time_limit if time_limit is None or callable(time_limit) else TimeLimit(time_limit)
    options: dict[str, Any] = {"realisations": arguments.whole_number(realisations), "decide": decide}
    options |= {"progress": progress, "figures": figures, "stop": stop, "write": out is not None}
    with tempfile.TemporaryDirectory(prefix="radarsim-") as folder, ThreadLimit(threads):
        run_options = RunOptions(None, threads, AnyStop(stop, limit))
        return judge_requests(requests, out=Path(folder if out is None else out), options=run_options, **options)


def _first_realisations(interpretations: PaperInterpretations, realisations: int | None, decide: bool) -> int:
    """Realisations of the first runs: those requested, or declared; with `decide`, at most those requested."""
    if realisations is None:
        return interpretations.realisations
    return min(interpretations.realisations, realisations) if decide else realisations


def _undecided_message(verdicts: ClaimVerdicts) -> str:
    """The line on an undecided claim: under how many interpretations, and what it would take."""
    if verdicts.outcome is None or verdicts.outcome.kind != UNDECIDED:
        return ""
    needed = verdicts.outcome.needed
    would = (
        "a value lies on a border: more realisations would not decide"
        if needed is None
        else f"about {count_text(round_up(needed))} would"
    )
    undecided, n = len(verdicts.undecided), count_text(verdicts.fewest_realisations)
    return f"{verdicts.claim.id} not yet decided under {undecided} interpretations at {n} realisations; {would}"
