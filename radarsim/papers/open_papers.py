"""The papers that leave something open, and requests to judge their claims under every interpretation."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from radarsim.errors import ConfigError
from radarsim.papers.claim import Claim, PaperClaims
from radarsim.papers.interpretations import PaperInterpretations
from radarsim.papers.study_claims import by_study, claims_of, interpretations_of, paper_claims
from radarsim.studies import registry


@dataclass(frozen=True)
class OpenPaper:
    """A paper with interpretations: its open choices, its claims, and the study that judges them."""

    interpretations: PaperInterpretations
    claims: PaperClaims
    study: str


@dataclass(frozen=True)
class JudgingRequest:
    """The part of a paper to judge: its claims."""

    paper: OpenPaper
    claims: list[Claim]


def open_papers(keys: Collection[str] = ()) -> dict[str, OpenPaper]:
    """The papers with interpretations, by key (P1); `keys` adds or restricts papers."""
    found = {}
    for name, of in by_study(interpretations_of, keys).items():
        claims = None if of is None else claims_of(registry.study(name))
        if of is not None and claims is not None:
            found[of.paper] = OpenPaper(of, claims, name)
    return dict(sorted(found.items()))


def judging_requests(names: Sequence[str] = ()) -> list[JudgingRequest]:
    """Requests from names of papers (P1) and claims (P1.4); without names, all papers. Raises ConfigError for an
    unknown paper or claim, with the known ones."""
    every = open_papers()
    owner = {claim.id: key for key, paper in every.items() for claim in paper.claims.claims}
    faults = [_unknown_name(name, every, owner) for name in names if name not in every and name not in owner]
    faults += [fault for paper in every.values() for fault in _claims_without_choices(paper, names)]
    if faults:
        raise ConfigError(*faults)
    found = []
    for key, paper in every.items():
        whole = not names or key in names
        claims = [one for one in paper.claims.claims if (whole or one.id in names) and paper.interpretations.open(one)]
        if claims:
            found.append(JudgingRequest(paper, claims))
    return found


def _claims_without_choices(paper: OpenPaper, names: Sequence[str]) -> list[str]:
    """Faults of requested claims that depend on nothing that the paper leaves open."""
    kept = [one.id for one in paper.claims.claims if paper.interpretations.open(one)]
    return [
        f"interpretations: {one.id} depends on nothing that its paper leaves open; claims that do: {', '.join(kept)}"
        for one in paper.claims.claims
        if one.id in names and one.id not in kept
    ]


def _unknown_name(name: str, every: Mapping[str, OpenPaper], owner: Mapping[str, str]) -> str:
    paper = name.partition(".")[0]
    judged = {claim.id for of in paper_claims([paper]) for claim in of.claims}
    if paper not in every and any(claim.partition(".")[0] == paper for claim in judged):
        return (
            f"interpretations: {name}: its study declares no choices that {paper} leaves open: "
            "there are no other interpretations"
        )
    if name in judged:
        return f"interpretations: {name} is an extension of ours: no paper leaves anything open in it"
    ids = [claim for claim, key in owner.items() if key == paper]
    allowed = f"its claims: {', '.join(ids)}" if ids else f"papers: {', '.join(every)}; claims as P1.4"
    return f"interpretations: no paper or claim {name!r}; {allowed}"
