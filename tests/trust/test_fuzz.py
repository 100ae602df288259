"""Spoiled configs and spoiled files of plots: an answer or our own error in words, quickly and in little memory.

200 in all in the ordinary suite; `make slow` runs 100 000, each in limited time.
"""

import contextlib
import io
import itertools
import math
import random
import resource
import time

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.cli.command_group import main
from radarsim.config.experiment import Experiment
from radarsim.config.find_files import SHIPPED
from radarsim.errors import ConfigError

CASES, RELEASE = 200, 100_000
SECONDS, MEGABYTES = 2.0, 300
CONFIGS = sorted((SHIPPED / "configs").glob("*.yaml"))
SCENARIOS = sorted((SHIPPED / "scenarios").glob("*.yaml"))
WORDS = "0 -1 1 2 0.5 1e5 1e9 1e18 1e19 1e-300 1e308 1e309 -0.0 .nan -.inf 1_000 0x10 010 1:30 12e -9e99 null true"
NUMBERS = [*WORDS.split(), "9" * 40, "0." + "0" * 60 + "1", "[]", "{}", "''", "*a", "&a 1", "!!python/name:os.system x"]
SCRAPS = [
    *"{}[]:,-\n\t#|>'\"%\x00\x85\ufeffé~٣",
    "- ",
    "  ",
    "<<: ",
    "---\n",
    "? ",
    "\r\n",
    "\u2028",
    "sweep: {scans: [3, 4]}\n",
]
SCRAPS += ["include: [rls2]\n", "target: turn\n", "  name: x\n", "a" * 300, "[" * 200, "- &a [*a]\n"]


