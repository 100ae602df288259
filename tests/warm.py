"""The command in a process of its own, forked from one that has its imports: a second less than a fresh interpreter.

Streams, exit code, working directory, environment, memory and signals are those of any process. Only what Python and
its libraries read when they start is that of the first process: where this is tested, and for the seed of hashes, a
test starts a fresh interpreter.
"""

import json
import os
import runpy
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
IMPORTS = (  # most of what commands import
    *("numba", "pandas", "scipy.linalg", "scipy.special", "jinja2", "rich.console", "rich.table"),
    *("radarsim.cli", "radarsim.app.run", "radarsim.app.result", "radarsim.app.readings", "radarsim.report.html"),
    *("radarsim.kernels.linear", "radarsim.kernels.lanes"),
)
LIMIT_S = 300


class Start:
    """A process that has imported the program; what is given here is its surroundings and those of all commands."""

    def __init__(self, place: Path, *, path: tuple[Path, ...] = (), preexec_fn=None, **environment: str):
        """`place`: where commands leave what they print; `path`: folders of packages before those installed."""
        self.printed = place / "stdout", place / "stderr"
        self.process = subprocess.Popen(
            [sys.executable, __file__],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (*path, ROOT)))} | environment,
            preexec_fn=preexec_fn,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> "Start":
        return self

    def __exit__(self, *_) -> None:
        self.process.communicate()

    def run(self, *words, module: str = "radarsim", cwd: Path = ROOT, **environment: str):
        """`python -m MODULE WORDS` as this process forks it; what it answers."""
        argv = [str(word) for word in words]
        asked = {"module": module, "argv": argv, "cwd": str(cwd), "environment": environment}
        asked["printed"] = [str(path) for path in self.printed]
        print(json.dumps(asked), file=self.process.stdin, flush=True)
        code = int(self.process.stdout.readline())
        said = [path.read_text(encoding="utf-8") for path in self.printed]
        return subprocess.CompletedProcess([module, *argv], code, *said)


def forked() -> dict | None:
    """Fork a process for each request and answer with its exit code; returns the request in that process."""
    for module in IMPORTS:
        import_module(module)
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        if child := os.fork():
            print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), file=answers, flush=True)
        else:
            return json.loads(line)
    return None


def become(asked: dict) -> None:
    """Be the process that was asked for."""
    os.chdir(asked["cwd"])
    os.environ.update(asked["environment"])
    for number, file in enumerate((os.devnull, *asked["printed"])):
        opened = os.open(file, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.argv[1:], sys.path[0] = asked["argv"], asked["cwd"]
    signal.alarm(LIMIT_S)
    runpy.run_module(asked["module"], run_name="__main__", alter_sys=True)


if __name__ == "__main__" and (asked := forked()):
    become(asked)
