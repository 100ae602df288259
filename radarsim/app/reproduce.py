"""`make reproduce-figures`: every shipped config at full size, a line for each, and the verdicts on the papers' claims.

Two processes share the configs, so that one computes while the other draws: drawing keeps a single core busy, and takes
about as long as computing. They are new processes, which read a line of JSON for each config and answer with one; the
store is safe with both. One works from the first config on, the other backwards from the last: configs with similar
names are mostly of one study, and both would compile its kernels at the same time.

`radarsim new-study`: a package with a small complete study. It is a copy of radarsim/app/one_file, with the files of
radarsim/app/one_step in place of its own, or of radarsim/app/template, under another name; these packages work as they
stand, and are linted and tested. Nothing is overwritten.
"""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import packages_distributions
from keyword import iskeyword, issoftkeyword
from pathlib import Path
from queue import SimpleQueue

from radarsim.app import run as experiment
from radarsim.app.configs import document as lookup
from radarsim.config.document import one_line
from radarsim.engine.run import Signals
from radarsim.errors import ConfigError, Interrupted, RadarsimError, StoreError
from radarsim.report.wording import clock, plural
from radarsim.studies import registry

# ---- reproduce -------------------------------------------------------------------------------------------------------
PROCESSES = 2
LOOK_S = 0.1  # interval at which signals are checked


@dataclass(frozen=True)
class Done:
    """A finished config: seconds, summary; its faults and their exit code, if any.

    stages: the seconds of simulation, drawing and writing; the rest is statistics.
    """

    stem: str
    seconds: float
    summary: str
    faults: tuple[str, ...] = ()
    code: int = 0
    stages: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """A task for a process: a config by name, the output directory, and options."""

    stem: str
    out: str
    overrides: tuple[str, ...] = ()
    figures: bool = True


def reproduce(
    stems: Sequence[str],
    out: str,
    say: Callable[[str], None],
    stop: Signals | None = None,
    overrides: Sequence[str] = (),
    figures: bool = True,
) -> list[Done]:
    """Run every config and report a line as each finishes; a fault of one does not stop the others.

    Raises Interrupted, with all finished work stored, on a signal seen by `stop`.
    """
    done: list[Done] = []
    tasks = [Task(stem, str(out), tuple(overrides), figures) for stem in stems]
    for one in _finished(tasks, stop):
        done.append(one)
        say(f"[{len(done):>2}/{len(stems)}] {one.stem:<26} {one.seconds:6.1f} s  {one.summary}")
    return done


def _finished(tasks: Sequence[Task], stop: Signals | None) -> Iterator[Done]:
    """Finished configs as they come, from processes that have ended afterwards."""
    count = min(PROCESSES, len(tasks))
    idle: SimpleQueue[_Process] = SimpleQueue()
    processes = [_Process() for _ in range(count)]
    for process in processes:
        idle.put(process)
    waiting = deque(tasks)

    def run() -> Done:
        process = idle.get()
        task = waiting.popleft() if process is processes[0] else waiting.pop()
        try:
            return process.done(task)
        finally:
            idle.put(process)

    with ThreadPoolExecutor(max(1, count)) as pool:
        pending: set[Future[Done]] = {pool.submit(run) for _ in tasks}
        try:
            while pending:
                ready, pending = wait(pending, LOOK_S, FIRST_COMPLETED)
                if stop is not None:
                    stop.raise_if_received()
                yield from (future.result() for future in ready)
        finally:
            for future in pending:
                future.cancel()
            for process in processes:
                process.stop(at_once=bool(pending))
            for process in processes:
                process.wait()


