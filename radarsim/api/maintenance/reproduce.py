"""`make reproduce-figures`: every shipped config at full size, a line for each, and a summary.

Two processes share the configs, so that one computes while the other draws: drawing keeps a single core busy, and takes
about as long as computing; the store is safe with both. Configs are taken from both ends of the list: those with
similar names are mostly of one study, and both processes would compile its kernels at the same time."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from functools import partial
from itertools import zip_longest
from multiprocessing import active_children, get_context
from pathlib import Path

from radarsim.api import run
from radarsim.engine.stop_conditions import Signals
from radarsim.errors import Interruption, RadarsimError
from radarsim.extensions import extensions
from radarsim.report.output_labels import clock
from radarsim.report.wording import plural

PROCESSES = 2
SIGNAL_CHECK_S = 0.1  # interval at which signals are checked


@dataclass(frozen=True)
class FinishedConfig:
    """A finished config: seconds, summary; its faults and their exit code, if any.

    stages: the seconds of simulation, drawing and writing; the rest is statistics."""

    stem: str
    seconds: float
    summary: str
    faults: tuple[str, ...] = ()
    code: int = 0
    stages: Mapping[str, float] = field(default_factory=dict)


def reproduce(
    stems: Sequence[str],
    out: str,
    print_line: Callable[[str], None],
    stop: Signals | None = None,
    overrides: Sequence[str] = (),
    figures: bool = True,
) -> list[FinishedConfig]:
    """Run every config and report a line as each finishes; a fault of one does not stop the others. Raises Interrupted,
    with all finished work stored, on a signal seen by `stop`."""
    done: list[FinishedConfig] = []
    for config in _run_configs(partial(_run_config, str(out), tuple(overrides), figures), from_both_ends(stems), stop):
        done.append(config)
        print_line(f"[{len(done):>2}/{len(stems)}] {config.stem:<26} {config.seconds:6.1f} s  {config.summary}")
    return done


def from_both_ends(stems: Sequence[str]) -> list[str]:
    """Stems in the order first, last, second, last but one, …"""
    half = (len(stems) + 1) // 2
    return [stem for pair in zip_longest(stems[:half], stems[half:][::-1]) for stem in pair if stem]


def _run_configs(
    work: Callable[[str], FinishedConfig], stems: Sequence[str], stop: Signals | None
) -> Iterator[FinishedConfig]:
    """Yield configs as they finish, from processes that all end before this returns.

    If a process dies, a single one runs what is left: the config with which it dies too is at fault."""
    waiting, count = list(stems), PROCESSES
    while waiting:
        with ProcessPoolExecutor(min(count, len(waiting)), get_context("spawn"), _start_process) as pool:
            pending = {pool.submit(work, stem) for stem in waiting}
            try:
                while pending:
                    ready, pending = wait(pending, SIGNAL_CHECK_S, FIRST_COMPLETED)
                    if stop is not None:
                        stop.raise_if_received()
                    for future in ready:
                        waiting.remove((finished := future.result()).stem)
                        yield finished
            except BrokenProcessPool:
                if count == 1:
                    fault = f"{waiting[0]}: its process ended; run it again, what it finished is stored"
                    yield FinishedConfig(waiting.pop(0), 0.0, f"FAILED: {fault}", (fault,), 1)
                count = 1
            finally:
                for child in active_children() if waiting else ():
                    child.terminate()
                pool.shutdown(cancel_futures=True)


def _start_process() -> None:
    """Give a process of the pool its own session, so that Ctrl-C reaches only the parent, and let it end with that."""
    os.setsid()
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()


def _end_with_parent(parent: int) -> None:
    """End this process, which then stores its finished blocks, once its parent has ended."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os.kill(os.getpid(), signal.SIGTERM)


def _run_config(out: str, overrides: Sequence[str], figures: bool, stem: str) -> FinishedConfig:
    started = time.perf_counter()
    faults: tuple[str, ...] = ()
    code = 0
    stages: dict[str, float] = {}
    try:
        with Signals() as stop:
            result = run.run(stem, overrides=overrides, out=out, stop=stop, figures=figures)
        figure_count = sum(name.endswith(".svg") for name in result.written.files) if result.written else 0
        parts = [plural(figure_count, "figure")] if figures else []
        parts += [line for extension in extensions() if (line := extension.result_summary(result))]
        stages = {"simulation": result.facts["seconds"]} | dict(result.written.seconds if result.written else {})
    except Interruption as interrupt:
        os._exit(
            interrupt.exit_code
        )  # as the command does: the sender of the signal should not wait for an orderly end
    except RadarsimError as error:
        parts, faults, code = [f"FAILED: {error.lines[0]}"], error.lines, error.exit_code
    return FinishedConfig(stem, time.perf_counter() - started, "; ".join(parts), faults, code, stages)


def summary(done: Sequence[FinishedConfig], out: str, seconds: float) -> list[str]:
    """The closing lines: those of extensions, the time, where the results are, which configs failed."""
    from radarsim.report import index_page

    index_page.write_index(Path(out))  # two processes may have written it at once, one without the other's run
    longest = max(done, key=lambda config: config.seconds)
    failed = [config.stem for config in done if config.faults]
    guide = Path(out) / "README.md"
    hint = f"; {guide} says what lies where" if guide.is_file() else ""
    return [
        "",
        *(line for extension in extensions() for line in extension.overall_summary(out)),
        f"time     {clock(seconds)} for {plural(len(done), 'config')}, "
        f"the longest {longest.stem}, {longest.seconds:.0f} s",
        *_stage_lines(done),
        f"where    {Path(out) / 'index.html'} leads to every report{hint}",
        *([f"failed   {', '.join(failed)}"] if failed else []),
    ]


def _stage_lines(done: Sequence[FinishedConfig]) -> list[str]:
    """A line on the time of each stage, added up over both processes; none where nothing was run."""
    seconds_by_stage = {
        name: sum(config.stages.get(name, 0.0) for config in done) for name in ("simulation", "drawing", "writing")
    }
    total = sum(config.seconds for config in done if config.stages)
    if not total:
        return []
    seconds_by_stage = {
        "simulation": seconds_by_stage["simulation"],
        "statistics": total - sum(seconds_by_stage.values()),
    } | seconds_by_stage
    parts = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in seconds_by_stage.items())
    return [f"         {parts}: added up over {PROCESSES} processes"]
