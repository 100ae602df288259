"""The JSON Schema of configs, for editors and for `radarsim schema`."""

import json
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from radarsim.config.common_keys import CommonKeys, Studies, UserFilterKeys
from radarsim.config.marks import Scenario
from radarsim.config.study_keys import StudyKeys

TITLE = "radarsim experiment"
DIALECT = "https://json-schema.org/draft/2020-12/schema"

# Pydantic's words for bounds, which it leaves where other checks come first: their keywords, and which of two counts.
BOUNDS = {
    "ge": ("minimum", max),
    "gt": ("exclusiveMinimum", max),
    "le": ("maximum", min),
    "lt": ("exclusiveMaximum", min),
}


class KeyTitles(GenerateJsonSchema):
    """Takes the titles of keys from their schemas, and makes none from their names."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def json_schema(studies: Studies) -> dict[str, Any]:
    """The JSON Schema of a config, of a study or with an `include`, and of a scenario."""
    models = {name: studies.keys(name) for name in studies.usable_studies()}
    described_models: tuple[type[BaseModel], ...] = (CommonKeys, UserFilterKeys, *models.values())
    models_to_describe: list[tuple[type[BaseModel], Literal["validation"]]] = [
        (model, "validation") for model in described_models
    ]
    references, all_schemas = models_json_schema(
        models_to_describe, ref_template="#/$defs/{model}", schema_generator=KeyTitles
    )
    definitions = tidy(all_schemas["$defs"])

    def take_definition(model: type[BaseModel]) -> Any:
        return definitions.pop(references[(model, "validation")]["$ref"].removeprefix("#/$defs/"))

    common = take_definition(CommonKeys)["properties"]
    kinds = {name: _study_config_schema(name, take_definition(model), common) for name, model in models.items()}
    return {
        "$schema": DIALECT,
        "title": TITLE,
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in (*kinds, "include", "scenario")],
        "$defs": {
            **kinds,
            "include": _include_schema(common, kinds),
            "scenario": _scenario_schema(models, kinds),
            **definitions,
        },
    }


def _study_config_schema(name: str, study: dict[str, Any], common: dict[str, Any]) -> dict[str, Any]:
    """The schema of a config of one study: the common keys and those of the study."""
    common_keys = {key: value for key, value in common.items() if key not in ("study", "include")}
    properties = dict(study["properties"])
    if "baseline" in properties:
        single_baseline = {
            key: value for key, value in properties["baseline"].items() if key not in ("title", "description")
        }
        baseline_list = {"type": "array", "items": single_baseline, "minItems": 1, "uniqueItems": True}
        title_and_description = {
            key: value for key, value in properties["baseline"].items() if key in ("title", "description")
        }
        properties["baseline"] = {"anyOf": [single_baseline, baseline_list], **title_and_description}
    if "filters" in properties:
        items = properties["filters"]["items"]
        filter_schemas = [*items.get("oneOf", [items]), {"$ref": f"#/$defs/{UserFilterKeys.__name__}"}]
        properties["filters"] = {**properties["filters"], "items": {"oneOf": filter_schemas}}
    study_schema = {
        "const": name,
        "description": study.get("description", name),
    }  # of a docstring, which -OO leaves out
    return {
        **study,
        "title": name,
        "properties": {"study": study_schema, **properties, **common_keys},
        "required": ["study", *study.get("required", []), "realisations"],
    }


def _include_schema(common: dict[str, Any], kinds: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The schema of a config that includes others; mappings laid over theirs need not be complete."""
    keys = {key: schema for kind in reversed(kinds.values()) for key, schema in kind["properties"].items()}
    return {
        "title": "include",
        "description": "Configs run together; keys of the study are laid over each: mappings key by key, lists whole.",
        "type": "object",
        "properties": {
            **{key: {"description": schema["description"]} for key, schema in keys.items() if "description" in schema},
            **common,
            "study": {"enum": list(kinds), "description": common["study"]["description"]},
        },
        "required": ["include"],
        "additionalProperties": False,
    }


def _scenario_schema(models: dict[str, type[StudyKeys]], kinds: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The schema of a file in scenarios/: what may stand in its place in a config."""
    inline_schemas: list[dict[str, Any]] = []
    for name, model in models.items():
        for field, info in model.model_fields.items():
            if any(isinstance(mark, Scenario) for mark in info.metadata):
                inline_schemas += kinds[name]["properties"][field]["anyOf"][1:]
    return {"title": "scenario", "description": "What is observed.", "anyOf": inline_schemas}


def tidy(schema: Any) -> Any:
    """A schema in the keywords of JSON Schema, without those that say nothing: names of classes, and null."""
    if isinstance(schema, list):
        return [tidy(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    keywords = {key: tidy(value) for key, value in schema.items() if not _carries_nothing(key, value, schema)}
    for bound, (keyword, tighter_of) in BOUNDS.items():
        if isinstance(keywords.get(bound), int | float):
            limit = keywords.pop(bound)
            keywords[keyword] = tighter_of(limit, keywords.get(keyword, limit))
    choices = [choice for choice in keywords.get("anyOf", ()) if choice != {"type": "null"}]
    if len(choices) == 1:
        del keywords["anyOf"]
        keywords = choices[0] | keywords
    elif choices:
        keywords["anyOf"] = choices
    return keywords


def _carries_nothing(key: str, value: object, schema: dict[str, Any]) -> bool:
    """Whether a keyword, not a property with its name, says nothing."""
    if key == "title":
        return isinstance(value, str) and "properties" in schema
    return key == "discriminator" or (key == "default" and value in (None, {}))


def json_schema_text(studies: Studies) -> str:
    """The schema as text; docs/schema.json holds it."""
    return json.dumps(json_schema(studies), indent=1, ensure_ascii=False)