class _Process:
    """A process that runs one config after another; in its own session, so that Ctrl-C reaches only the parent."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ended = False
        self._start()

    def _start(self) -> None:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [sys.executable, "-c", "from radarsim.app.reproduce import answer; answer()"]
        self._popen = subprocess.Popen(
            command, env=environment, start_new_session=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._popen.stdin is not None
        assert self._popen.stdout is not None
        self._requests, self._answers = self._popen.stdin, self._popen.stdout

    def done(self, task: Task) -> Done:
        """Run a config in it. If the process dies, that is reported as the config's fault, and a new one is started."""
        began = time.perf_counter()
        with suppress(OSError):
            self._requests.write(json.dumps(asdict(task)) + "\n")
            self._requests.flush()
        if line := self._answers.readline():
            answered = json.loads(line)
            return Done(**answered | {"faults": tuple(answered["faults"])})
        code = self._popen.wait()
        with self._lock:
            if not self._ended:
                self._answers.close()
                self._close_stdin()
                self._start()
        fault = f"{task.stem}: its process ended with {code}; run it again, what it finished is stored"
        return Done(task.stem, time.perf_counter() - began, f"FAILED: {fault}", (fault,), 1)

    def stop(self, at_once: bool) -> None:
        """End it: at once, storing finished blocks, or else after the current config."""
        with self._lock:
            self._ended = True
            if at_once:
                self._popen.terminate()
            self._close_stdin()

    def wait(self) -> None:
        """Until it has ended."""
        self._popen.wait()
        self._answers.close()

    def _close_stdin(self) -> None:
        with suppress(OSError):  # a config that it never read
            self._requests.close()


def answer() -> None:
    """The program of a process: reads a Task from each line of stdin, writes a Done to stdout for each."""
    threading.Thread(target=_follow, args=(os.getppid(),), daemon=True).start()
    with Signals() as stop:
        try:
            for line in sys.stdin:
                asked = json.loads(line)
                done = _run(Task(**asked | {"overrides": tuple(asked["overrides"])}), stop)
                sys.stdout.write(json.dumps(asdict(done)) + "\n")
                sys.stdout.flush()
        except Interrupted as ended:
            os._exit(ended.exit_code)  # as the command does: the sender of the signal need not wait for an orderly end
        except BrokenPipeError:  # the parent is gone
            os._exit(1)


def _follow(parent: int) -> None:
    """End this process, which stores its finished blocks, once its parent is gone."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os.kill(os.getpid(), signal.SIGTERM)


def _run(task: Task, stop: Signals) -> Done:
    from radarsim.report.claims import page

    started = time.perf_counter()
    faults: tuple[str, ...] = ()
    code = 0
    stages: dict[str, float] = {}
    try:
        result = experiment.run(task.stem, overrides=task.overrides, out=task.out, stop=stop, figures=task.figures)
        verdicts = ", ".join(page.of_class(kind, len(names)) for kind, names in result.verdicts().items())
        drawn = sum(name.endswith(".svg") for name in result.written.files) if result.written else 0
        made = [plural(drawn, "figure")] if task.figures else []
        made += [f"claims: {verdicts}"] if verdicts else []
        stages = {"simulation": result.facts["seconds"]} | dict(result.written.seconds if result.written else {})
    except Interrupted:
        raise
    except RadarsimError as error:
        made, faults, code = [f"FAILED: {error.lines[0]}"], error.lines, error.exit_code
    return Done(task.stem, time.perf_counter() - started, "; ".join(made), faults, code, stages)


def summary(done: Sequence[Done], out: str, seconds: float) -> list[str]:
    """The closing lines: claims by verdict, time, where the results are."""
    from radarsim.report import html
    from radarsim.report.claims import page

    html.write(Path(out))  # two processes may have written it at once, one without the other's run
    rows = experiment.claims(out=out).rows
    classes, _ = page.counts(rows)
    longest = max(done, key=lambda one: one.seconds)
    failed = [one.stem for one in done if one.faults]
    guide = Path(out) / "README.md"
    hint = f"; {guide} says what lies where" if guide.is_file() else ""
    return [
        "",
        f"claims   {sum(classes.values())}: {page.counted(rows)}",
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
ONE_FILE, ONE_STEP, TEMPLATE = (Path(__file__).parent / name for name in ("one_file", "one_step", "template"))
FORMS = {"linear": (ONE_FILE,), "step": (ONE_FILE, ONE_STEP), "folder": (TEMPLATE,)}  # files of a later folder win
MODULE = "random_walk"  # the name that the templates have
SUFFIXES = (".md", ".py", ".toml", ".yaml")
PLAIN = re.compile(r"[a-z][a-z0-9_]{0,39}")


def new_study(name: str, folder: str | os.PathLike = ".", form: str = "linear") -> Path:
    """Write the package folder/NAME with a study called NAME, in one of `FORMS`; its path.

    Raises ConfigError for a name that cannot be a new module's, and where something of that name exists; StoreError
    where it cannot be written.
    """
    if fault := unfit(name):
        raise ConfigError(f"{one_line(name)}: {fault}")
    path = Path(folder) / name
    try:
        path.mkdir()
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
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
