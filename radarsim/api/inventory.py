"""The inventory of `radarsim list`: configs, scenarios, studies, filters."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.api.configs import config_path, config_stems
from radarsim.config import find_files
from radarsim.errors import ConfigError
from radarsim.extensions import extensions
from radarsim.language.translate import term
from radarsim.studies import registry

if TYPE_CHECKING:
    from radarsim.studies.interface import Study


Inventory = Sequence[tuple[str, Sequence[str], Sequence[tuple[str, ...]]]]  # title, columns, rows

STUDY_OR_INCLUDED = re.compile(
    r"""^(study|include):[\s\[\-"']*([\w.-]+)""", re.MULTILINE
)  # of several included configs the first

MIN_VARIANTS = 6  # of a config, from which they are folded


def config_description(text: str) -> str:
    """The first line of a YAML file's leading comment, without the file's name; empty where there is none."""
    for line in text.splitlines():
        comment = line.lstrip("#").strip()
        if not line.startswith("#"):
            break
        if not comment.startswith("yaml-language-server"):
            return comment.partition(" — ")[2] or comment
    return ""


def _study_label(study: "Study") -> str:
    """A short label of a study, such as its paper's; empty if it has none."""
    return next(filter(None, (extension.study_label(study) for extension in extensions())), "")


def _configs() -> list[tuple[str, str, str]]:
    """Name, paper (such as P1, or the study's name) and description of each config, in the order of the studies."""
    papers = {name: key or name for name, key in registry.call_studies(_study_label).items()}
    texts = {stem: _text(config_path(stem)) for stem in config_stems()}
    rows = []
    for stem, text in texts.items():
        kind, study = "include", stem
        for _ in texts:  # ends even for a circular include, which is refused at run time
            match = STUDY_OR_INCLUDED.search(texts.get(study, ""))
            if kind != "include" or match is None:
                break
            kind, study = match.groups()
        rows.append((study, stem, config_description(text)))
    order = [*papers, *(study for study, _, _ in rows)]
    rows.sort(key=lambda row: (order.index(row[0]), row[1]))
    return [(stem, papers.get(study, ""), description) for study, stem, description in rows]


def _text(file: Path | None) -> str:
    return file.read_text(encoding="utf-8", errors="replace") if file else ""


def inventory() -> Inventory:
    """What `radarsim list` shows: title, columns and rows of each kind."""
    scenarios = [
        (stem, config_description(_text(find_files.scenario_file(stem, None))))
        for stem in find_files.available_stems("scenarios")
    ]
    studies = registry.call_studies(lambda study: (study.about, dict(study.filters)))
    study_rows = [(name, about) for name, (about, _) in studies.items()]
    study_rows += [(name, f"cannot be used: {reason}") for name, reason in registry.unusable_studies().items()]
    filters = [(name, key, about) for name, (_, about_keys) in studies.items() for key, about in about_keys.items()]
    package_filters, unusable = registry.package_filters()
    filters += [
        (name, f"kind: {kind}", keys.model_fields["kind"].description or "")
        for name, models_by_kind in package_filters.items()
        for kind, keys in models_by_kind.items()
    ]
    filters += [("", f"kind: {kind}", f"cannot be used: {reason}") for kind, reason in unusable.items()]
    return [
        (term("Configs (radarsim run NAME)"), ("name", "paper", "what it is"), _configs()),
        (term("Scenarios (target: NAME)"), ("name", "what it is"), scenarios),
        (term("Studies (study: NAME)"), ("name", "paper and question"), study_rows),
        (term("Filters"), ("study", "keys", "what it is"), filters),
    ]


def fold_families(entries: Inventory, words: Sequence[str]) -> tuple[Inventory, dict[str, int]]:
    """An inventory without the many variants of a config, whose names begin with its name; and how many each has.

    Those stay that the words name: all configs, or a part of the config's name."""
    folded: dict[str, int] = {}
    kinds = {title.partition(" ")[0].lower() for title, _, _ in entries}
    shown = []
    for title, columns, rows in entries:
        if not kinds.issuperset(map(str.lower, words)):
            for name, *_ in rows if "paper" in columns else ():
                is_meant = any(word.lower() in name.lower() for word in words)
                if (count := sum(other.startswith(f"{name}_") for other, *_ in rows)) >= MIN_VARIANTS and not is_meant:
                    folded[name] = count
        shown.append(
            (title, columns, [row for row in rows if not any(row[0].startswith(f"{name}_") for name in folded)])
        )
    return shown, folded


def filter_inventory(entries: Inventory, words: Sequence[str]) -> Inventory:
    """The kinds of an inventory that the words name, with the rows that contain all other words; case is ignored.

    Raises ConfigError where no row contains them."""
    kinds = {title.partition(" ")[0].lower(): title for title, _, _ in entries}
    titles = {kinds[word.lower()] for word in words if word.lower() in kinds} or set(kinds.values())
    search_words = [word.lower() for word in words if word.lower() not in kinds]
    matching = [
        (title, columns, [row for row in rows if all(word in " ".join(row).lower() for word in search_words)])
        for title, columns, rows in entries
        if title in titles
    ]
    if search_words and not any(rows for _, _, rows in matching):
        raise ConfigError(
            f"{' '.join(words)}: no entry has this name; `radarsim list` shows all, or one of {', '.join(kinds)}"
        )
    return [(title, columns, rows) for title, columns, rows in matching if rows or not search_words]