def spoiled(rng: random.Random, text: str) -> str:
    """The text with a few changes of the kinds that hands and disks make."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        lines = text.split("\n")
        place, line = rng.randrange(len(text) + 1), rng.randrange(len(lines))
        match rng.randrange(8):
            case 0:
                text = text[:place] + rng.choice(SCRAPS) + text[place + rng.choice((0, 0, 1, 5, 40)) :]
            case 1:
                text = with_number(rng, text)
            case 2:
                text = text[:place] + text[place + rng.randrange(1, 30) :]
            case 3:
                lines[line : line + 1] = []
                text = "\n".join(lines)
            case 4:
                lines.insert(rng.randrange(len(lines) + 1), lines[line])
                text = "\n".join(lines)
            case 5:
                lines[line] = " " * rng.randrange(5) + lines[line].lstrip()
                text = "\n".join(lines)
            case 6:
                text = (
                    text[:place] + chr(rng.choice((rng.randrange(32, 127), rng.randrange(0xD800)))) + text[place + 1 :]
                )
            case _:
                text = with_number(rng, with_number(rng, text))
    return text


def with_number(rng: random.Random, text: str) -> str:
    """The text with one of its numbers replaced."""
    starts = [
        i for i in range(len(text)) if text[i].isdigit() and not (i and (text[i - 1].isalnum() or text[i - 1] == "."))
    ]
    if not starts:
        return text
    start = stop = rng.choice(starts)
    while stop < len(text) and (text[stop].isalnum() or text[stop] in ".-+"):
        stop += 1
    return text[:start] + rng.choice(NUMBERS) + text[stop:]


class Budget:
    """Watches that a case takes no longer than `seconds` of CPU, and that all together do not swell the process."""

    def __init__(self, seconds: float):
        self.seconds = seconds
        self.slowest, self.begun = 0.0, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    def timed(self, case, *arguments):
        start = time.thread_time()
        case(*arguments)
        taken = time.thread_time() - start
        assert taken < self.seconds, f"{taken:.1f} s for {arguments!r}"
        self.slowest = max(self.slowest, taken)

    def grown_mb(self) -> float:
        return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - self.begun) / 1024


def loaded(folder, seed: int):
    """A shipped config, or a scenario that it refers to, spoiled and loaded; sometimes an override beside."""
    rng = random.Random(seed)
    config = rng.choice(CONFIGS)
    source = folder / "own.yaml"
    overrides = []
    if rng.random() < 0.25:
        scenario = rng.choice(SCENARIOS)
        (folder / scenario.name).write_text(spoiled(rng, scenario.read_text("utf-8")), "utf-8", "surrogatepass")
        overrides = [f"target={scenario.stem}"]
        text = config.read_text("utf-8")
    else:
        text = spoiled(rng, config.read_text("utf-8"))
    if rng.random() < 0.2:
        overrides.append(spoiled(rng, rng.choice(("scans=5", "realisations=10", "seed=1", "sweep.scans=[3, 4]"))))
    source.write_bytes(text.encode("utf-8", "surrogatepass")[: rng.choice((None, None, None, 200))])
    lines = ["no fault"]
    try:
        assert isinstance(load(source, overrides), Experiment)
    except ConfigError as error:
        lines = error.lines
    assert lines
    assert all(line.isprintable() and len(line) < 2000 for line in lines), lines


LOCAL = "sensor={sigma_x_m: 20, sigma_y_m: 20, sigma_z_m: 20, scan_period_s: 0.5}"
TRACKED = {
    "sonar": ("sonar_smoothing", (), ("range_m", "bearing_rad")),
    "sonar, converted": ("sonar_smoothing", ("frame=cartesian_unbiased",), ("range_m", "bearing_rad")),
    "multimodel": ("multimodel", (LOCAL,), ("x_m", "y_m", "z_m")),
    "multimodel, angles": ("multimodel", (), ("range_m", "elevation_rad", "azimuth_rad")),
}


def plots_of(names, rows: int = 9) -> str:
    """A file of plots as a sensor gives them, one of its cells empty."""
    t = 0.5 * np.arange(rows)
    of = {"range_m": 9e3 - 40 * t, "velocity_mps": t - 40, "x_m": 8e4 - 60 * t, "y_m": 6e3 + t, "z_m": -4e4 + 2 * t}
    columns = [t, *(of.get(name, 0.1 + 0.001 * t) for name in names)]
    cells = [["" if (i, j) == (4, 1) else f"{column[i]:.6g}" for j, column in enumerate(columns)] for i in range(rows)]
    return "\n".join([",".join(("t_s", *names)), *(",".join(row) for row in cells), ""])


SAID = io.StringIO()


def command(*arguments) -> tuple[int, str]:
    """The exit code of `radarsim` in this process, and what it said; raises whatever it does not answer for.

    All goes to one stream, emptied each time: click keeps every stream that it has ever written to (its caches map a
    stream weakly to itself), 1.5 kB and what was written for each that its own test runner makes.
    """
    SAID.seek(0)
    SAID.truncate()
    with contextlib.redirect_stdout(SAID), contextlib.redirect_stderr(SAID):
        try:
            main([str(one) for one in arguments])
        except SystemExit as ended:
            return ended.code or 0, SAID.getvalue()
    raise AssertionError("returned without an exit code")


def tracked(folder, seed: int):
    """A file of plots spoiled and filtered by the command: done, refused with a line, or told to be not finite."""
    rng = random.Random(seed)
    config, overrides, names = TRACKED[rng.choice(sorted(TRACKED))]
    text = plots_of(names)
    if rng.random() < 0.98:
        text = spoiled(rng, text)
    (folder / "plots.csv").write_bytes(text.encode("utf-8", "surrogatepass")[: rng.choice((None, None, None, 60))])
    options = itertools.chain.from_iterable(("--set", override) for override in overrides)
    output = folder / "track.csv"
    output.unlink(missing_ok=True)
    code, said = command("track", config, folder / "plots.csv", "-o", output, *options)
    assert code in (0, 2, 5), said
    assert output.exists() == (code == 0)
    if code:
        assert all(line.isprintable() for line in said.splitlines())
        assert "plots.csv" in said or code == 5, said
    else:
        assert not any(word in output.read_text() for word in ("nan", "inf"))


def fuzz(case, folder, seeds, seconds=math.inf):
    budget = Budget(seconds)
    for seed in seeds:
        try:
            budget.timed(case, folder, seed)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {error!r}") from error
    assert budget.grown_mb() < MEGABYTES
    return budget


@pytest.fixture
def warm(tmp_path):
    """Everything imported and compiled before the clock runs."""
    loaded(tmp_path, 0)
    for config, overrides, names in TRACKED.values():
        (tmp_path / "plots.csv").write_text(plots_of(names))
        options = itertools.chain.from_iterable(("--set", override) for override in overrides)
        code, said = command("track", config, tmp_path / "plots.csv", *options)
        assert code == 0, said
        assert said.count("\n") > 9
    return tmp_path


@pytest.mark.slow_cases("tracked")
@pytest.mark.parametrize("case", [loaded, tracked])
def test_spoiled_input(case, warm):
    fuzz(case, warm, range(CASES // 2))


@pytest.mark.slow
@pytest.mark.parametrize("case", [loaded, tracked])
def test_spoiled_input_of_a_release(case, warm):
    """Other cases than those of the ordinary suite."""
    fuzz(case, warm, range(10**6, 10**6 + RELEASE // 2), SECONDS)
