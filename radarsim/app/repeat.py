"""The command that computes a result again, as run.json and messages give it."""

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from radarsim.config import lookup
from radarsim.config.experiment import Experiment

RESULTS = "results"  # the command's default directory
SHORT = {"realisations": "-n", "seed": "--seed"}


Precision = tuple[float, str]  # in per cent, and of which kind of quantity


def repeated(asked: Experiment, done: Mapping[str, int], overrides: Sequence[str], precision: Precision | None) -> str:
    """The command that makes the same tables, or a sentence that says why there is none.

    asked is the experiment as config and overrides give it, done the realisations of each case that the tables hold;
    precision decided where the cases ended, unless it is None.
    """
    if asked.path is None:
        return "none: the config was given in Python, and stands below"
    wanted = {case.name: case.realisations for case in asked.cases}
    counts = {done.get(name, 0) for name in wanted}
    if all(done.get(name) == count for name, count in wanted.items()):
        return command(asked, overrides, RESULTS)
    if len(counts) == 1:
        kept = [text for text in overrides if text.partition("=")[0].strip() != "realisations"]
        return command(asked, [*kept, f"realisations={counts.pop()}"], RESULTS)
    if precision is not None:
        return command(asked, overrides, RESULTS, precision)
    return "none: the run was stopped, its cases at different numbers of realisations, which stand below"


def command(
    experiment: Experiment,
    overrides: Sequence[str],
    out: str | os.PathLike,
    precision: Precision | None = None,
    verb: str = "run",
) -> str:
    """The command that runs an experiment, or reads what it came to; a shipped config by its stem."""
    # In a checkout the shipped folder is a link to configs/.
    folders = {(folder / "configs").resolve() for folder in (lookup.SHIPPED, *lookup.further_folders())}
    shipped = not experiment.path or Path(experiment.path).resolve().parent in folders
    words = ["radarsim", verb, experiment.stem if shipped else as_text(experiment.path or "")]
    for override in overrides:
        key, _, value = override.partition("=")
        words += [SHORT[key], value] if key in SHORT else ["--set", override]
    if precision is not None:
        percent, of = precision
        words += ["--precision", f"{percent:.17g}", *(["--of", of] if of != "sigma" else [])]
    return shlex.join(words) + into(out)


def into(out: str | os.PathLike) -> str:
    """The end of a command that reads or writes a directory of results."""
    return f" {shlex.join(['--out', as_text(os.fspath(out))])}" if str(out) != RESULTS else ""


def as_text(path: str) -> str:
    """A path as text that can be written; bytes of it that are no UTF-8 escaped."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
