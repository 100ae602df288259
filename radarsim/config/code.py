"""Filters of the user's own code among those of a study: `{name: mine, python: my_filter.py:MyFilter, hidden: 8}`.

Read here is how a config names them; `radarsim.studies.code` finds their sources, and runs them."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, Tag, create_model

from radarsim.config.check import check
from radarsim.config.document import Document, Faults
from radarsim.config.fields import Model, Study
from radarsim.config.schema import OwnCode
from radarsim.errors import ConfigError

PYTHON = "python"


def is_code(member: object) -> bool:
    """Whether a member of a list of filters, as read, is the user's own code."""
    return isinstance(member, dict) and PYTHON in member


Coded = Callable[[OwnCode, str, bool, Path], Any]


def parted(document: Document, model: type[Study], coded: Coded, faults: Faults) -> tuple[Document, tuple[Any, ...]]:
    """The document with the study's own filters and baselines alone, and the filters of the user's code.

    coded: what makes such a filter of its keys, its place, whether it is a baseline, and the folder of its config."""
    members = document.data.get(model.bare_keys)
    if not isinstance(members, list) or not any(map(is_code, members)):
        return document, ()
    own = [one for one in members if not is_code(one)]
    read: Any = check(_listed(model.bare_keys), document.only((model.bare_keys,)), faults)
    given = document.get(("baseline",))
    baselines = given if isinstance(given, list) else [given]
    names = [one.get("name") for one in members if isinstance(one, dict)]
    for one in baselines:
        if isinstance(one, str) and one not in names:
            message = f"must be the name of a filter: {', '.join(map(str, names))}"
            faults.spoil(document.origin(("baseline",)), ("baseline",), message, one)
    found = []
    for i, one in enumerate(members):
        at = (model.bare_keys, i)
        if not is_code(one):
            continue
        if i < len(own) or not own:
            message = "must stand after filters of the study itself, and beside at least one"
            faults.add(document.key_origin((*at, PYTHON)), (*at, PYTHON), message)
        elif names.count(one.get("name")) > 1:
            faults.add(document.origin((*at, "name")), (*at, "name"), "names must differ, and this is there twice")
        elif read is not None:
            origin = document.origin((*at, PYTHON))
            folder = Path(origin.source).parent if origin.line else Path()
            try:
                found.append(
                    coded(getattr(read, model.bare_keys)[i], str(origin), one.get("name") in baselines, folder)
                )
            except ConfigError as error:
                faults.add(origin, (*at, PYTHON), str(error))
    document = document.with_data((model.bare_keys,), own)
    kept = [one for one in baselines if one not in [code.name for code in found]]
    if kept != baselines:
        document = document.with_data(("baseline",), kept) if kept else document.without(("baseline",))
    return document, tuple(found)


@cache
def _listed(name: str) -> type[Model]:
    """The schema of a list of filters in which those of the user's code are checked."""
    member = Annotated[
        Annotated[OwnCode, Tag("own")] | Annotated[Any, Tag("other")],
        Discriminator(lambda data: "own" if is_code(data) else "other"),
    ]
    fields: Any = {name: (tuple[member, ...], ...)}
    made: type[Model] = create_model("Listed", __base__=Model, **fields)
    return made
