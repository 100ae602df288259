"""The key of a study's paper (P1), and where its claims lie, found without reading the claims."""

import re
from importlib.util import find_spec
from pathlib import Path

from radarsim.studies import registry
from radarsim.studies.interface import Study

PACKAGE = "radarsim.papers"
CLAIMS_FILE = "claims.yaml"
INTERPRETATIONS_FILE = "interpretations.yaml"


def paper_key(study: Study) -> str:
    """The prefix of the names of a study's claims (P1); empty if it is not known."""
    if claims_yaml := getattr(study, "claims_yaml", ""):
        return _paper_in(claims_yaml)
    files = [folder / CLAIMS_FILE for _, folder in claim_folders(study)]
    return _paper_in(files[0].read_text(encoding="utf-8")) if files else ""


def _paper_in(claims_yaml: str) -> str:
    """The key `paper` in the text of a claims.yaml, on a line of its own; else nothing."""
    key = re.search(r"^paper: *([\w-]+) *$", claims_yaml, re.MULTILINE)
    return key[1] if key else ""


def claim_folders(study: Study) -> list[tuple[str, Path]]:
    """The packages with claims of a study, and their folders."""
    if has_shipped_claims(study):
        root = Path(__file__).with_name(study.name)
        files = sorted(root.rglob(CLAIMS_FILE), key=lambda file: len(file.parts))
        return [(".".join((PACKAGE, *file.parent.relative_to(root.parent).parts)), file.parent) for file in files]
    package = getattr(study, "package", type(study).__module__)
    spec = find_spec(package)
    folders = list(spec.submodule_search_locations or ()) if spec else []
    return [(package, Path(folder)) for folder in folders if (Path(folder) / CLAIMS_FILE).is_file()]


def has_shipped_claims(study: Study) -> bool:
    """Whether the claims of a study lie in a folder of this package."""
    return study.name in registry.SHIPPED and Path(__file__).with_name(study.name).is_dir()
