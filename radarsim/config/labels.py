"""What people call a key: one text, symbol and unit for each, from the schema of the study that has it.

A key says it itself: `key("scan period", "time between two plots, s", symbol="Δt")`. The unit is the one that the end
of the key names; a key that names none, or none that people write, gives it beside the symbol, as `unit`.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

from pydantic.fields import FieldInfo

from radarsim.config.check import models_in
from radarsim.config.fields import Model, Study, in_radians
from radarsim.config.schema import Common

UNITS = {
    **{"m": "m", "s": "s", "mps": "m/s", "mps2": "m/s²", "mps3": "m/s³", "rad": "rad", "deg": "°", "hz": "Hz"},
    **{"radps": "rad/s", "degps": "°/s", "radps2": "rad/s²", "degps2": "°/s²", "g": "g", "db": "dB"},
    **{"kgpm2": "kg/m²"},
}


class Label(NamedTuple):
    """A key in words: "scan period", its symbol in the papers ("Δt", "σ_r": a subscript after _) and its unit.

    Symbol and unit are empty where there is none.
    """

    text: str
    symbol: str
    unit: str


def label(keys: Study | type[Study] | None, key: str) -> Label:
    """The label of a key, dotted or bare, as `sweep` and `--set` name it; keys are a study's, checked or not.

    >>> from radarsim.studies import registry
    >>> label(registry.keys("range_doppler"), "radar.sigma_velocity_mps")
    Label(text='σ of the measured radial velocity', symbol='σ_V', unit='m/s')

    A key that no schema tells of is called by its own words:

    >>> label(None, "echo.rise_time_s")
    Label(text='rise time', symbol='', unit='s')
    """
    steps = [step for step in key.split(".") if not step.isdecimal()]
    stem, _, end = steps[-1].rpartition("_")
    unit = UNITS.get(end, "") if stem and not stem.endswith("_per") else ""  # hertz per second are not seconds
    found = _field(keys, steps) if keys is not None else None
    found = found or _field(Common, steps)
    if found is None:
        name = stem if unit else steps[-1]
        return Label(name.replace("_", " "), "", unit)
    extra = found.json_schema_extra if isinstance(found.json_schema_extra, dict) else {}
    text = found.title or (stem if unit else steps[-1]).replace("_", " ")
    own = unit if in_radians(steps[-1]) else str(extra.get("unit", unit))  # a twin in degrees has no field of its own
    return Label(text, str(extra.get("symbol", "")), own)


def _field(keys: Model | type[Model], steps: list[str]) -> FieldInfo | None:
    """The field that dotted steps lead to, from the top or, for a bare key, from the members of the study's list."""
    model = keys if isinstance(keys, type) else type(keys)
    if steps and _named(steps[0]).isdisjoint(model.model_fields) and issubclass(model, Study):
        steps = [model.bare_keys, *steps]
    holders: list[Any] = [keys]
    found: FieldInfo | None = None
    for step in steps:
        at = next(((one, name) for one in holders for name in _named(step) if name in _fields(one)), None)
        if at is None:
            return None
        holder, name = at
        found = _fields(holder)[name]
        given = [] if isinstance(holder, type) else list(_models(getattr(holder, name)))
        holders = [*given, *models_in(found.annotation)]
    return found


def _named(step: str) -> set[str]:
    """A key, and its twin in radians where it is one in degrees."""
    return {step, in_radians(step) or step}


def _fields(model: Model | type[Model]) -> dict[str, FieldInfo]:
    return (model if isinstance(model, type) else type(model)).model_fields


def _models(value: object) -> Iterator[Model]:
    """The mappings that a value is or holds: of a choice, the kind that was chosen."""
    if isinstance(value, Model):
        yield value
    elif isinstance(value, tuple | list):
        for one in value:
            yield from _models(one)
