"""One experiment from config to written results: the wiring that the command and Python share."""

import json
import math
import os
import re
import sys
import time
import unicodedata
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.app import arguments, simulation, stored_claims
from radarsim.app.configs import load, shipped
from radarsim.app.records import of_other_sources
from radarsim.app.repeat import RESULTS, command, repeated
from radarsim.app.result import Result
from radarsim.app.simulation import Progress, RunOptions, SimulatedCases
from radarsim.app.stored_readings import classes_of
from radarsim.app.work import CaseWork
from radarsim.config.experiment import Experiment
from radarsim.engine import stopping
from radarsim.engine.collect import stored
from radarsim.engine.executors import Executor
from radarsim.engine.machine import available_cores
from radarsim.engine.results import CaseResult
from radarsim.engine.stock import Stock, stock
from radarsim.engine.stopping import Signals, Stop
from radarsim.errors import ConfigError, StoreError, TargetUnmet
from radarsim.report import files
from radarsim.studies import registry

if TYPE_CHECKING:
    from radarsim.report.claims import PaperClaims

WORTH_MEASURING_S = 20.0  # of a time limit: within less, measuring what tables and figures take would be most of it


def load_all(sources: Sequence[str | os.PathLike[str]], overrides: Sequence[str] = ()) -> list[Experiment]:
    """Every config checked before any runs; raises one ConfigError with the faults of all."""
    loaded: list[Experiment] = []
    faults: list[str] = []
    for source in sources:
        try:
            loaded.append(load(source, overrides))
        except ConfigError as error:
            faults += error.lines
    faults += namesakes(loaded)
    if faults:
        raise ConfigError(*faults)
    return loaded


Config = str | os.PathLike[str] | Mapping[str, Any] | Experiment


def namesakes(experiments: Sequence[Experiment]) -> list[str]:
    """A line for each config whose results would overwrite those of another one: their folder has the config's name.

    Names that differ in case or in how their letters are composed are one name to some file systems.
    """
    seen: dict[str, str] = {}
    faults = []
    for one in experiments:
        name = unicodedata.normalize("NFC", one.stem).casefold()
        first = seen.setdefault(name, str(one.path))
        if first != str(one.path) and not files.same_file(first, str(one.path)):
            faults.append(f"{one.path}: its results would overwrite those of {first}: rename one, or run them apart")
    return faults


