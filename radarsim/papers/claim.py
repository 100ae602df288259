"""Claims as data: statement, place, and parts that say what is measured and which range the paper's words allow.

The ranges come from the words alone and were written down before anything was measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from radarsim.papers.evidence import Evidence
from radarsim.papers.expected_ranges import ExpectedRange
from radarsim.report.statistics import Estimate

Measure = Callable[[Any], Estimate]  # takes the evidence of the study, a subclass of Evidence
NumberMeasure = Callable[[Any], float]


@dataclass(frozen=True)
class Part:
    """One measurement of a claim: its cases (the study's keys), the quantity, its unit, the function, and the range.

    scale gives the quantity that the margin is relative to, such as σ; default: the margin is in the part's own unit.
    exact gives the exact value where `measure` of the exact curves does not; ceiling the score of a perfect estimator.
    statement, number, variant, against_print and asserted are as in `verdict_rule.JudgedPart`."""

    cases: tuple
    what: str
    unit: str
    measure: Measure
    expected: ExpectedRange
    scale: NumberMeasure | None = None
    exact: NumberMeasure | None = None
    ceiling: NumberMeasure | None = None
    statement: str = ""
    number: str = ""
    variant: str = ""
    against_print: bool = False
    asserted: bool = True


@dataclass(frozen=True)
class Claim:
    """A statement of a paper: its place, its interpretation, the parts that judge it, the config that holds them.

    original is the sentence in the paper's language. An extension is ours, and not counted. reported: the paper reports
    an assertion of others: judged under every interpretation, and not counted. unstated: what the paper omits and the
    statement cannot be judged without; joint: one variant has to give every number; internal: both sides are printed,
    so that a disagreement is within the print."""

    id: str
    place: str
    statement: str
    parts: tuple[Part, ...]
    interpretation: str = ""
    config: str = ""
    original: str = ""
    extension: bool = False
    reported: bool = False
    unstated: str = ""
    joint: bool = False
    internal: bool = False
    source: str = field(default="", compare=False)  # where its config is named, for messages

    @property
    def paper(self) -> str:
        """The key of the paper, the part of the id before its first point."""
        return self.id.partition(".")[0]

    @property
    def counted(self) -> bool:
        """Whether it is one of the paper's own claims."""
        return not (self.extension or self.reported)

    @property
    def judging_options(self) -> dict[str, bool]:
        """Its judging options, as arguments of `claim_outcome`."""
        return {"unstated": bool(self.unstated), "joint": self.joint, "internal": self.internal}


@dataclass(frozen=True)
class PaperClaims:
    """The claims of a paper that a study judges, and how its results are read for them.

    paper: how tables cite it, authors and year. page: the stem of the study's page in docs/, if any. may_shorten: keys
    that only shorten or extend a run: quantities that do not depend on its end are still judged. may_grow: the study's
    lists to which members may be added while it stays the paper's experiment; every other key must be as in the claim's
    config, see `radarsim.papers.paper_cases`. held_too: by the stem of a shipped config, the claims of other
    configs all of whose parts it holds: if it is changed so that it no longer judges them, it says so."""

    claims: Sequence[Claim]
    evidence: type[Evidence]
    paper: str
    page: str = ""
    may_grow: tuple[str, ...] = ()
    may_shorten: tuple[str, ...] = ()
    held_too: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def holds(self, claim: Claim, stem: str) -> bool:
        """Whether the shipped config of that stem holds all of a claim."""
        return claim.config == stem or claim.id in self.held_too.get(stem, ())
