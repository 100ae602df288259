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
    papers = {}
    for name, interpretations in by_study(interpretations_of, keys).items():
        claims = None if interpretations is None else claims_of(registry.study(name))
        if interpretations is not None and claims is not None:
            papers[interpretations.paper] = OpenPaper(interpretations, claims, name)
    return dict(sorted(papers.items()))


def judging_requests(names: Sequence[str] = ()) -> list[JudgingRequest]:
    """Requests from names of papers (P1) and claims (P1.4); without names, all papers. Raises ConfigError for an
    unknown paper or claim, with the known ones."""
    papers = open_papers()
    owner = {claim.id: key for key, paper in papers.items() for claim in paper.claims.claims}
    faults = [_unknown_name(name, papers, owner) for name in names if name not in papers and name not in owner]
    faults += [fault for paper in papers.values() for fault in _claims_without_choices(paper, names)]
    if faults:
        raise ConfigError(*faults)
    requests = []
    for key, paper in papers.items():
        is_whole = not names or key in names
        claims = [
            claim
            for claim in paper.claims.claims
            if (is_whole or claim.id in names) and paper.interpretations.leaves_open(claim)
        ]
        if claims:
            requests.append(JudgingRequest(paper, claims))
    return requests


def _claims_without_choices(paper: OpenPaper, names: Sequence[str]) -> list[str]:
    """Faults of requested claims that depend on nothing that the paper leaves open."""
    open_claims = [claim.id for claim in paper.claims.claims if paper.interpretations.leaves_open(claim)]
    alternatives = ", ".join(open_claims)
    return [
        f"interpretations: {claim.id} depends on nothing that its paper leaves open; claims that do: {alternatives}"
        for claim in paper.claims.claims
        if claim.id in names and claim.id not in open_claims
    ]


def _unknown_name(name: str, papers: Mapping[str, OpenPaper], owner: Mapping[str, str]) -> str:
    paper = name.partition(".")[0]
    claims = {claim.id for paper_claims_of in paper_claims([paper]) for claim in paper_claims_of.claims}
    if paper not in papers and any(claim.partition(".")[0] == paper for claim in claims):
        return (
            f"interpretations: {name}: its study declares no choices that {paper} leaves open: "
            "there are no other interpretations"
        )
    if name in claims:
        return f"interpretations: {name} is an extension of ours: no paper leaves anything open in it"
    ids = [claim for claim, key in owner.items() if key == paper]
    allowed = f"its claims: {', '.join(ids)}" if ids else f"papers: {', '.join(papers)}; claims as P1.4"
    return f"interpretations: no paper or claim {name!r}; {allowed}"
