"""What an earlier run.json says of the cases that it reports, as today's program reads it."""

import json
from collections.abc import Mapping
from pathlib import Path

from radarsim.app.configs import load
from radarsim.config.experiment import Case, Experiment
from radarsim.config.identity import canonical
from radarsim.errors import RadarsimError
from radarsim.report import files
from radarsim.studies.identity import identity

LABELS = ("case", "swept")  # of a resolved case, beside its keys
NAMED = 3  # cases in a line


def recorded_case(record: Mapping, name: str) -> Case | None:
    """A case as run.json resolved it; None where it no longer reads as a config."""
    try:
        for case in record["resolved"]["cases"]:
            if case["case"] == name:
                keys = {key: value for key, value in case.items() if key not in LABELS}
                return load({"study": record["study"], **keys}).cases[0]
    except (RadarsimError, LookupError, TypeError):
        pass
    return None


def made_by_other_code(experiment: Experiment, out: Path) -> list[str]:
    """A line where the last run of this config under `out` stored blocks of cases that are equal but for the code.

    Their identity differs, so they are not reused; without this line nobody would know why all is computed again.
    """
    try:
        record = json.loads(files.read(out / experiment.stem / "run.json"))
        names = [case.name for case in experiment.cases if _is_other(record, case, out)]
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return []  # no record, or one of another program
    if not names:
        return []
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return [
        f"stored blocks of {', '.join(names[:NAMED])}{more} were made by other code and are not reused; "
        f"`radarsim clean --out {out}` removes all stored blocks"
    ]


def _is_other(record: Mapping, case: Case, out: Path) -> bool:
    before = record["identities"].get(case.name)
    if not isinstance(before, str) or before == identity(case) or not _has_blocks(out / ".blocks" / Path(before).name):
        return False
    held = recorded_case(record, case.name)
    return held is not None and (canonical(held.spec), held.seed) == (canonical(case.spec), case.seed)


def _has_blocks(path: Path) -> bool:
    return any(path.glob("*.sums"))
