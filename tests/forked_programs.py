"""A program in a process of its own, forked from one that has its imports: a second less than a fresh interpreter.

Streams, exit code, working directory, environment, memory and signals are those of any process. Only what Python and
its libraries read when they start is that of the first process: where this is tested, and for the seed of hashes, a
test starts a fresh interpreter.
"""

import gc
import json
import os
import pkgutil
import runpy
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIBRARIES = (  # most of what commands import
    *("numba", "pandas", "scipy.linalg", "scipy.special", "jinja2", "rich.console", "rich.table"),
    *("pydantic", "yaml", "click"),
)
PARTS = ("api", "cli", "kernels", "report", "studies")  # of radarsim
APART = ("__main__", "one_file", "one_step", "reproduce")  # no command imports them
LIMIT_S = 300


class Start:
    """A process that has imported the libraries and, if asked, radarsim; what is given is the surroundings of all."""

    def __init__(
        self, place: Path, *, radarsim: bool = True, inherit: bool = True, preexec_fn=None, **environment: str
    ):
        """`place`: where programs leave what they print. `inherit`: the environment of this process, too."""
        self.printed = place / "stdout", place / "stderr"
        self.process = subprocess.Popen(
            [sys.executable, __file__, *PARTS[: len(PARTS) * radarsim]],
            env=(dict(os.environ) if inherit else {}) | {"PYTHONPATH": str(ROOT)} | environment,
            preexec_fn=preexec_fn,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> "Start":
        return self

    def __exit__(self, *_) -> None:
        self.process.communicate()

    def run(self, *words, module: str = "radarsim", code: str = "", path=(), cwd: Path = ROOT, **environment: str):
        """`python -m MODULE WORDS`, or `-c CODE WORDS`, as this process forks it; what it answers.

        `path`: folders before those of installed packages.
        """
        path, argv = [str(folder) for folder in path], [str(word) for word in words]
        environment = {"PYTHONPATH": os.pathsep.join((*path, str(ROOT)))} | environment
        asked = {"module": module, "code": code, "argv": argv, "path": path, "cwd": str(cwd)}
        asked |= {"environment": environment, "printed": [str(file) for file in self.printed]}
        print(json.dumps(asked), file=self.process.stdin, flush=True)
        ended = int(self.process.stdout.readline())
        said = [file.read_text(encoding="utf-8", errors="surrogateescape") for file in self.printed]
        return subprocess.CompletedProcess([module, *argv], ended, *said)


def load(parts: list[str]) -> None:
    """Import the libraries, and the parts of radarsim that are named."""
    for name in LIBRARIES:
        import_module(name)
    for part in parts:
        for found in pkgutil.walk_packages([str(ROOT / "radarsim" / part)], f"radarsim.{part}."):
            if not set(APART) & set(found.name.split(".")):
                import_module(found.name)
    gc.freeze()


def forked() -> dict | None:
    """Fork a process for each request and answer with its exit code; returns the request in that process."""
    load(sys.argv[1:])
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
    sys.dont_write_bytecode = bool(os.environ.get("PYTHONDONTWRITEBYTECODE"))  # Python read it when it started
    for number, file in enumerate((os.devnull, *asked["printed"])):
        opened = os.open(file, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.argv[1:], sys.path[:1] = asked["argv"], [asked["cwd"], *asked["path"]]
    signal.alarm(LIMIT_S)
    if asked["code"]:
        exec(compile(asked["code"], "<string>", "exec"), {"__name__": "__main__"})
    else:
        runpy.run_module(asked["module"], run_name="__main__", alter_sys=True)


if __name__ == "__main__" and (asked := forked()):
    become(asked)
