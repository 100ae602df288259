"""`make reproduce-figures`: every shipped config at full size, a line for each, and the verdicts on the papers' claims.

Two processes share the configs, so that one computes while the other draws: drawing keeps a single core busy, and takes
about as long as computing; the store is safe with both. Configs are taken from both ends of the list: those with
similar names are mostly of one study, and both processes would compile its kernels at the same time.

`radarsim new-study`: a package with a small complete study. It is a copy of radarsim/app/one_file under another name,
with --step with the files of radarsim/app/one_step in place of its own; these packages work as they stand, and are
linted and tested. Nothing is overwritten."""

import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import packages_distributions
from itertools import zip_longest
from keyword import iskeyword, issoftkeyword
from multiprocessing import active_children, get_context
from pathlib import Path

from radarsim.app import run as experiment
from radarsim.app.configs import document as lookup
from radarsim.config.document import one_line
from radarsim.engine.run import Signals
from radarsim.errors import ConfigError, Interrupted, RadarsimError, StoreError
from radarsim.extensions import extensions
from radarsim.private_files import create_readable_file, make_readable_folder
from radarsim.report.wording import clock, plural
from radarsim.studies import registry

# ---- reproduce -------------------------------------------------------------------------------------------------------
PROCESSES = 2
LOOK_S = 0.1  # interval at which signals are checked


@dataclass(frozen=True)
class Done:
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
    say: Callable[[str], None],
    stop: Signals | None = None,
    overrides: Sequence[str] = (),
    figures: bool = True,
) -> list[Done]:
    """Run every config and report a line as each finishes; a fault of one does not stop the others. Raises Interrupted,
    with all finished work stored, on a signal seen by `stop`."""
    done: list[Done] = []
    for one in _finished(partial(_run, str(out), tuple(overrides), figures), from_both_ends(stems), stop):
        done.append(one)
        say(f"[{len(done):>2}/{len(stems)}] {one.stem:<26} {one.seconds:6.1f} s  {one.summary}")
    return done


def from_both_ends(stems: Sequence[str]) -> list[str]:
    """The first, the last, the second, the last but one, …"""
    half = (len(stems) + 1) // 2
    return [one for pair in zip_longest(stems[:half], stems[half:][::-1]) for one in pair if one]


def _finished(work: Callable[[str], Done], stems: Sequence[str], stop: Signals | None) -> Iterator[Done]:
    """Finished configs as they come, from processes that have ended afterwards. If a process dies, a single one does
    the rest: the config with which that dies too is at fault."""
    waiting, count = list(stems), PROCESSES
    while waiting:
        with ProcessPoolExecutor(min(count, len(waiting)), get_context("spawn"), _begin) as pool:
            pending = {pool.submit(work, stem) for stem in waiting}
            try:
                while pending:
                    ready, pending = wait(pending, LOOK_S, FIRST_COMPLETED)
                    if stop is not None:
                        stop.raise_if_received()
                    for future in ready:
                        waiting.remove((one := future.result()).stem)
                        yield one
            except BrokenProcessPool:
                if count == 1:
                    fault = f"{waiting[0]}: its process ended; run it again, what it finished is stored"
                    yield Done(waiting.pop(0), 0.0, f"FAILED: {fault}", (fault,), 1)
                count = 1
            finally:
                for child in active_children() if waiting else ():
                    child.terminate()
                pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """In a process, which runs one config after another: in its own session, so that Ctrl-C reaches only the parent."""
    os.setsid()
    threading.Thread(target=_follow, args=(os.getppid(),), daemon=True).start()


