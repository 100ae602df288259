"""The YAML keys common to all configs, and the interface to the studies: their names and their keys.

The schema of the YAML as JSON Schema, for editors and for `radarsim schema`."""

import json
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field, Strict
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from radarsim.config.fields import Anything, Flag, Member, Model, Name, Scenario, Stem, Study, Whole, key

# ---- schema ----------------------------------------------------------------------------------------------------------
LARGEST_REALISATIONS = 10**12
LARGEST_SEED = 2**64 - 1


class Common(Model):
    """Keys that every config may have, whatever its study."""

    study: Stem | None = key("study", "the study; it determines the other keys", None)
    include: Annotated[tuple[Stem, ...], Field(min_length=1)] | None = key(
        "included configs", "stems of other configs to run together; study keys given beside it override theirs", None
    )
    sweep: Annotated[dict[str, Annotated[tuple[Anything, ...], Field(min_length=1)]], Field(min_length=1)] | None = key(
        "swept keys", "a case for each combination of values: key or dotted path, and its list of values", None
    )
    realisations: Annotated[int, Whole(1, LARGEST_REALISATIONS)] | None = key(
        "realisations", "how often the experiment is repeated", None
    )
    seed: Annotated[int, Whole(0, LARGEST_SEED)] | None = key("seed", "seed of the noise; default 1", None)
    figures: tuple[Name, ...] | dict[Name, Annotated[tuple[Name, ...], Field(min_length=1)]] = key(
        "figures that are drawn",
        "names or patterns with * and ?, in the report's order; or a mapping to the cases of each; default and []: all",
        (),
    )

    def cases_of_figures(self) -> dict[str, tuple[str, ...]]:
        """For each figure that is drawn, or pattern of such, the patterns of its cases."""
        return self.figures if isinstance(self.figures, dict) else dict.fromkeys(self.figures, ("*",))


class OwnCode(Member):
    """A filter that a class or a function of your own code makes; further keys are given to it."""

    model_config = ConfigDict(frozen=True, extra="allow")

    python: Annotated[str, Strict()] = key(
        "own code", "FILE.py:NAME, of a file beside the config, or MODULE:NAME: a class or a function of yours"
    )
    one_by_one: Flag = key("one by one", "whether the function takes the plots of one realisation at a time", False)
    identity: Annotated[str, Strict()] | Annotated[int, Strict()] | Annotated[float, Strict()] | None = key(
        "identity",
        "text or number, no unit: change it when what no file of yours shows has changed: data elsewhere, a network",
        None,
    )


COMMON_KEYS = tuple(Common.model_fields)


class Studies(Protocol):
    """The available studies; see radarsim.studies.registry, which config does not know."""

    def names(self) -> tuple[str, ...]:
        """The permitted values of `study:`."""

    def usable(self) -> tuple[str, ...]:
        """Those with readable keys; an outside package may be broken."""

    def has(self, name: str) -> bool:
        """Whether there is a study of that name."""

    def lacking(self, stem: str) -> tuple[str, ...]:
        """Why there is no config of a stem: faults of packages that would have it."""

    def keys(self, name: str) -> type[Study]:
        """The schema of a study's keys, imported on first use."""

    def coded(self, keys: "OwnCode", place: str, baseline: bool, folder: Path) -> Any:
        """A filter of the user's own code that a config in a folder names at a place. Raises ConfigError."""


# ---- json schema -----------------------------------------------------------------------------------------------------
TITLE = "radarsim experiment"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


# Pydantic's own word for a bound, left where other checks precede it; its keyword, and which of two bounds counts.
BOUNDS = {
    "ge": ("minimum", max),
    "gt": ("exclusiveMinimum", max),
    "le": ("maximum", min),
    "lt": ("exclusiveMaximum", min),
}


