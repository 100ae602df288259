"""All that claims, measures and interpretations are made with, in one module to import from.

The names are stable: docs/reference/stability.md."""

from radarsim.engine.results import CaseResult
from radarsim.papers.claim import Claim, PaperClaims, Part
from radarsim.papers.claim_files import load_choices, load_claims, parse_claims, with_arguments, with_cases
from radarsim.papers.evidence import (
    Curve,
    Evidence,
    MissingEvidence,
    common_times,
    exact_number,
    ratio,
    shipped_spec,
    subtract,
)
from radarsim.papers.interpretations import (
    ChangedResults,
    Choice,
    ImpossibleInterpretation,
    Interpretation,
    PaperInterpretations,
)
from radarsim.papers.key_interpretations import KeyInterpretations
from radarsim.report.statistics import Estimate, difference

__all__ = [
    "CaseResult",
    "ChangedResults",
    "Choice",
    "Claim",
    "Curve",
    "Estimate",
    "Evidence",
    "ImpossibleInterpretation",
    "Interpretation",
    "KeyInterpretations",
    "MissingEvidence",
    "PaperClaims",
    "PaperInterpretations",
    "Part",
    "common_times",
    "difference",
    "exact_number",
    "load_choices",
    "load_claims",
    "parse_claims",
    "ratio",
    "shipped_spec",
    "subtract",
    "with_arguments",
    "with_cases",
]