def run(
    config: Config,
    *,
    realisations: float | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    precision: float | None = None,
    of: str = "sigma",
    decide: bool = False,
    time_limit: float | Stop | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> Result:
    """Run an experiment and give its result; nothing is written unless `out` names a directory.

    config is a path, the name of a shipped config, a dict as YAML would give it, or an Experiment loaded with these
    overrides. overrides are texts `key=value` with dotted keys. With a precision, in per cent, a case ends at the first
    of 2000, 4000, 8000 …, N realisations at which the 95 % half-width of every σ is under it, or of every quantity of
    another kind, `of`: gain, lock, lost, right, wrong, loss, false_tracks; where errors are not known to be Gaussian,
    of σ and gains not before 64,000, or 512,000 where large ones have come. decide: all cases end at the first of
    these at which every claim of the config is decided. time_limit is in seconds, tables and figures counted in, or a
    condition that runs already. `result.unmet` says what of the two was not reached. workers are processes of this
    machine, scheduler the address of a Dask scheduler, executor one that is open already.
    width_mm is the width of the figures' files in place of their own.

    Raises ConfigError for a wrong config, StoreError for a bad disk, NonFiniteError for a filter that diverged,
    TargetUnmet where the time did not suffice for a single block, and Interrupted, with all that was done stored, if
    `stop` saw a signal. Raises DisagreementError, after all is written, where measured and exact values differ by more
    than chance makes: one of them is computed wrongly. Its `result` is what would have been returned.

    >>> result = run("rls2", realisations=2000)
    >>> len(result.curves) > 50
    True
    """
    from radarsim.app import decide as deciding  # with it the parts that judge and draw, which `check` does without

    arguments.check(
        **{"threads": threads, "workers": workers, "precision": precision, "time_limit": time_limit},
        **{"executor": executor, "out": out, "overrides": overrides, "figures": figures},
    )
    overrides = merged(overrides, realisations, seed)
    experiment = config if isinstance(config, Experiment) else load(config, overrides)
    if precision is not None:
        simulation.check_precision([experiment], precision, of)
    if decide:
        deciding.check(experiment)
    limit = time_limit if time_limit is None or callable(time_limit) else stopping.time_limit(time_limit)
    started, kept = time.perf_counter(), None
    if out is not None and isinstance(limit, stopping.TimeLimit) and limit.left >= WORTH_MEASURING_S:
        from radarsim.app.writing import seconds as writing_s

        limit = limit.reserving(kept := writing_s(experiment, figures, width_mm))
    with cluster(workers, scheduler) if executor is None else nullcontext(executor) as pool:
        threads = pool.workers if pool else int(threads or available_cores())
        options = RunOptions(out, threads, stopping.Either(stop, limit), pool)
        if decide:
            simulated = deciding.simulated(experiment, options, progress)
        else:
            simulated = simulation.simulated(experiment, options, progress=progress, precision=precision, of=of)
        if stop is not None:
            stop.raise_if_received()
    if not simulated.cases:
        raise TargetUnmet(f"{experiment.stem}: {simulated.stopped}: nothing was done by then")
    facts = facts_of(simulated, threads, time.perf_counter() - started)
    if kept is not None:
        facts["seconds_kept_for_writing"] = kept
    if decide:
        left = deciding.left(experiment, simulated)
        facts |= {"unmet": [*facts["unmet"], *left], "stop": "; ".join((*facts["unmet"], *left)) or "done"}
    ended_by = None if simulated.stopped or precision is None else (precision, of)
    result = result_of(experiment, simulated, facts, repeated(experiment, simulated.done, overrides, ended_by))
    if out is None:
        result.check()
    else:
        result.write(out, figures, width_mm)
    return result


def share(
    experiment: Experiment,
    part: tuple[int, int],
    *,
    out: str | os.PathLike[str],
    threads: int | None = None,
    executor: Executor | None = None,
    time_limit: Stop | None = None,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> simulation.Shares:
    """Compute a part of every case, as (2, 3) the second of three, into the store under out; no tables. See `run`."""
    options = RunOptions(out, threads, stopping.Either(stop, time_limit), executor)
    done = simulation.shared(experiment, part, options, progress=progress)
    if stop is not None:
        stop.raise_if_received()
    return done


def cluster(workers: int | None, scheduler: str | None) -> AbstractContextManager[Executor | None]:
    """The executor of these workers or of this scheduler, to be entered; None where neither is given."""
    if workers is None and scheduler is None:
        return nullcontext()
    from radarsim.engine.cluster import Cluster

    return Cluster(workers, scheduler)


def trust(scheduler: str) -> str | None:
    """What computing with a scheduler of another machine rests on, in one line."""
    from radarsim.engine.cluster import trust as line

    return line(scheduler)


def merged(overrides: Sequence[str], realisations: float | None, seed: int | None) -> tuple[str, ...]:
    """Overrides with realisations and seed, where given, as two more."""
    given = {"realisations": realisations, "seed": seed}
    return (*overrides, *(f"{key}={value}" for key, value in given.items() if value is not None))


def report(
    experiment: Experiment,
    *,
    out: str | os.PathLike[str],
    overrides: Sequence[str] = (),
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
) -> Result:
    """Tables, figures and report of a config from what is stored; raises ConfigError where something is missing.

    Where overrides do not say how many realisations, it is as many as the last run reported, else as the config asks.
    width_mm is the width of the figures' files in place of their own.
    """
    result = from_store(experiment, out, overrides)
    result.write(out, figures, width_mm)
    return result


def load_result(config: Config, *, out: str | os.PathLike[str] = RESULTS, overrides: Sequence[str] = ()) -> Result:
    """The result of an experiment that was run into `out`, from what is stored there: computes and writes nothing.

    config and overrides as for `run`. Raises ConfigError where something is missing, with the command that computes it.

    >>> import radarsim, tempfile
    >>> with tempfile.TemporaryDirectory() as out:
    ...     ran = radarsim.run("rls2", realisations=2000, out=out, figures=False)
    ...     loaded = radarsim.load("rls2", out=out)
    >>> loaded.curves.equals(ran.curves)
    True
    """
    experiment = config if isinstance(config, Experiment) else load(config, overrides)
    return from_store(experiment, out, overrides)


def from_store(experiment: Experiment, out: str | os.PathLike[str], overrides: Sequence[str]) -> Result:
    """The result from stored blocks alone; as many realisations as the last run, where overrides do not say."""
    arguments.directory(out)
    asked = experiment
    if not any(override.split("=")[0].strip() == "realisations" for override in overrides):
        experiment = as_last_run(experiment, Path(out))
    held, missing = SimulatedCases(), []
    for case in experiment.cases:
        work = CaseWork(case)
        if not case.realisations:  # the last run was stopped before it came to this case
            continue
        collected = stored(work, case.realisations, out)
        if collected is None:
            missing.append(lack(case.name, stock(work, case.realisations, out), out))
        else:
            held.cases.append((case, work, collected))
    if missing:
        counts = {case.realisations for case in experiment.cases}
        if experiment is not asked and counts != {case.realisations for case in asked.cases} and len(counts) == 1:
            overrides = merged(overrides, counts.pop(), None)
        raise ConfigError(*missing, f"`{command(asked, overrides, out)}` computes them")
    return result_of(experiment, held, facts_of(held, 0, 0.0), repeated(asked, held.done, overrides, None))


def lack(name: str, held: Stock, out: str | os.PathLike[str]) -> str:
    """The line of a case that is not stored whole: how much of it is, and what is missing."""
    if not held.stored:
        return f"{name}: {held.asked} realisations are not stored in {out}"
    from radarsim.app.outlook import missing

    return f"{name}: {held.stored:,} of {held.asked:,} realisations are stored in {out}; missing: {missing(held)}"


def result_of(experiment: Experiment, simulated: SimulatedCases, facts: dict[str, Any], again: str) -> Result:
    """The result, `again` the command that repeats it; with what is to be warned of in the config."""
    facts["warnings"] += registry.study(experiment.study).warnings(experiment)
    return Result(experiment, finished(simulated), facts | {"command": again})


def as_last_run(experiment: Experiment, out: Path) -> Experiment:
    """The experiment with each case's realisations as the run.json under `out` reports them, where there is one."""
    try:
        done = json.loads(files.read(out / experiment.stem / "run.json"))["cases"]
        numbers = {name: int(case["done"]) for name, case in done.items()}
    except FileNotFoundError:
        return experiment
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or "damaged"
        raise StoreError(
            f"{out / experiment.stem / 'run.json'}: cannot be read: {reason}; `radarsim run` makes it again, "
            "and so does `radarsim report` with -n"
        ) from error
    cases = tuple(replace(case, realisations=numbers.get(case.name, case.realisations)) for case in experiment.cases)
    return replace(experiment, cases=cases, realisations=max(case.realisations for case in cases))


def finished(simulated: SimulatedCases) -> list[CaseResult]:
    """Cases with their sums and the labels that say what these are."""
    return [simulation.result_of(*one) for one in simulated.cases]


def facts_of(simulated: SimulatedCases, threads: int, seconds: float) -> dict[str, Any]:
    """The facts of a run for run.json: stop reason, threads, times, warnings, identities, the precision reached."""
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
            *of_other_sources({work.identity: case.name for case, work, _ in simulated.cases}),
            *cache_troubles(),
        ],
        "identities": {case.name: c.kept_as or work.identity for case, work, c in simulated.cases},
    }
    if measured := seconds_per_update(work for _, work, _ in simulated.cases):
        facts["seconds_per_update"] = measured
    if simulated.precision is None:
        return facts
    widest = {name: asdict(cell) | {"percent": finite(cell.percent)} for name, cell in simulated.cells.items()}
    return facts | {"precision": {"asked_percent": simulated.precision, "widest": widest}}


