"""The claims and interpretations of a study: a shipped one's in this package, another's in its own.

A study of a package has them beside it, in claims.yaml with measures.py and in interpretations.py, or by methods
`claims` and `interpretations`; a study in one file has them in its attributes `paper` and `claims_yaml`."""

from collections.abc import Callable, Collection, Sequence
from importlib import import_module
from typing import Any, TypeVar

from radarsim.papers import one_file_claims
from radarsim.papers.claim import PaperClaims
from radarsim.papers.claim_files import load_claims
from radarsim.papers.interpretations import PaperInterpretations
from radarsim.papers.paper_cases import ShippedCases
from radarsim.papers.paper_keys import CLAIMS_FILE, PACKAGE, claim_folders, has_shipped_claims, paper_key
from radarsim.studies import registry
from radarsim.studies.interface import Paper, Study
from radarsim.studies.onefile import OneFile

Declared = TypeVar("Declared")


def claims_of(study: Study) -> PaperClaims | None:
    """The claims of a study's paper; None where it has none."""
    if callable(method := getattr(study, "claims", None)):
        claims: PaperClaims | None = method()
        return claims
    if isinstance(study, OneFile):
        return one_file_claims.claims_of(study)
    folders, paper = claim_folders(study), _paper_of(study)
    if not folders or paper is None:
        return None
    measures = [import_module(f"{package}.measures") for package, _ in folders]
    all_claims = [
        claim
        for (_, folder), module in zip(folders, measures, strict=True)
        for claim in load_claims(folder / CLAIMS_FILE, module)
    ]
    if len(folders) > 1:
        all_claims.sort(key=lambda claim: int(claim.id.partition(".")[2]))
    return PaperClaims(all_claims, measures[0].Evidence, *paper)


def interpretations_of(study: Study) -> PaperInterpretations | None:
    """The open choices of a study's paper, and its claims under each interpretation; None where it has none."""
    if callable(method := getattr(study, "interpretations", None)):
        declared: PaperInterpretations | None = method()
        return declared
    if isinstance(study, OneFile):
        return one_file_claims.interpretations_of(study)
    for package, folder in claim_folders(study):
        if (folder / "interpretations.py").is_file():
            interpretations: PaperInterpretations = import_module(f"{package}.interpretations").Interpretations()
            return interpretations
    return None


def check_declarations(study: Study) -> None:
    """Raise ConfigError for unknown names in the claims of a study in one file."""
    if isinstance(study, OneFile) and study.claims_yaml:
        one_file_claims.declarations(study)


def claim_faults(study: Study, shipped: ShippedCases) -> Sequence[str]:
    """Names in a study's claims and interpretations that no shipped config has, a line each."""
    return one_file_claims.claim_faults(study, shipped) if isinstance(study, OneFile) else ()


def by_study(take: Callable[[Study], Declared], keys: Collection[str] = ()) -> dict[str, Declared | None]:
    """What `take` gives for each study whose paper has one of these keys (P1), or a key that is not known."""
    return registry.call_studies(lambda study: take(study) if not keys or paper_key(study) in ("", *keys) else None)


def paper_claims(keys: Collection[str] = ()) -> list[PaperClaims]:
    """The claims of every paper, or of those with these keys (P1) and others, in the order of the studies."""
    return [claims for claims in by_study(claims_of, keys).values() if claims is not None]


def _paper_of(study: Study) -> Paper | None:
    """How tables cite a study's paper, and what a user may change in its experiments."""
    home: Any = import_module(f"{PACKAGE}.{study.name}") if has_shipped_claims(study) else study
    paper: Paper | None = getattr(home, "PAPER" if has_shipped_claims(study) else "paper", None)
    return paper
