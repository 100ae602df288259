"""The schema itself: described, fresh in docs/, named by every shipped file; and the `_deg` twins."""

import fnmatch
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field

from radarsim.api.configs import load, schema_json
from radarsim.api.new_configs import write_new_config
from radarsim.config import common_keys
from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.json_schema import json_schema
from radarsim.config.key_types import Number, Positive
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.config.validate import models_in, validate
from radarsim.errors import ConfigError
from radarsim.studies import registry

ROOT = Path(__file__).parents[2]


def every_model(model: type[BaseModel]) -> set[type[BaseModel]]:
    inner = {m for info in model.model_fields.values() for m in models_in(info.annotation)}
    return {model}.union(*(every_model(m) for m in inner))


@pytest.mark.parametrize("study", registry.SHIPPED)
def test_every_key_is_described(study):
    for model in every_model(registry.keys(study)) | {common_keys.CommonKeys}:
        assert model.__doc__
        for name, info in model.model_fields.items():
            assert info.description, f"{model.__name__}.{name}"
            assert info.title == (info.title or "").strip() != "", f"{model.__name__}.{name}"


@pytest.mark.parametrize("study", registry.SHIPPED)
def test_no_key_is_both_common_and_a_studys(study):
    assert not set(registry.keys(study).model_fields) & set(common_keys.COMMON_KEYS)


def test_the_copy_for_editors_is_fresh():
    """Made by `radarsim schema > docs/schema.json`."""
    assert json.loads((ROOT / "docs/schema.json").read_text(encoding="utf-8")) == json_schema(registry)


