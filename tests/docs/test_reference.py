"""What the reference pages are read off: descriptions of keys with units, docstrings, columns of result files."""

import re
from pathlib import Path

import pytest
from making import commands, generated, keys, modules

from radarsim.cli import main
from radarsim.config.schema import schema
from radarsim.studies import registry

ROOT = Path(__file__).parents[2]
UNITS = {
    "m": r"\bm\b",
    "s": r"\bs\b",
    "mps": "m/s",
    "mps2": "m/s²",
    "mps3": "m/s³",
    "rad": r"\brad\b",
    "radps": "rad/s",
    "deg": "in degrees",
    "degps": "in degrees",
    "hz": r"\bHz\b",
    "g": "standard gravities",
    "kgpm2": "kg/m²",
}
# Of a number whose key has no unit: the units of its parts, or the word that says it has none.
PURE = r"m/s|Hz|\bs\b|\bm\b|rad\b|probabilit|correlation|factor|ratio|standard (?:dev|err)|samples' unit|km²|no unit"
DEFINITIONS = schema(registry)["$defs"]
KEYS = [(name, key) for name, model in DEFINITIONS.items() for key in model.get("properties", {})]


def takes_a_number(part):
    """Whether a key's value is a number that need not be whole, or holds such."""
    inner = [part.get("items"), part.get("additionalProperties"), *part.get("prefixItems", ())]
    inner += [*part.get("anyOf", ()), *part.get("oneOf", ())]
    return part.get("type") == "number" or any(takes_a_number(one) for one in inner if isinstance(one, dict))


@pytest.mark.parametrize(("name", "key"), KEYS, ids=lambda part: part)
def test_every_key_is_described_with_its_unit(name, key):
    part = DEFINITIONS[name]["properties"][key]
    about = part["description"]
    suffix = key.rpartition("_")[2] if "_" in key else ""
    if suffix in UNITS:
        assert re.search(UNITS[suffix], about), about
    elif takes_a_number(part):
        assert re.search(PURE, about), about


@pytest.mark.parametrize("module", modules.every_module(), ids=lambda module: module.__name__)
def test_every_public_function_says_what_it_does(module):
    assert module.__doc__
    assert not [name for name, thing in modules.public(module) if not thing.__doc__]


def test_public_names_are_seen():
    from radarsim.kernels import linear as kernels
    from radarsim.studies.range_doppler import filters

    seen = {name for name, _ in modules.public(filters)}
    assert {"error_recursion", "steady_state", "normalised_error"} <= seen
    assert not {"np", "pack"} & seen  # imported
    assert "simulate_block" in dict(modules.public(kernels))  # compiled ones too


def test_arrays_are_told_with_their_shapes():
    """Of what is public in the floors that work on arrays: a docstring that names shapes, where arrays come or go."""
    import numpy as np

    silent = []
    shown = ("study", "track", "scene", "sums", "tables", "figures", "words", "claims", "measures")
    for floor in ("physics", "studies"):
        for module in modules.every_module():
            if module.__name__.startswith(f"radarsim.{floor}.") and module.__name__.split(".")[-1] not in shown:
                for name, thing in modules.public(module):
                    hints = getattr(thing, "__annotations__", {})
                    has_arrays = any(np.ndarray is hint for hint in hints.values())
                    if has_arrays and not re.search(r"\([^)]*,[^)]*\)|any shape|per |×|\[|see `", thing.__doc__):
                        silent.append(f"{module.__name__}.{name}")
    assert silent == []


def test_reference_holds_every_key_and_every_command():
    text = keys.PAGE.read_text(encoding="utf-8")
    assert not [key for _, key in KEYS if f"`{key}`" not in text]
    made = commands.markdown()
    assert not [name for name in main.commands if f"## radarsim {name}\n" not in made]


def test_the_page_of_keys_is_that_of_todays_schema():
    """`make schema` writes it."""
    text = keys.PAGE.read_text(encoding="utf-8")
    assert keys.filled(text) == text
    assert text.count("\n## study: ") == len(registry.names())
    assert keys.filled("a\n<!-- keys -->\nold\n<!-- end -->\nz") != "a\n<!-- keys -->\nold\n<!-- end -->\nz"


def test_marks_are_replaced_and_unknown_ones_refused():
    source = ["a\n\n<!-- generated: commands -->\n"]
    generated.fill(None, "page", source)
    assert "## radarsim run" in source[0]
    with pytest.raises(KeyError):
        generated.fill(None, "page", ["<!-- generated: nothing -->"])


CONFIGS = (
    "rls2",
    "sonar_smoothing",
    "sonar_conversion",
    "sonar_manoeuvre",
    "sonar_clutter",
    "multimodel",
    "discriminator",
)


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_every_file_and_column_is_in_the_documentation(config, tmp_path):
    from radarsim.app.run import run

    result = run(config, realisations=50, out=tmp_path, figures=False)
    study = result.experiment.study
    common = (ROOT / "docs/results.md").read_text(encoding="utf-8")
    tables = (ROOT / "docs/reference/tables.md").read_text(encoding="utf-8")
    before, _, own = tables.partition(f"\n## {study}\n")
    told = common + before.partition("\n## ")[0] + own.partition("\n## ")[0]
    words = set(re.findall(r"\w+", " ".join(re.findall(r"`[^`]+`", told))))
    names = {file.name for file in (tmp_path / config).iterdir() if file.is_file()}
    assert not [name for name in names if f"`{name}`" not in told]
    columns = {column for table in result.tables.values() for column in table.columns}
    assert not sorted(column for column in columns - words if not column.endswith(("_lo", "_hi")))