def cache_troubles() -> list[str]:
    """What went wrong with the cache of compiled kernels in this process, a line for each kind; nothing depends on it.

    A kernel that could not be read or kept was compiled, as on a new machine.
    """
    cache = sys.modules.get("radarsim.kernels.cache")  # nothing is compiled where it is not loaded
    return list(cache.troubles.values()) if cache else []


def seconds_per_update(works: Iterable[CaseWork]) -> dict[str, dict[str, float]]:
    """CPU seconds of one update of one realisation, by case and filter, of studies that measure it; never in a CSV."""
    every = {work.case.name: dict(registry.study(work.case.study).seconds_per_update(work.plan)) for work in works}
    return {name: seconds for name, seconds in every.items() if seconds}


def finite(value: float) -> float | None:
    """The number, or None where JSON cannot hold it."""
    return value if math.isfinite(value) else None


def draw_claims(rows: Sequence[Mapping[str, Any]], path: str | os.PathLike[str]) -> None:
    """Write the forest plot of claims; raises ConfigError for a name that says no format, or where none is judged."""
    from radarsim.report import figures
    from radarsim.report.claims import forest

    kind = Path(path).suffix[1:].lower()
    if kind not in arguments.FORMATS:
        raise ConfigError(f"{path}: must end in {', '.join(f'.{one}' for one in arguments.FORMATS)}")
    figure = forest.figure(rows)
    if figure is None:
        raise ConfigError(f"{path}: no claim is judged here, so there is nothing to draw")
    files.replace_all(Path(path).parent, {Path(path).name: figures.save(figure, (kind,))[kind]})


