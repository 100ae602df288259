"""One experiment from config to written results: the wiring that the command and Python share."""

import json
import os
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from radarsim import studies
from radarsim.config import lookup
from radarsim.config.load import Case, Experiment, load
from radarsim.engine.collect import Collected, collect, stored
from radarsim.engine.executors import available_cores
from radarsim.engine.results import CaseResult
from radarsim.engine.stopping import Signals
from radarsim.errors import ConfigError, StoreError
from radarsim.result import Result


def load_all(sources: Sequence, overrides: Sequence[str] = ()) -> list[Experiment]:
    """Every config checked before any runs; raises one ConfigError with the faults of all."""
    loaded, faults = [], []
    for source in sources:
        try:
            loaded.append(load(source, overrides))
        except ConfigError as error:
            faults += error.lines
    if faults:
        raise ConfigError(*faults)
    return loaded


def simulated(
    experiment: Experiment,
    *,
    out: str | os.PathLike | None = None,
    threads: int | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Signals | None = None,
) -> list[tuple[Case, studies.CaseWork, Collected]]:
    """Collect every case in turn, cases of one identity once; progress(done, total, from_store) is over all of them."""
    total = sum(case.realisations for case in experiment.cases)
    made: dict[tuple[str, int], tuple[studies.CaseWork, Collected]] = {}
    gathered, done, held = [], 0, 0

    def over_all(case_done: int, _: int, case_held: int) -> None:
        if progress is not None:
            progress(done + case_done, total, held + case_held)

    for case in experiment.cases:
        work = studies.CaseWork(case)
        key = (work.identity, case.realisations)
        if key not in made:
            made[key] = work, collect(work, case.realisations, store=out, threads=threads, progress=over_all, stop=stop)
        work, collected = made[key]
        gathered.append((case, work, collected))
        done += collected.count
        held += collected.from_store
        if collected.stopped:
            break
    return gathered


RESULTS = "results"  # the command's default directory
SHORT = {"realisations": "-n", "seed": "--seed"}


def run(
    config,
    *,
    realisations: float | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    threads: int | None = None,
    out: str | os.PathLike | None = None,
    figures: bool = True,
    progress: Callable[[int, int, int], None] | None = None,
    stop: Signals | None = None,
) -> Result:
    """Run an experiment and give its result; nothing is written unless `out` names a directory.

    config is a path, the name of a shipped config, a dict as YAML would give it, or an Experiment loaded with these
    overrides. overrides are texts `key=value` with dotted keys. Raises ConfigError for a wrong config, StoreError for a
    bad disk, NonFiniteError for a filter that diverged, and Interrupted, with all that was done stored, if `stop` saw
    a signal.

    >>> result = run("rls2", realisations=2000)
    >>> len(result.curves) > 50
    True
    """
    overrides = merged(overrides, realisations, seed)
    experiment = config if isinstance(config, Experiment) else load(config, overrides)
    threads = threads or available_cores()
    started = time.perf_counter()
    collected = simulated(experiment, out=out, threads=threads, progress=progress, stop=stop)
    if stop is not None:
        stop.raise_if_received()
    facts = facts_of(collected, threads, time.perf_counter() - started)
    result = Result(experiment, finished(collected), facts | repeated(experiment, overrides))
    if out is not None:
        result.write(out, figures)
    return result


def merged(overrides: Sequence[str], realisations: float | None, seed: int | None) -> tuple[str, ...]:
    """Overrides with realisations and seed, where given, as two more."""
    given = {"realisations": realisations, "seed": seed}
    return (*overrides, *(f"{key}={value}" for key, value in given.items() if value is not None))


def repeated(experiment: Experiment, overrides: Sequence[str]) -> dict[str, str]:
    """The command that repeats a run, as a fact of run.json; none for an experiment that is no file."""
    if experiment.path is None:
        return {"command": "none: the config was given in Python, and stands below"}
    return {"command": command(experiment, overrides, RESULTS)}


def command(experiment: Experiment, overrides: Sequence[str], out: str | os.PathLike) -> str:
    """The command that runs an experiment; a shipped config by its stem."""
    shipped = experiment.path and Path(experiment.path).resolve().is_relative_to(lookup.SHIPPED.resolve())
    path = os.fsencode(experiment.path or "").decode("utf-8", "backslashreplace")
    words = ["radarsim", "run", experiment.stem if shipped else path]
    for override in overrides:
        key, _, value = override.partition("=")
        words += [SHORT[key], value] if key in SHORT else ["--set", override]
    return shlex.join(words + (["--out", str(out)] if str(out) != RESULTS else []))


