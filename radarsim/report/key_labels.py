"""Names of cases, of their keys and values, and labels of axes, in figures and in plain text."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from radarsim.config.labels import Label
from radarsim.config.labels import label as label_of
from radarsim.engine.results import CaseResult
from radarsim.language.numerals import power_of_ten
from radarsim.language.translate import join_names, plural, tr
from radarsim.report import wording

NEAR_ONE = 0.999  # probabilities above it differ only in further digits
LONG = 5  # powers of ten from this one on are written raised
GREEK = {"b": "\\beta", "e": "\\varepsilon"}  # bearing and elevation, as the components' names begin or end
DEGREES = 180 / np.pi
PAPER_RADAR = re.compile(r"RLS \d")
FEW_DIGITS = 3  # of an angle that was given in radians
POWERS = ("manoeuvre_variance",)  # swept keys written as powers of ten


def format_value(value: object, powers: bool = False) -> str:
    """A number for people at four digits, 10⁵ and 10⁻⁵ as such (with powers, 0.1 as 10⁻¹); text unchanged. Numbers of
    a list one after the other."""
    if isinstance(value, list | tuple) and all(isinstance(item, int | float) for item in value):
        return wording.list_numbers(map(format_value, value))
    if not isinstance(value, int | float) or isinstance(value, bool):
        return escape_dollars(str(value).replace("_", " "))  # of a list of choices, of a scenario
    power = int(f"{value:.0e}".partition("e")[2])
    if (
        value != 0
        and float(f"1e{power}") == value
        and (power >= (2 if powers else LONG) or power < (0 if powers else 1 - LONG))
    ):
        return power_of_ten(power)
    return wording.number(value, 6 if NEAR_ONE < value < 1 else 4)


def shorten_mapping(result: CaseResult, key: str, value: object, among: Sequence[object]) -> object:
    """A mapping of a swept key by its kind and its differences from others of the kind, as words; any other value
    unchanged."""
    if not isinstance(value, Mapping) or "kind" not in value:
        return value
    same_kind = [item for item in among if isinstance(item, Mapping) and item.get("kind") == value["kind"]]
    differing = {name: item for name, item in value.items() if any(mapping.get(name) != item for mapping in same_kind)}
    return mapping_text(result, key, {"kind": value["kind"], **differing})


def mapping_text(result: CaseResult, key: str, value: Mapping) -> str:
    """A mapping that is a key's value: its kind, and each of its keys by name, with value and unit."""
    kind = [format_value(value["kind"])] if "kind" in value else []
    keys = [f"{key}.{name}" for name in value if name != "kind"]
    items = zip(keys, (item for name, item in value.items() if name != "kind"), strict=True)
    return ", ".join(
        [*kind, *(f"{key_label(result, name).text} {value_with_unit(result, name, item)}" for name, item in items)]
    )


def escape_dollars(name: str) -> str:
    """A user's text for a figure: a dollar is a dollar."""
    return name.replace("$", r"\$")


def config_stem(result: CaseResult) -> str:
    """The config of a case: its name without the swept keys."""
    return result.name.split(" ", 1)[0]


def config_device(result: CaseResult) -> str:
    """The name of a case's sensor: the display name, else the config's stem."""
    return escape_dollars(result.spec.device) if result.spec.device else config_stem(result)


def swept_description(result: CaseResult, without: Iterable[str] = ()) -> str:
    """The swept keys of a case in short, but for some: "D_M = 10⁻³", "σ_V = 5 m/s"."""
    pairs = [(key, value) for key, value in result.swept_values if key not in set(without)]
    return ", ".join(f"{key_symbol(result, key)} = {value_with_unit(result, key, value)}" for key, value in pairs)


def swept_title(result: CaseResult, without: Iterable[str] = ()) -> str:
    """The swept keys of a case as the title of a panel: names alone, numbers with their symbol, but for some keys."""
    pairs = [(key, value) for key, value in result.swept_values if key not in set(without)]
    return ", ".join(titled_value(result, key, value) for key, value in pairs)


def titled_value(result: CaseResult, key: str, value: object) -> str:
    """A value of a key in a title: "turn", "σ_V = 5 m/s"."""
    text = value_with_unit(result, key, value)
    return text if isinstance(value, str | Mapping) else f"{key_symbol(result, key)} = {text}"


def shared_keys(results: Sequence[CaseResult]) -> set[str]:
    """The swept keys that have one value in all of several cases."""
    values = [dict(result.swept_values) for result in results]
    if len(values) < 2:
        return set()
    return {key for key, value in values[0].items() if all(case_values.get(key) == value for case_values in values)}


