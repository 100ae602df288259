"""The messages that a catalogue translates, found in the sources; and the catalogues, brought up to date.

`python -m making.messages` rewrites every catalogue: its translations kept, messages that nothing says any more left
out, new ones added empty, those of a file together under its name. `python -m making.messages ru` lists what is not
translated.
"""

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from radarsim.api.inventory import inventory
from radarsim.config.common_keys import CommonKeys
from radarsim.config.model import Model
from radarsim.config.validate import models_in
from radarsim.language import gettext_catalogue
from radarsim.language.translate import NUMBER_PLACEHOLDER, NUMBERS
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN, UNCLEAR
from radarsim.papers.interpretations import with_spaces
from radarsim.papers.study_claims import claims_of, interpretations_of
from radarsim.papers.verdict_rule import CLASSES, VOID
from radarsim.studies import registry

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "radarsim"
CATALOGUES = PACKAGE / "language"
CALLS = {"tr": 1, "term": 1, "plural": 2}  # functions that say messages, and how many texts they take
SAYING = ("exact_but_for",)  # functions of studies that return a message
APART = ("api/maintenance/one_file", "api/maintenance/one_step")  # of other packages
IN_TEMPLATE = re.compile(r'\b(tr|plural)\(((?:"(?:[^"\\]|\\.)*"(?:,\s*)?)+)')
QUOTED = re.compile(r'"((?:[^"\\]|\\.)*)"')


@cache
def found() -> dict[tuple[str, str, str], list[str]]:
    """Context, text and plural of every message, with the places that say it."""
    said: dict[tuple[str, str, str], list[str]] = {}
    for text, plural, place in (
        *(*in_sources(), *in_templates(), *in_schemas(), *in_claims(), *in_interpretations()),
        *(*in_scenarios(), *in_inventory()),
    ):
        if re.search("[A-Za-zσ]", text):
            places = said.setdefault(("", text, plural), [])
            if place not in places:
                places.append(place)
    return together(said)


def together(said: dict[tuple[str, str, str], list[str]]) -> dict[tuple[str, str, str], list[str]]:
    """The messages, of those that differ in their numbers alone one for all of them."""
    like = {
        key: (key[0], key[1] if key[2] or "{" in key[1] else NUMBERS.sub(NUMBER_PLACEHOLDER, key[1]), key[2])
        for key in said
    }
    count = Counter(like.values())
    merged: dict[tuple[str, str, str], list[str]] = {}
    for key, places in said.items():
        merged.setdefault(like[key] if count[like[key]] > 1 else key, []).extend(places)
    return merged


def in_sources() -> Iterator[tuple[str, str, str]]:
    """The texts that `tr`, `term` and `plural` are called with."""
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if any(part in name for part in APART):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name in SAYING:
                for one in ast.walk(node):
                    if isinstance(one, ast.Return) and isinstance(one.value, ast.Constant) and one.value.value:
                        yield str(one.value.value), "", name
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in CALLS:
                texts = [one.value for one in node.args[: CALLS[node.func.id]] if isinstance(one, ast.Constant)]
                if len(texts) == CALLS[node.func.id]:
                    yield texts[0], "".join(texts[1:]), name


def in_templates() -> Iterator[tuple[str, str, str]]:
    """The texts of pages' templates."""
    for path in sorted(PACKAGE.rglob("*.j2")):
        for call, texts in IN_TEMPLATE.findall(path.read_text(encoding="utf-8")):
            quoted = QUOTED.findall(texts)[: CALLS[call]]
            yield quoted[0], "".join(quoted[1:]), path.relative_to(ROOT).as_posix()


