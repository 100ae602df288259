"""Every YAML key as Markdown, from the schema that the configs are checked by."""

import re

from radarsim.config.json_schema import json_schema
from radarsim.config.model import in_degrees
from radarsim.studies import registry

COMMON = ("include", "sweep", "realisations", "seed", "figures")
BOUNDS = {"minimum": "≥ {}", "exclusiveMinimum": "> {}", "maximum": "≤ {}", "exclusiveMaximum": "< {}"}


def markdown() -> str:
    """A heading for each study and for each kind of mapping in it, with a table of the keys."""
    definitions = json_schema(registry)["$defs"]
    common = {key: definitions["include"]["properties"][key] for key in COMMON}
    parts = ["## Keys of every config", table(common, definitions, ())]
    for study in definitions["include"]["properties"]["study"]["enum"]:
        study_schema = definitions[study]
        study_keys = {key: part for key, part in study_schema["properties"].items() if key not in COMMON}
        parts += [
            f"## study: {study}",
            study_schema["description"],
            table(study_keys, definitions, required(study_schema)),
        ]
        parts += mappings(study_keys, definitions, set())
    return "\n\n".join(parts)


def mappings(properties: dict, definitions: dict, described: set[str]) -> list[str]:
    """Sections of the mappings that these keys hold, in the order of their first mention; each once."""
    parts = []
    for part in properties.values():
        for name in references(part):
            if name in described:
                continue
            described.add(name)
            inner = definitions[name]
            parts += [f"### {title(name, definitions)}", inner["description"]]
            parts += [table(inner["properties"], definitions, required(inner))]
            parts += mappings(inner["properties"], definitions, described)
    return parts


def table(properties: dict, definitions: dict, required_keys: tuple[str, ...]) -> str:
    """Keys with what they take, their default and their meaning; a twin in degrees stands beside its key."""
    twins = {in_degrees(key) for key in properties if in_degrees(key)}
    rows = ["| key | takes | default | what it is |", "|---|---|---|---|"]
    for key, part in properties.items():
        if key in twins:
            continue
        names = f"`{key}`" + (f", or `{in_degrees(key)}`" if in_degrees(key) in properties else "")
        default = "required" if key in required_keys else yaml_text(part["default"]) if "default" in part else ""
        cells = (names, allowed_values(part, definitions), default, part.get("description", ""))
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def required(model: dict) -> tuple[str, ...]:
    """Keys that must be there; of one with a twin in degrees the key itself."""
    with_twins = [
        choice["required"][0] for condition in model.get("allOf", ()) for choice in condition.get("oneOf", ())[:1]
    ]
    return (*model.get("required", ()), *with_twins)


def references(part: dict) -> list[str]:
    """Names of the definitions that a key's value may be."""
    if "$ref" in part:
        return [part["$ref"].rpartition("/")[2]]
    inner = [*part.get("anyOf", ()), *part.get("oneOf", ()), *part.get("prefixItems", ())]
    inner += [part[key] for key in ("items", "additionalProperties") if isinstance(part.get(key), dict)]
    return [name for choice in inner for name in references(choice)]


def title(name: str, definitions: dict) -> str:
    """A mapping's heading: its kind as the YAML says it where it has one, else its name in words."""
    kind = definitions[name]["properties"].get("kind", {}).get("const")
    return f"kind: {kind}" if kind else heading_words(name.rpartition("__")[2])


def heading_words(name: str) -> str:
    """A class's name in words: FurtherSensor is a further sensor."""
    return re.sub(r"(?<!^)([A-Z])", r" \1", name).capitalize()


def allowed_values(part: dict, definitions: dict) -> str:
    """What a key takes, in words: type, choices, bounds."""
    if "$ref" in part:
        name = title(references(part)[0], definitions)
        return f"`{name}`" if name.startswith("kind") else name
    choices = [*part.get("anyOf", ()), *part.get("oneOf", ())]
    if choices:
        return ", or ".join(dict.fromkeys(allowed_values(choice, definitions) for choice in choices))
    if "const" in part or "enum" in part:
        return ", ".join(f"`{value}`" for value in part.get("enum", [part.get("const")]))
    kind = part.get("type")
    if kind == "array":
        many = allowed_values(part["items"], definitions) if part.get("items") else "values"
        return f"list of {many}" if "prefixItems" not in part else f"{len(part['prefixItems'])} values"
    if kind == "object":
        inner = part.get("additionalProperties")
        return f"mapping of {allowed_values(inner, definitions)}" if isinstance(inner, dict) and inner else "mapping"
    bounds = [form.format(yaml_text(part[key])) for key, form in BOUNDS.items() if key in part]
    word = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true, false"}.get(kind, "any")
    return " ".join([word, ", ".join(bounds)]).strip()


def yaml_text(value: object) -> str:
    """A value as YAML shows it: numbers short, lists and mappings in brackets, nothing for what is not given."""
    match value:
        case bool():
            return str(value).lower()
        case dict():
            return "{" + ", ".join(f"{key}: {yaml_text(item)}" for key, item in value.items() if item is not None) + "}"
        case list():
            return "[" + ", ".join(map(yaml_text, value)) + "]"
        case float():
            return f"{value:g}"
        case int() if value >= 10**9 and str(value).rstrip("0") == "1":
            return f"1e{len(str(value)) - 1}"
        case int() if value >= 2**32 and value & (value + 1) == 0:
            return f"2^{value.bit_length()} − 1"
    return str(value)