class OwnTitles(GenerateJsonSchema):
    """A key is called what its schema calls it: no title is made of its name."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def schema(studies: Studies) -> dict[str, Any]:
    """JSON Schema of a config, of one of the studies or an `include` of others, and of a scenario."""
    models = {name: studies.keys(name) for name in studies.usable()}
    described: tuple[type[BaseModel], ...] = (Common, OwnCode, *models.values())
    wanted: list[tuple[type[BaseModel], Literal["validation"]]] = [(model, "validation") for model in described]
    references, whole = models_json_schema(wanted, ref_template="#/$defs/{model}", schema_generator=OwnTitles)
    definitions = tidy(whole["$defs"])

    def popped(model: type[BaseModel]) -> Any:
        return definitions.pop(references[(model, "validation")]["$ref"].removeprefix("#/$defs/"))

    common = popped(Common)["properties"]
    kinds = {name: _experiment(name, popped(model), common) for name, model in models.items()}
    return {
        "$schema": DIALECT,
        "title": TITLE,
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in (*kinds, "include", "scenario")],
        "$defs": {**kinds, "include": _comparison(common, kinds), "scenario": _scenario(models, kinds), **definitions},
    }


def _experiment(name: str, study: dict[str, Any], common: dict[str, Any]) -> dict[str, Any]:
    """A config of one study: the common keys and its own."""
    kept = {key: value for key, value in common.items() if key not in ("study", "include")}
    properties = dict(study["properties"])
    if "baseline" in properties:
        one = {key: value for key, value in properties["baseline"].items() if key not in ("title", "description")}
        several = {"type": "array", "items": one, "minItems": 1, "uniqueItems": True}
        said = {key: value for key, value in properties["baseline"].items() if key in ("title", "description")}
        properties["baseline"] = {"anyOf": [one, several], **said}
    if "filters" in properties:
        items = properties["filters"]["items"]
        either = [*items.get("oneOf", [items]), {"$ref": f"#/$defs/{OwnCode.__name__}"}]
        properties["filters"] = {**properties["filters"], "items": {"oneOf": either}}
    about = {"const": name, "description": study.get("description", name)}  # of a docstring, which -OO leaves out
    return {
        **study,
        "title": name,
        "properties": {"study": about, **properties, **kept},
        "required": ["study", *study.get("required", []), "realisations"],
    }


def _comparison(common: dict[str, Any], kinds: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """A config that includes others; mappings laid over keys of their studies need not be complete."""
    keys = {key: part for kind in reversed(kinds.values()) for key, part in kind["properties"].items()}
    return {
        "title": "include",
        "description": "Configs run together; keys of the study are laid over each: mappings key by key, lists whole.",
        "type": "object",
        "properties": {
            **{key: {"description": part["description"]} for key, part in keys.items() if "description" in part},
            **common,
            "study": {"enum": list(kinds), "description": common["study"]["description"]},
        },
        "required": ["include"],
        "additionalProperties": False,
    }


def _scenario(models: dict[str, type[Study]], kinds: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """A file in scenarios/: the inline content that it replaces in a config."""
    inline: list[dict[str, Any]] = []
    for name, model in models.items():
        for field, info in model.model_fields.items():
            if any(isinstance(mark, Scenario) for mark in info.metadata):
                inline += kinds[name]["properties"][field]["anyOf"][1:]
    return {"title": "scenario", "description": "What is observed.", "anyOf": inline}


def tidy(part: Any) -> Any:
    """A schema in JSON Schema's keywords, without those that carry no information.

    These are names of classes, and null, which means an absent key."""
    if isinstance(part, list):
        return [tidy(item) for item in part]
    if not isinstance(part, dict):
        return part
    kept = {key: tidy(value) for key, value in part.items() if not _idle(key, value, part)}
    for bound, (keyword, tighter) in BOUNDS.items():
        if isinstance(kept.get(bound), int | float):
            limit = kept.pop(bound)
            kept[keyword] = tighter(limit, kept.get(keyword, limit))
    choices = [choice for choice in kept.get("anyOf", ()) if choice != {"type": "null"}]
    if len(choices) == 1:
        del kept["anyOf"]
        kept = choices[0] | kept
    elif choices:
        kept["anyOf"] = choices
    return kept


def _idle(key: str, value: object, part: dict[str, Any]) -> bool:
    """Whether a keyword (and no property that happens to have its name) carries no information."""
    if key == "title":
        return isinstance(value, str) and "properties" in part
    return key == "discriminator" or (key == "default" and value in (None, {}))


def schema_json(studies: Studies) -> str:
    """The schema as text; docs/schema.json holds it."""
    return json.dumps(schema(studies), indent=1, ensure_ascii=False)