def in_schemas() -> Iterator[tuple[str, str, str]]:
    """Titles, units and descriptions of all keys."""
    models: list[type[Model]] = [CommonKeys, *(registry.keys(name) for name in registry.SHIPPED)]
    seen: set[type[Model]] = set()
    while models:
        model = models.pop(0)
        if model in seen:
            continue
        seen.add(model)
        place = f"{model.__module__.replace('.', '/')}.py"
        for info in model.model_fields.values():
            extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
            for text in (info.title, str(extra.get("unit", "")), " ".join((info.description or "").split())):
                if text:
                    yield text, "", place
            models += models_in(info.annotation)


def in_claims() -> Iterator[tuple[str, str, str]]:
    """What the claims of all papers say, and the classes that they come out in."""
    for text in (*CLASSES, VOID, NOT_JUDGED, NOT_RUN, UNCLEAR):
        yield text, "", "radarsim/papers/verdict_rule.py"
    for name in registry.SHIPPED:
        for paper in filter(None, [claims_of(registry.study(name))]):
            place = f"radarsim/papers/{name}/claims.yaml"
            yield paper.paper, "", place
            for claim in paper.claims:
                for text in (claim.statement, claim.place, claim.interpretation, claim.unstated):
                    yield text, "", place
                for part in claim.parts:
                    yield part.what, "", place
                    yield part.unit, "", place


def in_interpretations() -> Iterator[tuple[str, str, str]]:
    """What the papers leave open, its alternatives, and why."""
    for name in registry.SHIPPED:
        of = interpretations_of(registry.study(name))
        if of is None:
            continue
        place = f"radarsim/papers/{name}/interpretations.yaml"
        for choice in of.choices:
            own = ((one.reason, with_spaces(one.name)) for one in choice.alternatives)
            for text in (choice.asks, *(text for both in own for text in both)):
                yield text, "", place
            if choice.original == choice.english:  # the paper is silent
                yield choice.original, "", place


def in_inventory() -> Iterator[tuple[str, str, str]]:
    """What `radarsim list` says of configs, scenarios, studies and filters."""
    for _, _, rows in inventory():
        for row in rows:
            yield row[-1], "", "radarsim/api/inventory.py"


def in_scenarios() -> Iterator[tuple[str, str, str]]:
    """Names of the stages of shipped flights."""
    for path in sorted((ROOT / "scenarios").glob("*.yaml")):
        for name in re.findall(r"\{name: ([\w ]+)[,}]", path.read_text(encoding="utf-8")):
            yield name, "", f"scenarios/{path.name}"


def brought_up(text: str) -> str:
    """A catalogue with the messages of today: what is translated stays, forms of words that are asked for stay too."""
    entries = gettext_catalogue.entries(text)
    old = {one.key: one for one in entries}
    made = [one for one in entries if one.context or not one.id]
    forms, file = 3 if "nplurals=3" in text else 2, ""
    for (context, message, plural), places in sorted(found().items(), key=lambda pair: (pair[1][0], pair[0])):
        before = old.get((context, message))
        said = dict(before.translations) if before and before.plural == plural else {}
        said = said or dict.fromkeys(range(forms if plural else 1), "")
        made.append(gettext_catalogue.Entry(message, context, plural, said, [f"#: {places[0]}"] * (places[0] != file)))
        file = places[0]
    return gettext_catalogue.catalogue_text(made)


def untranslated(code: str) -> list[str]:
    """The messages that a catalogue lacks."""
    entries = {
        one.key: one for one in gettext_catalogue.entries((CATALOGUES / f"{code}.po").read_text(encoding="utf-8"))
    }
    return [
        text
        for context, text, _ in found()
        if (context, text) not in entries or not entries[context, text].is_translated
    ]


def main() -> None:
    """Bring every catalogue up to date, or list what one lacks."""
    for code in sys.argv[1:]:
        lacking, every = untranslated(code), len(found())
        sys.stdout.write("\n".join(lacking) + f"\n{every - len(lacking)} of {every} messages are translated\n")
    for path in () if sys.argv[1:] else sorted(CATALOGUES.glob("*.po")):
        path.write_text(brought_up(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
