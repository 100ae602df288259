"""How long one update of a filter takes, of the studies that measure it; such numbers never stand in a CSV."""

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec


def seconds_per_update(works: Iterable) -> dict[str, dict[str, float]]:
    """CPU seconds of one update of one realisation, by case and filter; empty where the study does not measure it."""
    found = {}
    for work in works:
        module = f"radarsim.studies.{work.case.study}_timing"
        if find_spec(module) is not None:
            found[work.case.name] = import_module(module).seconds_per_update(work.plan)
    return found