@pytest.mark.parametrize("file", sorted((ROOT / "configs").glob("*.yaml")), ids=lambda file: file.stem)
def test_shipped_configs_name_themselves_their_paper_and_their_schema(file):
    comments = [line for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    assert any(line.startswith(f"# configs/{file.name} — ") for line in comments)
    assert re.search("Gorshkov|Sychev|Butyrskiy|Uss|P[1-4]", "".join(comments)), "which paper"
    assert "# yaml-language-server: $schema=../docs/schema.json" in comments


@pytest.mark.parametrize("file", sorted((ROOT / "scenarios").glob("*.yaml")), ids=lambda file: file.stem)
def test_shipped_scenarios_name_themselves(file):
    comments = [line for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    assert any(line.startswith(f"# scenarios/{file.name} — ") for line in comments)
    assert "# yaml-language-server: $schema=../docs/schema.json" in comments


def test_bounds_are_in_the_words_of_json_schema():
    """Where other checks precede a bound, pydantic leaves its own words, which no editor knows."""
    definitions = json_schema(registry)["$defs"]
    duration = definitions["Flight"]["properties"]["duration_s"]
    assert (duration["exclusiveMinimum"], duration["maximum"]) == (0, 3600)
    alarms = definitions["Detector"]["properties"]["false_alarm_probability"]["items"]
    assert (alarms["exclusiveMinimum"], alarms["exclusiveMaximum"]) == (0, 1)
    assert not re.search(r'"(ge|gt|le|lt)": [-\d]', json.dumps(definitions))


@pytest.mark.slow
def test_json_schema_is_told_without_docstrings_too():
    """PYTHONOPTIMIZE=2 takes the docstrings away that describe the studies."""
    command = [sys.executable, "-OO", "-m", "radarsim", "schema"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    bare, whole = (json.loads(text)["$defs"]["range_doppler"]["properties"] for text in (told, schema_json()))
    assert bare["study"]["const"] == "range_doppler"
    assert bare["scans"] == whole["scans"]


def test_json_schema_tells_studies_apart_and_says_nothing_idle():
    whole = json.loads(schema_json())
    kinds = [choice["$ref"].removeprefix("#/$defs/") for choice in whole["oneOf"]]
    assert kinds == [*registry.SHIPPED, "include", "scenario"]
    for study in registry.SHIPPED:
        part = whole["$defs"][study]
        assert part["properties"]["study"]["const"] == study
        assert {"study", "realisations"} <= set(part["required"])
        assert part["additionalProperties"] is False
    assert '"null"' not in schema_json()
    assert '"title": "Radar"' not in schema_json()
    scans = whole["$defs"]["range_doppler"]["properties"]["scans"]
    assert (scans["type"], scans["minimum"], scans["maximum"]) == ("integer", 2, 100_000)


class Ray(Model):
    """A ray in a fan."""

    kind: Literal["ray"] = Field(description="a ray")
    spread_rad: Annotated[Number, Field(ge=0, lt=math.pi / 2)] = Field(description="spread")


class Beam(Model):
    """A beam in a fan."""

    kind: Literal["beam"] = Field(description="a beam")
    bearings_rad: tuple[Number, ...] = Field((), description="bearings")


class Noise(Model):
    """Noise by coordinate."""

    x: Positive = Field(description="of x")


class Fan(StudyKeys):
    """A study with angles in all places."""

    tilt_rad: Number = Field(description="tilt")
    course_rad: Number | None = Field(None, description="course")
    turn_radps: Number = Field(0.0, description="rate of turn")
    steps: Literal["designed", "dense"] | tuple[Positive, ...] = Field("designed", description="steps")
    noise: Positive | Noise = Field(1.0, description="noise, one number or by coordinate")
    rays: tuple[Annotated[Ray | Beam, Field(discriminator="kind")], ...] = Field((), description="rays")


def fan(**data):
    faults = ErrorList()
    checked = validate(Fan, Document(data, "config", None, {(): Origin("config")}), faults)
    faults.raise_if_any()
    return checked


def test_degrees_wherever_radians_are():
    checked = fan(
        tilt_deg=180,
        course_deg=90.0,
        turn_degps=-18,
        rays=[{"kind": "ray", "spread_deg": 45}, {"kind": "beam", "bearings_deg": [0, 90]}],
    )
    assert checked == fan(
        tilt_rad=math.pi,
        course_rad=math.pi / 2,
        turn_radps=-math.pi / 10,
        rays=[{"kind": "ray", "spread_rad": math.pi / 4}, {"kind": "beam", "bearings_rad": [0, math.pi / 2]}],
    )


RAY, BEAM = {"kind": "ray"}, {"kind": "beam"}
KEYS = "tilt_rad, tilt_deg, course_rad, course_deg, turn_radps, turn_degps, steps, noise, rays"
UNKNOWN = f"unknown key; did you mean course_deg? allowed: {KEYS}"
FAULTS = [
    ({"tilt_deg": "x"}, "tilt_deg: must be a number, got 'x'"),
    ({"tilt_deg": True}, "tilt_deg: must be a number, got true"),
    ({"tilt_deg": 1, "tilt_rad": 1}, "tilt_deg: given as tilt_rad too"),
    ({}, "tilt_rad: required key is missing"),
    ({"tilt_deg": 1, "curse_deg": 1}, f"curse_deg: {UNKNOWN}"),
    ({"tilt_rad": 1, "rays": [RAY | {"spread_deg": 90}]}, "rays.0.spread_deg: must be < 90, got 90"),
    ({"tilt_rad": 1, "rays": [RAY | {"spread_rad": 2}]}, "rays.0.spread_rad: must be < 1.57079632679, got 2"),
    ({"tilt_rad": 1, "rays": [BEAM | {"bearings_deg": [1, "x"]}]}, "rays.0.bearings_deg.1: must be a number, got 'x'"),
    (
        {"tilt_rad": 1, "rays": [BEAM | {"spread": 1}]},
        "rays.0.spread: unknown key; allowed: kind, bearings_rad, bearings_deg",
    ),
    ({"tilt_rad": 1, "noise": "x"}, "noise: must be a number, got 'x'"),
    ({"tilt_rad": 1, "noise": -1}, "noise: must be > 0, got -1"),
    ({"tilt_rad": 1, "noise": {}}, "noise.x: required key is missing"),
    ({"tilt_rad": 1, "noise": {"x": -1}}, "noise.x: must be > 0, got -1"),
    ({"tilt_rad": 1, "noise": {"x": 1, "y": 1}}, "noise.y: unknown key; allowed: x"),
    ({"tilt_rad": 1, "steps": "desgned"}, "steps: must be one of designed, dense, got 'desgned'"),
    ({"tilt_rad": 1, "steps": [1, -1]}, "steps.1: must be > 0, got -1"),
    ({"tilt_rad": 1, "steps": 3}, "steps: must be one of designed, dense, got 3"),
    ({"tilt_rad": 1, "rays": [{"spread_deg": 1}]}, "rays.0.kind: required key is missing"),
]


@pytest.mark.parametrize(("data", "line"), FAULTS)
def test_faults_are_told_in_the_users_unit(data, line):
    with pytest.raises(ConfigError) as caught:
        fan(**data)
    assert caught.value.lines == (f"config: {line}",)


@pytest.fixture
def fans(monkeypatch):
    monkeypatch.setitem(registry.SHIPPED, "fan", __name__)
    monkeypatch.setattr(registry, "keys", lambda name: Fan)
    monkeypatch.setattr(Fan, "bare_keys", "rays")


def test_an_override_replaces_the_other_unit(fans):
    config = {"study": "fan", "realisations": 1, "tilt_rad": 1, "rays": [{"kind": "ray", "spread_deg": 1}]}
    spec = load(config, ["tilt_deg=180", "spread_rad=0.5"]).cases[0].spec
    assert (spec.tilt_rad, spec.rays[0].spread_rad) == (math.pi, 0.5)


def test_a_bare_key_means_those_members_that_have_it(fans):
    rays = [{"kind": "ray", "spread_deg": 1}, {"kind": "beam"}, {"kind": "ray", "spread_deg": 2}]
    config = {"study": "fan", "realisations": 1, "tilt_rad": 1, "rays": rays, "sweep": {"spread_deg": [45]}}
    (case,) = load(config).cases
    assert case.name == "config spread_deg=45"
    assert [getattr(ray, "spread_rad", None) for ray in case.spec.rays] == [math.pi / 4, None, math.pi / 4]


def test_a_new_config_names_the_schema_that_lies_beside_it(tmp_path):
    without = write_new_config("bare.radarsim", "rls2", tmp_path).read_text(encoding="utf-8")
    assert "yaml-language-server" not in without
    (tmp_path / "schema.json").write_text(schema_json(), encoding="utf-8")
    file = write_new_config("told.radarsim", "rls2", tmp_path)
    first, rest = file.read_text(encoding="utf-8").split("\n", 1)
    named = re.fullmatch(r"# yaml-language-server: \$schema=(\S+)", first)[1]
    assert json.loads((file.parent / named).read_text(encoding="utf-8"))["oneOf"]
    assert rest == without.replace("bare.radarsim", "told.radarsim")
    assert load(file).stem == "told.radarsim"


def test_the_catalogue_for_editors_has_the_form_that_they_read():
    """As SchemaStore's own: entries of name, description, patterns of files, address; a new config may be so named."""
    page = (ROOT / "docs/reference/yaml.md").read_text(encoding="utf-8")
    settings, catalogue = (json.loads(text) for text in re.findall(r"```json\n(.*?)```", page, re.S))
    assert catalogue["$schema"] == "https://json.schemastore.org/schema-catalog.json"
    (entry,) = catalogue["schemas"]
    assert set(entry) == {"name", "description", "fileMatch", "url"}
    (pattern,) = entry["fileMatch"]
    assert settings == {"yaml.schemas": {entry["url"].rpartition("/")[2]: pattern}}
    assert fnmatch.fnmatch("told.radarsim.yaml", pattern)