def papers() -> "list[PaperClaims]":
    """The claims of every paper, in the order of the studies."""
    return [of for of in registry.parts(lambda study: study.claims()).values() if of is not None]


# P1.3 and P4, known or not; a small letter and names joined by commas are taken for what they are meant to be.
LIKE_A_CLAIM = re.compile(r"P\d+(\.\w+)?|[Pp]\d+(\.[Ee]?\d+\w?)?(,.+)?")


def _unknown_claims(names: Sequence[str], known: Collection[str]) -> list[str]:
    """A line for each name that is written like a claim or a paper, and is none."""
    found, every = [], _keys(known)
    for name in names:
        paper = name.partition(".")[0]
        if name in known or name in every:
            continue
        if paper in every:
            own = [claim for claim in known if claim.startswith(f"{paper}.")]
            found.append(f"claims: {name} is no claim of {paper}; its claims: {', '.join(own)}")
        else:
            found.append(f"claims: {name} is no claim and no paper; papers: {', '.join(every)}")
    return found


def _keys(ids: Iterable[str]) -> list[str]:
    """The papers of claims: P1 of P1.4."""
    return sorted({claim.partition(".")[0] for claim in ids})


def claims(names: Sequence[str], out: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Rows of the claims, as stored under `out` or as not run; if any names are given, of these configs, papers (P1)
    and claims (P1.4) alone.

    Of a config that judges none: those of its study's paper, with the reason why each of them is not judged by it.
    Each row has the columns of claims.csv and `config`. Raises ConfigError for what does not exist.
    """
    from radarsim.app import readings
    from radarsim.report.claims.classes import with_classes
    from radarsim.report.claims.judge import listed, unstored

    every = papers()
    of = {claim.id: claim.config for paper in every for claim in paper.claims}
    wanted = [name for name in names if LIKE_A_CLAIM.fullmatch(name) and not Path(name).is_file()]
    if faults := _unknown_claims(wanted, of):
        raise ConfigError(*faults)
    asked = load_all([name for name in names if name not in wanted])
    shown = [claim for claim in of if not names or claim in wanted or claim.partition(".")[0] in wanted]
    stems = dict.fromkeys([*(one.stem for one in asked), *(of[claim] for claim in shown)])
    held = {stem: rows for stem in stems if (rows := stored_claims.stored(Path(out) / stem / "claims.csv")) is not None}
    rows = []
    for one in asked:
        own = held.get(one.stem) or [row for row in listed(every, {}) if row["config"] == one.stem]
        if not own and one.cases and (paper := registry.study(one.cases[0].study).claims()) is not None:
            own = unstored(paper, one.cases, shipped, one.stem)
        rows += [row | {"config": one.stem} for row in own]
    known = {(row["claim"], row["config"]) for row in rows}
    own = [row for row in listed(every, held) if row["claim"] in shown]
    rows += [row for row in own if (row["claim"], row["config"]) not in known]
    open_ = [(paper.readings, paper.claims) for paper in readings.papers().values()]
    return with_classes(rows, classes_of(open_, Path(out)))