def value_with_unit(result: CaseResult, key: str, value: object) -> str:
    """A value of a key with the key's unit, except a unit that would need brackets."""
    if isinstance(value, Mapping):
        return mapping_text(result, key, value)
    if isinstance(value, list | tuple):
        return " ".join(filter(None, (format_value(value), unit_label(key_label(result, key).unit))))
    if not isinstance(value, int | float) or isinstance(value, bool):
        return format_value(value)
    factor, unit_name = degrees_factor_and_unit(key_label(result, key).unit)
    text = format_value(value, is_written_as_power(key)) if factor == 1.0 else format_degrees(factor * value)
    unit_text = unit_label(unit_name)
    if unit_text.startswith("°"):
        return f"{text}{unit_text}"
    return " ".join(filter(None, (text, unit_text.partition("(")[0])))


def format_degrees(degrees: float) -> str:
    """An angle that was given in radians, at few digits: 1° of 0.01745 rad."""
    return wording.number(float(f"{degrees:.{FEW_DIGITS}g}"), FEW_DIGITS)


def key_label(result: CaseResult, key: str) -> Label:
    """The name of a key of a case, in the current language; its unit as in tables."""
    key_text = label_of(result.spec, key)
    return key_text._replace(text=tr(key_text.text))


def list_radars(names: Sequence[str]) -> str:
    """Names of radars in a question; those of the papers, RLS 1 to 5, with the word that says what they are."""
    if not all(PAPER_RADAR.fullmatch(name) for name in names):
        return join_names(names)
    return plural("the radar {names}", "the radars {names}", len(names), names=join_names(names))


def unit_label(name: str) -> str:
    """A unit as people write it, in the current language."""
    return tr(wording.unit(name))


def is_written_as_power(key: str) -> bool:
    """Whether values of a key are written as powers of ten."""
    return key.rpartition(".")[2] in POWERS


def key_symbol(result: CaseResult, key: str) -> str:
    """The short name of a key of a case in figures: its letter if it has one (mathematical text), else its name."""
    key_text = key_label(result, key)
    return math_symbol(key_text.symbol) if key_text.symbol else key_text.text


def key_axis_label(result: CaseResult, key: str) -> str:
    """The label of a key's axis: name, letter, unit; values on it are times `key_axis_factor`."""
    key_text = key_label(result, key)
    return label_with_unit(
        " ".join(filter(None, (key_text.text, math_symbol(key_text.symbol)))), degrees_factor_and_unit(key_text.unit)[1]
    )


def key_axis_factor(result: CaseResult, key: str) -> float:
    """The factor for a key's values on an axis: angles are given in radians and shown in degrees."""
    return degrees_factor_and_unit(key_label(result, key).unit)[0]


def sigma_axis_label(symbol: str, unit: str) -> str:
    """The label of an axis of σ of a component."""
    return label_with_unit(tr("$\\sigma$ of {symbol}", symbol=symbol), unit)


def math_symbol(symbol: str) -> str:
    """A symbol as mathematical text: $D_M$ of D_M."""
    base, _bar, below = symbol.partition("_")
    return f"${base}_{{{below}}}$" if len(below) > 1 else f"${symbol}$" if symbol else ""


def component_symbol(component: str) -> str:
    """A component of the tables on a figure's axis: "vb" as $v_\beta$; a word in the language in use."""
    match = re.fullmatch(r"([vVa]?)([a-z])", component)
    if not match:
        return escape_dollars(tr(component))
    base = GREEK.get(match[2], match[2])
    return f"${match[1]}_{base}$" if match[1] else f"${base}$"


def degrees_factor_and_unit(unit: str) -> tuple[float, str]:
    """The factor by which an angle, or its rate, is shown, and its unit: degrees for radians; others unchanged."""
    return (DEGREES, unit.replace("rad", "°", 1)) if unit == "rad" or unit.startswith("rad/") else (1.0, unit)


def label_with_unit(label_text: str, unit: str) -> str:
    """The label of an axis with its unit, where there is one."""
    return ", ".join(filter(None, (label_text, unit_label(unit))))


def case_label(result: CaseResult) -> str:
    """Device and swept keys, for a line or a panel."""
    return ", ".join(filter(None, (config_device(result), swept_description(result))))


def plain_case_label(result: CaseResult) -> str:
    """The case's label for plain text, without mathematical markup."""
    return without_markup(case_label(result))


def without_markup(words: str) -> str:
    """A figure's text without mathematical markup."""
    bare = re.sub(r"_\{([^}]*)\}", r"_\1", words.replace(r"\$", "\0"))
    return bare.replace("$", "").replace("\0", "$")
