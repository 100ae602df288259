"""The claims and interpretations of a study: a shipped one's in this package, another's in its own.

A study of a package has them beside it, in claims.yaml with measures.py and in interpretations.py, or by methods
`claims` and `interpretations`; a study in one file has them in its attributes `paper` and `claims_yaml`."""

from collections.abc import Callable, Collection, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from radarsim.papers.claim import PaperClaims
from radarsim.papers.claim_files import load_choices, load_claims
from radarsim.papers.interpretations import Choice, OpenChoices, PaperInterpretations, ShippedChoices
from radarsim.papers.paper_cases import ShippedCases
from radarsim.papers.paper_keys import (
    CLAIMS_FILE,
    INTERPRETATIONS_FILE,
    PACKAGE,
    claim_folders,
    has_shipped_claims,
    paper_key,
)
from radarsim.studies import registry
from radarsim.studies.interface import Paper, Study

Declared = TypeVar("Declared")


def claims_of(study: Any) -> PaperClaims | None:
    """The claims of a study's paper; None where it has none."""
    if callable(method := getattr(study, "claims", None)):
        claims: PaperClaims | None = method()
        return claims
    if _is_one_file(study):
        from radarsim.papers import one_file_claims

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


def interpretations_of(study: Any) -> PaperInterpretations | None:
    """The open choices of a study's paper, and its claims under each interpretation; None where it has none."""
    if callable(method := getattr(study, "interpretations", None)):
        declared: PaperInterpretations | None = method()
        return declared
    if _is_one_file(study):
        from radarsim.papers import one_file_claims

        return one_file_claims.interpretations_of(study)
    for package, folder in claim_folders(study):
        if (folder / "interpretations.py").is_file():
            interpretations: PaperInterpretations = import_module(f"{package}.interpretations").Interpretations()
            return interpretations
    return None


def choices_of(study: Study) -> OpenChoices | None:
    """What a study's paper leaves open; None where it has no interpretations. A shipped paper's are data."""
    if not callable(getattr(study, "interpretations", None)) and has_shipped_claims(study):
        for _, folder in claim_folders(study):
            if (folder / INTERPRETATIONS_FILE).is_file():
                return ShippedChoices(paper_key(study), _choices_in(folder / INTERPRETATIONS_FILE))
        return None
    return interpretations_of(study)


@cache
def _choices_in(file: Path) -> tuple[Choice, ...]:
    return load_choices(file)


def check_declarations(study: Any) -> None:
    """Raise ConfigError for unknown names in the claims of a study in one file."""
    if _is_one_file(study) and study.claims_yaml:
        from radarsim.papers import one_file_claims

        one_file_claims.declarations(study)


def claim_faults(study: Any, shipped: ShippedCases) -> Sequence[str]:
    """Names in a study's claims and interpretations that no shipped config has, a line each."""
    if not _is_one_file(study):
        return ()
    from radarsim.papers import one_file_claims

    return one_file_claims.claim_faults(study, shipped)


def _is_one_file(study: Any) -> bool:
    """Whether a study in one file declares its claims itself; told without loading what such studies are made of."""
    return hasattr(study, "claims_yaml")


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
