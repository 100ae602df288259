"""Keys of a config that another package adds: the code of a package cannot know them. Misspelt ones: `validate`."""

from collections.abc import Iterator
from typing import Annotated, Any

import pydantic
from pydantic.fields import FieldInfo

from radarsim.config.model import Model


def foreign_keys(spec: Model, home: str) -> list[str]:
    """The dotted keys of a config that the code of a package cannot know: keys and values that a derived model of
    another package adds.

    home: the name of that package."""
    return list(_foreign_keys(spec, home, ""))


def _foreign_keys(spec: Model, home: str, prefix: str) -> Iterator[str]:
    """Those of `foreign_keys` in a mapping whose own path is the prefix."""
    bases = type(spec).__mro__
    known_model = next(
        (item for item in bases if issubclass(item, Model) and _is_known_module(item.__module__, home)), Model
    )
    for name in type(spec).model_fields:
        value, key = getattr(spec, name), f"{prefix}{name}"
        info = known_model.model_fields.get(name)
        if info is None or not (known_model is bases[0] or _accepts(info, value)):
            yield key
            continue
        members = enumerate(value) if isinstance(value, tuple) else [(None, value)]
        for i, item in members:
            if isinstance(item, Model):
                yield from _foreign_keys(item, home, f"{key}." if i is None else f"{key}.{i}.")


def _is_known_module(module: str, home: str) -> bool:
    """Whether a package knows a module: its own, or radarsim's (for a study of radarsim that of the common keys)."""
    known_prefix = "radarsim.config." if home.startswith("radarsim.") else "radarsim."
    return f"{module}.".startswith((f"{home}.", known_prefix))


def _accepts(info: FieldInfo, value: Any) -> bool:
    """Whether a field accepts the value that another model has."""
    annotation: Any = Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
    try:
        pydantic.TypeAdapter(annotation).validate_python(value)
    except pydantic.ValidationError:
        return False
    return True
