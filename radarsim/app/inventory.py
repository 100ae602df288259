"""What there is to run: configs, scenarios, studies and filters. Loads no kernels."""

from collections.abc import Sequence
from pathlib import Path

from radarsim.app.configs import lookup
from radarsim.errors import ConfigError
from radarsim.language import term
from radarsim.studies import registry

Inventory = Sequence[tuple[str, Sequence[str], Sequence[tuple[str, ...]]]]  # title, columns, rows


def described(file: Path | None) -> str:
    """The first line of a YAML file's leading comment, without its own name; empty where there is no such file."""
    if file is None:
        return ""
    with file.open(encoding="utf-8") as lines:
        for line in lines:
            words = line.lstrip("#").strip()
            if not line.startswith("#"):
                break
            if not words.startswith("yaml-language-server"):
                return words.partition(" — ")[2] or words
    return ""


def inventory() -> Inventory:
    """What `radarsim list` shows: title, columns and rows of each kind of thing at hand."""
    configs = [(stem, described(lookup.config_file(stem))) for stem in lookup.stems("configs")]
    scenarios = [(stem, described(lookup.scenario_file(stem, None))) for stem in lookup.stems("scenarios")]
    studies = registry.parts(lambda study: (study.about, dict(study.filters)))
    about = [(name, words) for name, (words, _) in studies.items()]
    about += [(name, f"cannot be used: {words}") for name, words in registry.unusable().items()]
    filters = [(name, key, words) for name, (_, of) in studies.items() for key, words in of.items()]
    return [
        (term("Configs (radarsim run NAME)"), ("name", "what it is"), configs),
        (term("Scenarios (target: NAME)"), ("name", "what it is"), scenarios),
        (term("Studies (study: NAME)"), ("name", "paper and question"), about),
        (term("Filters"), ("study", "keys", "what it is"), filters),
    ]


def selected(whole: Inventory, words: Sequence[str]) -> Inventory:
    """Of an inventory the kinds that some words name, and the rows that hold all other words, in any case of letters.

    Raises ConfigError where nothing is left.
    """
    kinds = {title.partition(" ")[0].lower(): title for title, _, _ in whole}
    wanted = {kinds[word.lower()] for word in words if word.lower() in kinds} or set(kinds.values())
    parts = [word.lower() for word in words if word.lower() not in kinds]
    found = [
        (title, columns, [row for row in rows if all(part in " ".join(row).lower() for part in parts)])
        for title, columns, rows in whole
        if title in wanted
    ]
    if parts and not any(rows for _, _, rows in found):
        raise ConfigError(
            f"{' '.join(words)}: nothing of this name; `radarsim list` shows all, or one of {', '.join(kinds)}"
        )
    return [(title, columns, rows) for title, columns, rows in found if rows or not parts]