def _follow(parent: int) -> None:
    """End this process, which stores its finished blocks, once its parent is gone."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os.kill(os.getpid(), signal.SIGTERM)


def _run(out: str, overrides: Sequence[str], figures: bool, stem: str) -> Done:
    started = time.perf_counter()
    faults: tuple[str, ...] = ()
    code = 0
    stages: dict[str, float] = {}
    try:
        with Signals() as stop:
            result = experiment.run(stem, overrides=overrides, out=out, stop=stop, figures=figures)
        drawn = sum(name.endswith(".svg") for name in result.written.files) if result.written else 0
        made = [plural(drawn, "figure")] if figures else []
        made += [line for extension in extensions() if (line := extension.result_summary(result))]
        stages = {"simulation": result.facts["seconds"]} | dict(result.written.seconds if result.written else {})
    except Interrupted as ended:
        os._exit(ended.exit_code)  # as the command does: the sender of the signal need not wait for an orderly end
    except RadarsimError as error:
        made, faults, code = [f"FAILED: {error.lines[0]}"], error.lines, error.exit_code
    return Done(stem, time.perf_counter() - started, "; ".join(made), faults, code, stages)


def summary(done: Sequence[Done], out: str, seconds: float) -> list[str]:
    """The closing lines: what extensions say, time, where the results are."""
    from radarsim.report import html

    html.write_index(Path(out))  # two processes may have written it at once, one without the other's run
    longest = max(done, key=lambda one: one.seconds)
    failed = [one.stem for one in done if one.faults]
    guide = Path(out) / "README.md"
    hint = f"; {guide} says what lies where" if guide.is_file() else ""
    return [
        "",
        *(line for extension in extensions() for line in extension.overall_summary(out)),
        f"time     {clock(seconds)} for {plural(len(done), 'config')}, "
        f"the longest {longest.stem}, {longest.seconds:.0f} s",
        *_stages(done),
        f"where    {Path(out) / 'index.html'} leads to every report{hint}",
        *([f"failed   {', '.join(failed)}"] if failed else []),
    ]


def _stages(done: Sequence[Done]) -> list[str]:
    """A line on the time spent, added up over both processes; none where nothing was run."""
    of = {name: sum(one.stages.get(name, 0.0) for one in done) for name in ("simulation", "drawing", "writing")}
    whole = sum(one.seconds for one in done if one.stages)
    if not whole:
        return []
    of = {"simulation": of["simulation"], "statistics": whole - sum(of.values())} | of
    parts = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in of.items())
    return [f"         {parts}: added up over {PROCESSES} processes"]


# ---- new study -------------------------------------------------------------------------------------------------------
ONE_FILE, ONE_STEP = (Path(__file__).parent / name for name in ("one_file", "one_step"))
FORMS = {"linear": (ONE_FILE,), "step": (ONE_FILE, ONE_STEP)}  # files of a later folder win
MODULE = "random_walk"  # the name that the templates have
SUFFIXES = (".md", ".py", ".toml", ".yaml")
PLAIN = re.compile(r"[a-z][a-z0-9_]{0,39}")


def new_study(name: str, folder: str | os.PathLike = ".", form: str = "linear") -> Path:
    """Write the package folder/NAME with a study called NAME, in one of `FORMS`; its path.

    Raises ConfigError for a name that cannot be a new module's, and where something of that name exists; StoreError
    where it cannot be written."""
    if fault := unfit(name):
        raise ConfigError(f"{one_line(name)}: {fault}")
    path = Path(folder) / name
    try:
        path.mkdir(mode=0o755)
    except FileExistsError:
        raise ConfigError(f"{path}: already exists and is never overwritten; choose another name") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    for place, file in files(form).items():
        _write(path / renamed(place, name), renamed(file.read_text("utf-8"), name))
    return path


def unfit(name: str) -> str | None:
    """Why a name is unusable for a new study, its package and its first config; None where it is usable."""
    if not PLAIN.fullmatch(name) or iskeyword(name) or issoftkeyword(name) or name in ("true", "false", "null"):
        of = "a small letter, then at most 39 small letters, digits and _; no word of Python or YAML"
        return f"must be a module's name: {of}"
    if name in registry.names():
        return "there is a study of this name already; choose another"
    if name in sys.stdlib_module_names or name == "tests" or name in packages_distributions():
        return "there is a Python module of this name already; choose another"
    if found := lookup.config_file(name):
        return f"there is a config of this name already, {found}; choose another"
    return None


def files(form: str) -> dict[str, Path]:
    """The files of a form by their paths in the package, in order."""
    found = {
        file.relative_to(folder).as_posix(): file
        for folder in FORMS[form]
        for file in folder.rglob("*")
        if file.suffix in SUFFIXES
    }
    return dict(sorted(found.items()))


def renamed(text: str, name: str) -> str:
    """A text of the template with another study's name."""
    return text.replace(MODULE, name)


def _write(path: Path, text: str) -> None:
    try:
        make_readable_folder(path.parent)
        with create_readable_file(path) as file:
            file.write(text.encode())
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
