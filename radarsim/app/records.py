"""What an earlier run.json says of the cases that it reports, as today's program reads it; what other sources made."""

from collections.abc import Mapping

from radarsim.app.configs import load
from radarsim.config.experiment import Case
from radarsim.engine import store
from radarsim.errors import RadarsimError

LABELS = ("case", "swept")  # of a resolved case, beside its keys
NAMED = 3  # cases in a line
SURE = 3  # a change that shows in one of m / 3 realisations is missed by m of them with a probability of e⁻³ = 5 %


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


def of_other_sources(names: Mapping[str, str]) -> list[str]:
    """A line on the blocks that other sources made and that are kept, one on those that are not; once in a process.

    names are those of cases, by identity.
    """
    found = [one for one in store.settled if one.identity in names]
    store.settled[:] = [one for one in store.settled if one.identity not in names]
    lines = []
    if kept := [one for one in found if one.same]:
        again, stored = sum(one.again for one in kept), sum(one.stored for one in kept)
        line = (
            f"stored blocks of {_listed(kept, names)} were made by other sources; {again:,} of {stored:,} realisations "
            "were computed again and have the same bytes: all are kept"
        )
        if unseen := [one.again for one in kept if one.again < one.stored]:
            line += f". A change in one realisation of {min(unseen) // SURE:,} would have shown, rarer ones may not"
        lines.append(line)
    same = {one.identity for one in kept}
    if begun := [one for one in found if one.identity not in same]:
        lines.append(
            f"stored blocks of {_listed(begun, names)} were made by other sources that give other bytes, and are not "
            "used; `radarsim clean` removes them"
        )
    return lines


def _listed(found: list[store.Settled], names: Mapping[str, str]) -> str:
    cases = list(dict.fromkeys(names[one.identity] for one in found))
    more = f" and {len(cases) - NAMED} more" if len(cases) > NAMED else ""
    return f"{', '.join(cases[:NAMED])}{more}"
