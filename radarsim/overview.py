"""What running an experiment would take, and what there is to run."""

import time
from dataclasses import dataclass
from pathlib import Path

from radarsim import studies
from radarsim.config import lookup
from radarsim.config.load import Experiment
from radarsim.engine.executors import available_cores

PILOT_S = 0.3


@dataclass(frozen=True)
class CaseOutlook:
    """What running a case would take: labels, counts, seconds of one thread's work."""

    name: str
    filters: str
    scans: int
    realisations: int
    seconds: float


@dataclass(frozen=True)
class Outlook:
    """What running an experiment would take, on `threads` threads."""

    cases: tuple[CaseOutlook, ...]
    threads: int
    seconds: float
    memory_mb: float


def outlook(experiment: Experiment, threads: int | None = None) -> Outlook:
    """Prepare every case and time a few realisations of it, compiled beforehand, and say what the whole would take."""
    threads = threads or available_cores()
    cases, largest, preparing = [], 0, 0.0
    for case in experiment.cases:
        work = studies.CaseWork(case)
        work.simulate(0, 1)
        started = time.perf_counter()
        studies.study(case.study).prepare(case)
        preparing += time.perf_counter() - started
        seconds = seconds_each(work, case.realisations) * case.realisations
        axes = work.plan.axes
        cases.append(CaseOutlook(case.name, ", ".join(axes.filters), len(axes.k), case.realisations, seconds))
        largest = max(largest, work.size)
    # Vectors of sums in flight: two a thread, one a level of the tree; beside them the interpreter and its libraries.
    memory = 200 + 8e-6 * largest * (2 * threads + 32)
    return Outlook(tuple(cases), threads, preparing + sum(c.seconds for c in cases) / threads, memory)


def seconds_each(work: studies.CaseWork, realisations: int) -> float:
    """Seconds of one thread for one realisation: of a block, or of as many as a third of a second allows."""
    alone = timed(work, 1)
    count = work.block if alone * work.block < PILOT_S else max(1, int(PILOT_S / alone))
    count = min(count, work.block, realisations)
    return min(timed(work, count) for _ in range(2)) / count


def timed(work: studies.CaseWork, count: int) -> float:
    """Seconds that `count` realisations take."""
    started = time.perf_counter()
    work.simulate(0, count)
    return time.perf_counter() - started


def described(file: Path) -> str:
    """The first words of a YAML file's leading comment, without its own name."""
    with file.open(encoding="utf-8") as lines:
        for line in lines:
            words = line.lstrip("#").strip()
            if not line.startswith("#"):
                break
            if not words.startswith("yaml-language-server"):
                return words.partition(" — ")[2] or words
    return ""


def inventory() -> list[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
    """What `radarsim list` shows: title, columns and rows of each kind of thing at hand."""
    configs = [(stem, described(lookup.config_file(stem))) for stem in lookup.stems("configs")]
    scenarios = [(stem, described(lookup.scenario_file(stem, None))) for stem in lookup.stems("scenarios")]
    about = [(name, (studies.study(name).__doc__ or "").split("\n")[0]) for name in studies.STUDIES]
    filters = [(name, key, words) for name in studies.STUDIES for key, words in studies.study(name).FILTERS.items()]
    return [
        ("Configs (radarsim run NAME)", ("name", "what it is"), configs),
        ("Scenarios (target: NAME)", ("name", "what it is"), scenarios),
        ("Studies (study: NAME)", ("name", "paper and question"), about),
        ("Filters", ("study", "keys", "what it is"), filters),
    ]
