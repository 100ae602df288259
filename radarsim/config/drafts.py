"""Cases under construction, and the config that they come from, while `expand_cases` expands it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from radarsim.config.common_keys import COMMON_KEYS, CommonKeys
from radarsim.config.complete_config import Content, rename_configs
from radarsim.config.document import Document
from radarsim.config.experiment import swept_value_text
from radarsim.config.find_files import normalised_name


@dataclass(frozen=True)
class Draft:
    """A case under construction: its document with the keys applied so far."""

    document: Document
    stem: str
    study: str
    swept_values: tuple[tuple[str, object], ...]
    realisations: int | Mapping[str, int] | None
    seed: int | None

    @property
    def name(self) -> str:
        """The name of the case."""
        return " ".join([self.stem, *(f"{key}={swept_value_text(value)}" for key, value in self.swept_values)])


@dataclass(frozen=True)
class Expansion:
    """A config expanded: its common keys, its drafts, and its content written out in full."""

    common: CommonKeys
    drafts: list[Draft]
    content: Content

    def renamed(self, stem: str) -> "Expansion":
        """The expansion of a config that changes what it includes, and is included itself: named after that config."""
        has_several = len({draft.stem for draft in self.drafts}) > 1

        def new_name(name: str) -> str:
            return f"{stem}:{name}" if has_several else stem

        drafts = [replace(draft, stem=new_name(draft.stem)) for draft in self.drafts]
        return replace(self, drafts=drafts, content=rename_configs(self.content, new_name))


OverlaidKeys = tuple[Document, ...]  # keys laid over an included config, those of the nearest config first


def changes_included(document: Document) -> bool:
    """Whether a config changes what it includes: keys of a study stand beside `include`."""
    return "include" in document.data and not set(COMMON_KEYS).issuperset(document.data)


def config_name(document: Document) -> str:
    """The name of a config: as it says, else that of its file."""
    name = document.data.get("name")
    if isinstance(name, str):
        return normalised_name(name)
    return normalised_name(document.file.stem) if document.file else "config"
