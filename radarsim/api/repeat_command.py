"""The command that repeats a result."""

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from radarsim.config import find_files
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.experiment import Experiment
from radarsim.report import provenance

RESULTS = "results"  # the command's default directory
SHORT_OPTIONS = {"realisations": "-n", "seed": "--seed"}

Precision = tuple[float, str]  # in per cent, and for which kind of quantity


def repeat_command(
    experiment: Experiment, done_counts: Mapping[str, int], overrides: Sequence[str], precision: Precision | None
) -> str:
    """The command that reproduces the tables, or a sentence that says why there is none.

    experiment: as config and overrides give it; done_counts: the realisations of each case in the tables; precision:
    the one that ended the cases, if any."""
    is_own_path = not provenance.is_portable(experiment.path or "") and not _is_shipped(experiment)
    if experiment.path is None or is_own_path:
        return f"radarsim run {CONFIG_FILE}"  # of the result, which stands beside it
    requested_counts = {case.name: case.realisations for case in experiment.cases}
    counts = {done_counts.get(name, 0) for name in requested_counts}
    is_done = all(done_counts.get(name) == count for name, count in requested_counts.items())
    if is_done and not (len(counts) == 1 and _asks_for_others(overrides, max(counts))):
        return command(experiment, overrides, RESULTS)
    if len(counts) == 1:
        other_overrides = [text for text in overrides if text.partition("=")[0].strip() != "realisations"]
        return command(experiment, [*other_overrides, f"realisations={counts.pop()}"], RESULTS)
    if precision is not None:
        return command(experiment, overrides, RESULTS, precision)
    return "none: the run was stopped, its cases at different numbers of realisations, which are listed below"


def _asks_for_others(overrides: Sequence[str], count: int) -> bool:
    """Whether overrides ask for another number of realisations than this."""
    values = [value for key, _, value in (text.partition("=") for text in overrides) if key.strip() == "realisations"]
    return any(float(value) != count for value in values[-1:])


def command(
    experiment: Experiment,
    overrides: Sequence[str],
    out: str | os.PathLike,
    precision: Precision | None = None,
    verb: str = "run",
) -> str:
    """The command that runs an experiment or reads its result; a shipped config by its stem."""
    words = ["radarsim", verb, experiment.stem if _is_shipped(experiment) else quote_path(experiment.path or "")]
    for override in overrides:
        key, _, value = override.partition("=")
        words += [SHORT_OPTIONS[key], value] if key in SHORT_OPTIONS else ["--set", override]
    if experiment.runs and verb == "run":
        words += ["--runs", experiment.runs]
    if precision is not None:
        percent, quantity_name = precision
        words += ["--precision", f"{percent:.17g}", *(["--of", quantity_name] if quantity_name != "sigma" else [])]
    return shlex.join(words) + out_option(out)


def _is_shipped(experiment: Experiment) -> bool:
    """Whether the stem of an experiment leads to its config: one that is shipped, or given in Python."""
    # In a checkout the shipped folder is a link to configs/.
    folders = {(folder / "configs").resolve() for folder in (find_files.SHIPPED, *find_files.further_folders())}
    return not experiment.path or Path(experiment.path).resolve().parent in folders


def out_option(out: str | os.PathLike) -> str:
    """The option for the results directory at the end of a command."""
    return f" {shlex.join(['--out', quote_path(os.fspath(out))])}" if str(out) != RESULTS else ""


def quote_path(path: str) -> str:
    """A path as printable text; bytes that are not UTF-8 escaped."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