def report(
    experiment: Experiment, *, out: str | os.PathLike, overrides: Sequence[str] = (), figures: bool = True
) -> Result:
    """Tables, figures and report of a config from what is stored; raises ConfigError where something is missing.

    Where overrides do not say how many realisations, it is as many as the last run reported, else as the config asks.
    """
    if not any(override.split("=")[0].strip() == "realisations" for override in overrides):
        experiment = as_last_run(experiment, Path(out))
    held, missing = [], []
    for case in experiment.cases:
        work = studies.CaseWork(case)
        collected = stored(work, case.realisations, out)
        if collected is None:
            missing.append(f"{case.name}: {case.realisations} realisations are not stored in {out}")
        else:
            held.append((case, work, collected))
    if missing:
        raise ConfigError(*missing, f"`{command(experiment, overrides, out)}` computes them")
    result = Result(experiment, finished(held), facts_of(held, 0, 0.0) | repeated(experiment, overrides))
    result.write(out, figures)
    return result


def as_last_run(experiment: Experiment, out: Path) -> Experiment:
    """The experiment with each case's realisations as the run.json under `out` reports them, where there is one."""
    try:
        done = json.loads((out / experiment.stem / "run.json").read_text())["cases"]
        numbers = {name: int(case["done"]) for name, case in done.items()}
    except FileNotFoundError:
        return experiment
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StoreError(f"{out / experiment.stem / 'run.json'}: cannot be read: {error}") from error
    cases = tuple(replace(case, realisations=numbers.get(case.name, case.realisations)) for case in experiment.cases)
    return replace(experiment, cases=cases, realisations=max(case.realisations for case in cases))


Gathered = Sequence[tuple[Case, studies.CaseWork, Collected]]


def finished(gathered: Gathered) -> list[CaseResult]:
    """Cases with their sums and the labels that say what these are; display names are each case's own."""
    results = []
    for case, work, collected in gathered:
        plan = work.plan if work.case == case else studies.study(case.study).prepare(case)
        sums = plan.layout.unpack(collected.values)
        results.append(
            CaseResult(
                case.name, case.study, case.spec, case.swept, collected.count, sums, plan.axes, collected.kernel_seconds
            )
        )
    return results


def facts_of(gathered: Gathered, threads: int, seconds: float) -> dict:
    """The facts of a run for run.json: stop reason, threads, times, warnings, identities."""
    collected = [c for _, _, c in gathered]
    return {
        "stop": next((c.stopped for c in collected if c.stopped), "done"),
        "threads": threads,
        "seconds": seconds,
        "kernel_seconds": sum(c.kernel_seconds for c in collected),
        "realisations_computed": sum(c.computed for c in collected),
        "realisations_from_store": sum(c.from_store for c in collected),
        "warnings": list(dict.fromkeys(warning for c in collected for warning in c.warnings)),
        "identities": {case.name: work.identity for case, work, _ in gathered},
    }


def claims(configs: Sequence[str], out: str | os.PathLike) -> list[dict]:
    """Rows of the claims, as stored under `out` or as not run; of some configs only if any are given.

    Each row has the columns of claims.csv and `config`. Raises ConfigError for a config that does not exist.
    """
    from radarsim.report import claims as papers

    stems = [one.stem for one in load_all(configs)] or sorted({claim.config for claim in papers.all_claims()})
    held = {stem: table for stem in stems if (table := _stored_claims(Path(out) / stem / "claims.csv")) is not None}
    if not configs:
        return papers.listed(held)
    rows = []
    for stem in stems:
        if stem in held:
            rows += [row | {"config": stem} for row in held[stem].to_dict("records")]
        else:
            rows += [row for row in papers.listed({}) if row["config"] == stem]
    return rows


def _stored_claims(path: Path):
    """A stored claims.csv as a DataFrame; None if there is none."""
    import pandas as pd

    try:
        table = pd.read_csv(path, keep_default_na=False)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    if not {"claim", "verdict", "measured", "overall"} <= set(table.columns):
        raise StoreError(f"{path}: is no table of claims; `radarsim report` makes it anew")
    return table
