"""`make reproduce-figures`: every shipped config at its full size, a line each, and what came of the papers' claims."""

import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from radarsim import console, experiment
from radarsim.config import lookup
from radarsim.config.load import Experiment
from radarsim.engine.stopping import Signals
from radarsim.errors import Interrupted, RadarsimError


@dataclass(frozen=True)
class Done:
    """One config: its seconds, and its faults if it could not be finished."""

    stem: str
    seconds: float
    faults: tuple[str, ...] = ()


def reproduce(
    experiments: Sequence[Experiment],
    out: str,
    say: Callable[[str], None],
    stop: Signals | None = None,
    figures: bool = True,
) -> list[Done]:
    """Run every experiment, telling a line as each is done; a fault of one does not keep the others from running."""
    done: list[Done] = []
    for number, one in enumerate(experiments, 1):
        started = time.perf_counter()
        try:
            result = experiment.run(one, out=out, stop=stop, figures=figures)
            verdicts = ", ".join(f"{len(names)} {verdict}" for verdict, names in result.verdicts().items())
            drawn = sum(name.endswith(".svg") for name in result.written.files)
            words = [console.plural(drawn, "figure")] if figures else []
            words, faults = [*words, *([f"claims: {verdicts}"] if verdicts else [])], ()
        except Interrupted:
            raise
        except RadarsimError as error:
            words, faults = [f"FAILED: {error.lines[0]}"], error.lines
        seconds = time.perf_counter() - started
        done.append(Done(one.stem, seconds, tuple(faults)))
        say(f"[{number:>2}/{len(experiments)}] {one.stem:<26} {seconds:6.1f} s  {'; '.join(words)}")
    return done


def summary(done: Sequence[Done], out: str) -> list[str]:
    """The closing words: claims by verdict, time, where all lies."""
    rows = experiment.claims((), out)
    overall = Counter({row["claim"]: row["overall"] for row in rows}.values())
    longest = max(done, key=lambda one: one.seconds)
    failed = [one.stem for one in done if one.faults]
    return [
        "",
        f"claims   {sum(overall.values())}: " + ", ".join(f"{count} {verdict}" for verdict, count in overall.items()),
        f"time     {console.clock(sum(one.seconds for one in done))} for {console.plural(len(done), 'config')}, "
        f"the longest {longest.stem}, {longest.seconds:.0f} s",
        f"where    {Path(out) / 'index.html'} leads to every report; {Path(out) / 'README.md'} says what lies where",
        *([f"failed   {', '.join(failed)}"] if failed else []),
    ]


def main(out: str = "results") -> int:
    """All shipped configs into `out`; the exit code."""
    with Signals() as stop:
        try:
            experiments = experiment.load_all(lookup.stems("configs"))
            done = reproduce(experiments, out, console.say, stop)
            for line in summary(done, out):
                console.say(line)
        except RadarsimError as error:
            sys.stderr.write("".join(f"{line}\n" for line in error.lines))
            return error.exit_code
    return 1 if any(one.faults for one in done) else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
