"""Overrides of keys, as texts KEY=VALUE or as a mapping."""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.place_settings import Setting
from radarsim.config.scalars import DEEPEST, from_python, from_text
from radarsim.config.yaml_io import parse_yaml
from radarsim.config.yaml_text import PLAIN_TEXT
from radarsim.errors import ConfigError, argument

OVERRIDES_WITH_OPTION = ("realisations", "seed")  # overrides that are options of their own on the command line
KEYS_OF_WHOLE_VALUES = {"kind", "minimise"}  # a mapping with one of these is a value, not keys to be changed one by one
Overrides = Mapping[str, Any] | Iterable[str]


def override_texts(overrides: Overrides) -> tuple[str, ...]:
    """Overrides as texts `dotted.key=value`, with the value in YAML, as `--set` takes them.

    A mapping from keys, dotted or nested, to Python values is converted. An inner mapping changes the keys in it,
    unless it is a complete value, such as a target with its `kind`. Raises ConfigError.

    >>> override_texts({"scans": 20, "radar": {"sigma_range_m": 300.0, "name": "mine"}})
    ('scans=20', 'radar.sigma_range_m=300.0', 'radar.name=mine')
    """
    if isinstance(overrides, Mapping):
        faults = ErrorList()
        override_texts = tuple(_override_texts(overrides, "", faults))
        keys = [text.partition("=")[0] for text in override_texts]
        for i, key in enumerate(keys):
            if overlapping_key := next(
                (earlier_key for earlier_key in keys[:i] if f"{earlier_key}.".startswith(f"{key}.")), None
            ):
                faults.add(
                    override_origin(key),
                    (),
                    "is given twice" if overlapping_key == key else f"overwrites {overlapping_key}, given before it",
                )
        faults.raise_if_any()
        return override_texts
    if isinstance(overrides, str | bytes) or not isinstance(overrides, Iterable):
        example = '{"radar.sigma_range_m": 300}'
        raise ConfigError(f"overrides: must be a mapping such as {example}, or texts KEY=VALUE, got {overrides!r}")
    return tuple(map(str, overrides))


def _override_texts(values: Mapping[Any, Any], prefix: str, faults: ErrorList) -> Iterator[str]:
    for name, value in values.items():
        key = f"{prefix}{name}"
        if key.count(".") > DEEPEST:
            faults.add(override_origin(".".join(key.split(".")[:3])), (), f"nested more than {DEEPEST} deep")
            return
        if isinstance(value, Mapping) and value and not KEYS_OF_WHOLE_VALUES & value.keys():
            yield from _override_texts(value, f"{key}.", faults)
            continue
        plain_value = from_python(value, (), origin := override_origin(key), faults)
        if not faults.is_unusable(origin, ()):
            yield f"{key}={_yaml_literal(plain_value)}"


def _yaml_literal(value: object) -> str:
    """A plain value as YAML on one line."""
    if isinstance(value, str) and PLAIN_TEXT.fullmatch(value) and from_text(value) == value == value.strip():
        return value
    return json.dumps(value, ensure_ascii=False)


def override_origin(key: str) -> Origin:
    """The argument that gives an override: an option of its own, or one of the overrides."""
    return Origin(
        argument(key) if key in OVERRIDES_WITH_OPTION else argument(f"overrides[{key!r}]", f"--set {key}"), key=key
    )


def parse_setting(text: str, faults: ErrorList) -> Setting | None:
    """An override `key=value`, with its value read as YAML; None, with an error added, if it is not one."""
    key, equals_sign, value = text.partition("=")
    key = key.strip()
    origin = override_origin(key)
    if not equals_sign or not key or not all(key.split(".")):
        faults.add(override_origin(text), (), "must be KEY=VALUE, with a dotted KEY")
        return None
    document = parse_yaml(value, origin.source, faults, plain_origin=origin)
    return None if document is None else Setting(key, document.data, origin)
