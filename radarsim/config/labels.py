"""The label of a key: its text, symbol and unit, from the schema of its study.

Names of keys are declared once, with `key("scan period", "time between two plots, s", symbol="Δt")`. The unit is the
one at the end of the key's name; a key without such an ending, or with an unusual one, states it beside the symbol, as
`unit`."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from pydantic.fields import FieldInfo

from radarsim.config.common_keys import CommonKeys
from radarsim.config.model import Model, in_radians
from radarsim.config.study_keys import StudyKeys
from radarsim.config.validate import models_in

UNITS = {
    **{"m": "m", "s": "s", "mps": "m/s", "mps2": "m/s²", "mps3": "m/s³", "rad": "rad", "deg": "°", "hz": "Hz"},
    **{"radps": "rad/s", "degps": "°/s", "radps2": "rad/s²", "degps2": "°/s²", "g": "g", "db": "dB"},
    **{"kgpm2": "kg/m²"},
}


class KeyTitle(str):
    """The title of a key. package: the top-level package of its schema, whose catalogues translate the title."""

    package = ""


class Label(NamedTuple):
    """A key in words: "scan period", its symbol in the papers ("Δt", "σ_r": a subscript after _) and its unit. Symbol
    and unit are empty where there is none."""

    text: str
    symbol: str
    unit: str


def label(keys: StudyKeys | type[StudyKeys] | None, key: str) -> Label:
    """The label of a key, dotted or bare, as `sweep` and `--set` name it; keys: those of a study, or their schema.

    >>> from radarsim.studies import registry
    >>> label(registry.keys("range_doppler"), "radar.sigma_velocity_mps")
    Label(text='σ of the measured radial velocity', symbol='σ_V', unit='m/s')

    A key without a schema is labelled by its name:

    >>> label(None, "echo.rise_time_s")
    Label(text='rise time', symbol='', unit='s')
    """
    steps = [step for step in key.split(".") if not step.isdecimal()]
    stem, _, unit_suffix = steps[-1].rpartition("_")
    unit = UNITS.get(unit_suffix, "") if stem and not stem.endswith("_per") else ""  # hertz per second are not seconds
    named_field = _find_field(keys, steps) if keys is not None else None
    if keys is not None and named_field is None and len(steps) > 2:
        named_field = _find_field(keys, [steps[0], *steps[2:]])  # filters.NAME.KEY
    holder, field = named_field or _find_field(CommonKeys, steps) or (None, None)
    if field is None:
        name = stem if unit else steps[-1]
        return Label(name.replace("_", " "), "", unit)
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    text = KeyTitle(field.title or (stem if unit else steps[-1]).replace("_", " "))
    text.package = holder.__module__.partition(".")[0] if holder else ""
    # A key in degrees has no field: it takes the text of its twin in radians, but not the unit.
    shown_unit = unit if in_radians(steps[-1]) else str(extra.get("unit", unit))
    return Label(text, str(extra.get("symbol", "")), shown_unit)


def _find_field(keys: Model | type[Model], steps: list[str]) -> tuple[type[Model], FieldInfo] | None:
    """The field at dotted steps, counted from the top or, for a bare key, from the members of the study's list; and the
    schema that defines it, a base class where the field is inherited."""
    model = keys if isinstance(keys, type) else type(keys)
    if steps and _key_and_twin(steps[0]).isdisjoint(model.model_fields) and issubclass(model, StudyKeys):
        steps = [model.bare_keys, *steps]
    holders: list[Any] = [keys]
    named_field: tuple[type[Model], FieldInfo] | None = None
    for step in steps:
        match = next(
            ((owner, name) for owner in holders for name in _key_and_twin(step) if name in _fields_of(owner)), None
        )
        if match is None:
            return None
        holder, name = match
        info = _fields_of(holder)[name]
        schemas = [
            owner
            for owner in (holder if isinstance(holder, type) else type(holder)).__mro__
            if issubclass(owner, Model)
        ]
        same_key = [
            owner for owner in schemas if name in owner.model_fields and owner.model_fields[name].title == info.title
        ]
        named_field = same_key[-1], info
        given_models = [] if isinstance(holder, type) else list(_models_in_value(getattr(holder, name)))
        holders = [*given_models, *models_in(info.annotation)]
    return named_field


def _key_and_twin(step: str) -> set[str]:
    """A key, and its twin in radians if it is in degrees."""
    return {step, in_radians(step) or step}


def _fields_of(model: Model | type[Model]) -> dict[str, FieldInfo]:
    """The fields of a schema, or of the schema of an object."""
    return (model if isinstance(model, type) else type(model)).model_fields


def _models_in_value(value: object) -> Iterator[Model]:
    """The checked mappings that a value is or contains."""
    if isinstance(value, Model):
        yield value
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _models_in_value(item)
