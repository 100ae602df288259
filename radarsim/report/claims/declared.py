"""The papers' claims as data: what a study declares."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from radarsim.report.claims.evidence import Evidence
from radarsim.report.claims.ranges import Range
from radarsim.report.statistics import Estimate

Measured = Callable[[Any], Estimate]  # of the evidence of the study, a subclass of Evidence
Number = Callable[[Any], float]


@dataclass(frozen=True)
class Part:
    """One measurement of a claim: its cases (the study's keys), what is measured, the unit, how, and the range.

    scale gives what the range's margin is a share of, as σ; default: the margin is in the part's own unit. exact
    gives the exact value where `measure` of the exact curves does not; ceiling what a perfect estimator would score.
    statement, number, variant, against_print and asserted are as in `rule.Judged`.
    """

    cases: tuple
    what: str
    unit: str
    measure: Measured
    expected: Range
    scale: Number | None = None
    exact: Number | None = None
    ceiling: Number | None = None
    statement: str = ""
    number: str = ""
    variant: str = ""
    against_print: bool = False
    asserted: bool = True


@dataclass(frozen=True)
class Claim:
    """A statement of a paper: where it stands, how it was read, the parts that judge it, the config that holds them.

    original is the sentence in the paper's language. An extension is ours, and not counted. reported: the paper says
    that others assert it, and does not itself: judged under every reading, and not counted. unstated says what the
    paper leaves out without which the statement cannot be judged; joint: one variant has to give every number;
    internal: both sides are printed, so that what does not agree is the print with itself.
    """

    id: str
    place: str
    statement: str
    parts: tuple[Part, ...]
    reading: str = ""
    config: str = ""
    original: str = ""
    extension: bool = False
    reported: bool = False
    unstated: str = ""
    joint: bool = False
    internal: bool = False

    @property
    def paper(self) -> str:
        """The key of the paper, the part of the id before its first point."""
        return self.id.partition(".")[0]

    @property
    def counted(self) -> bool:
        """Whether it is one of the paper's own claims."""
        return not (self.extension or self.reported)

    @property
    def how(self) -> dict[str, bool]:
        """How the rule takes it, as `rule.claim` wants it."""
        return {"unstated": bool(self.unstated), "joint": self.joint, "internal": self.internal}


@dataclass(frozen=True)
class PaperClaims:
    """The claims of a paper that a study judges, and how its results are read for them.

    paper is how tables cite it: authors and year. page is the stem of the study's page in docs/, where there is one.
    may_shorten names keys that only cut a run short, or let it go on: what does not depend on its end is judged still.
    may_grow names the study's lists to which members may be added without its being another experiment than the
    paper's; every other key must be as in the claim's config, see `radarsim.report.claims.paper`.
    held_too names, by the stem of a shipped config, the claims of other configs of which it holds every part: when it
    is changed so that it no longer judges them, it says so.
    """

    claims: Sequence[Claim]
    evidence: type[Evidence]
    paper: str
    page: str = ""
    may_grow: tuple[str, ...] = ()
    may_shorten: tuple[str, ...] = ()
    held_too: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def holds(self, claim: Claim, stem: str) -> bool:
        """Whether the shipped config of that stem holds a claim whole."""
        return claim.config == stem or claim.id in self.held_too.get(stem, ())
