"""The cases of earlier results as today's program reads them, from their run.json."""

from collections.abc import Mapping
from pathlib import Path

from radarsim.api.configs import load
from radarsim.api.stored_tables import read_record
from radarsim.config.experiment import Case
from radarsim.errors import RadarsimError

LABEL_KEYS = ("case", "swept")  # of a resolved case: no keys of a config


def stored_case(record: Mapping, name: str) -> Case | None:
    """A case as run.json resolved it; None where it no longer reads as a config."""
    try:
        for resolved in record["resolved"]["cases"]:
            if resolved["case"] == name:
                keys = {key: value for key, value in resolved.items() if key not in LABEL_KEYS}
                return load({"study": record["study"], **keys}).cases[0]
    except (RadarsimError, LookupError, TypeError):
        pass
    return None


def stored_cases(out: Path) -> list[tuple[str, Case]]:
    """The cases of all results in a directory with their names there, as far as they read as configs. Raises StoreError
    for a damaged run.json."""
    records = [read_record(path.parent) for path in sorted(out.glob("*/run.json"))]
    cases = [(name, stored_case(record, name)) for record in records if record for name in record["cases"]]
    return [(name, case) for name, case in cases if case is not None]
