"""claims.csv: verdicts on the claims of an experiment, and the reasons where there is none."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.errors import MeasureError
from radarsim.papers.claim import Claim, PaperClaims, Part
from radarsim.papers.claim_outcome import ClaimOutcome, claim_outcome
from radarsim.papers.evidence import Evidence, ExactNumber, MissingEvidence, has_interval
from radarsim.papers.paper_cases import CaseKeys, ShippedCases, case_keys, key_differences, paper_members
from radarsim.papers.verdict_rule import (
    CONFIRMED,
    REFUTED,
    UNDECIDED,
    JudgedPart,
    judged_interval,
    miss_in_margins,
    part_verdict,
)
from radarsim.report import tables
from radarsim.report.statistics import ERROR_OF_PROGRAM, MIN_TRUSTED_REALISATIONS, Estimate, standard_errors

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.config.experiment import Case


UNCLEAR, NOT_RUN, NOT_JUDGED = "not distinguishable", "not run", "not judged here"
MAX_REASON_ITEMS, MAX_KEYS_OF_ONE_CASE = 3, 8  # keys and cases in a reason; keys in a reason on one case
NO_NUMBER = "its measure gives no number"
ANOTHER_EXPERIMENT = "not the paper's experiment: {changed}"


def old_verdict(measured: Estimate, strict: tuple[float, float]) -> str:
    """Whether an interval lies inside a range, outside, or neither: the rule of version 0.1."""
    if not (measured.lo <= measured.hi):
        return UNCLEAR
    if strict[0] <= measured.lo and measured.hi <= strict[1]:
        return CONFIRMED
    if measured.hi < strict[0] or measured.lo > strict[1]:
        return REFUTED
    return UNCLEAR


COLUMNS = (
    *("claim", "paper", "statement", "case", "measured", "lo", "hi", "expected", "verdict"),
    *("expected_lo", "expected_hi", "quantity", "unit", "place", "interpretation", "overall"),
    *("exact", "margin", "miss", "class", "holds", "of", "depends_on", "old_verdict", "original"),
    *("margin_kind", "ceiling", "n", "worst_miss", "needed", "extension", "variants_of", "reason", "as_shipped"),
    *("judged_lo", "judged_hi", "declared"),
)
CLASS_COLUMNS = ("verdict", "overall", "class", "as_shipped")  # of these columns
# Of these columns; empty where there is none.
NUMBER_COLUMNS = (
    *("measured", "lo", "hi", "expected_lo", "expected_hi", "exact", "margin", "miss", "holds", "of"),
    *("ceiling", "n", "worst_miss", "needed", "judged_lo", "judged_hi"),
)
NOT_RUN_CELLS = dict.fromkeys(NUMBER_COLUMNS, "") | dict.fromkeys(CLASS_COLUMNS, NOT_RUN)  # of a claim without verdict


def claims_table(
    paper_claims: PaperClaims | None,
    results: Sequence[CaseResult],
    tables_by_name: "Mapping[str, pd.DataFrame]",
    shipped: ShippedCases,
    stem: str = "",
) -> "pd.DataFrame":
    """claims.csv: a row for each part of each claim that these results can judge.

    A claim uses only the paper's cases: those of its config, which `shipped` gives by its stem. Claims of the config
    `stem`, the one that was run, are all listed, with a reason where they cannot be judged; other claims if every part
    can be judged."""
    rows: list[dict[str, Any]] = []
    if paper_claims is not None:
        papers = _PaperEvidence(paper_claims, results, tables_by_name, shipped)
        for claim in paper_claims.claims:
            evidence, changed = papers.evidence(claim.config)
            rows += rows_of_claim(claim, paper_claims.paper, evidence, changed, paper_claims.holds(claim, stem))
    table = tables.frame({name: [row[name] for row in rows] for name in COLUMNS})
    table.attrs[TABLES_READ] = TablesRead(row[TABLES_READ] for row in rows)
    return table


TABLES_READ = "looked"  # beside the rows of claims.csv, not in them: the tables, with components, behind a part


class TablesRead(list[Any]):
    """What stands under LOOKED: pandas copies it deeply with every part of the table, which nobody needs."""

    def __deepcopy__(self, memo: object) -> "TablesRead":
        return self


class _PaperEvidence:
    """The paper's part of the results, by the config of a claim."""

    def __init__(
        self, paper_claims: PaperClaims, results: Sequence[CaseResult], tables_by_name: Mapping, shipped: ShippedCases
    ):
        self._paper_claims, self._results, self._tables, self._shipped = paper_claims, results, tables_by_name, shipped
        self._evidence_by_config: dict[str, tuple[Evidence | None, str]] = {}

    def evidence(self, config: str) -> tuple[Evidence | None, str]:
        """The evidence for claims of a config, None where no case is the paper's; differences of the other cases."""
        if config not in self._evidence_by_config:
            paper_claims = self._paper_claims
            specs = _paper_cases(paper_claims, config, self._shipped)
            self._evidence_by_config[config] = (
                self._evidence(specs),
                _differences_in_words(paper_claims, self._results, specs),
            )
        return self._evidence_by_config[config]

    def _evidence(self, shipped: Sequence[CaseKeys]) -> Evidence | None:
        may_grow = self._paper_claims.may_grow
        members = {
            result.name: paper_members(_case_keys(self._paper_claims, result), shipped, may_grow)
            for result in self._results
        }
        paper_members_of = {name: indices for name, indices in members.items() if indices is not None}
        if not paper_members_of:
            return None
        tables_by_name = self._tables
        if len(paper_members_of) < len(members):
            tables_by_name = {
                name: _rows_of_cases(table, set(paper_members_of)) for name, table in tables_by_name.items()
            }
        return self._paper_claims.evidence(
            [result for result in self._results if result.name in paper_members_of], tables_by_name, paper_members_of
        )


def _paper_cases(paper_claims: PaperClaims, config: str, shipped: ShippedCases) -> list[CaseKeys]:
    """The paper's cases, by the shipped config that claims name."""
    return [_case_keys(paper_claims, case) for case in shipped(config) or ()]


def _case_keys(paper_claims: PaperClaims, case: "CaseResult | Case") -> CaseKeys:
    return case_keys(case, paper_claims.may_grow, paper_claims.may_shorten)


def _differences_in_words(
    paper_claims: PaperClaims,
    cases: "Sequence[CaseResult | Case]",
    papers: Sequence[CaseKeys],
    max_keys: int = MAX_REASON_ITEMS,
) -> str:
    """The keys in which other cases differ from the nearest of the paper's: at most so many for each case."""
    lines = []
    for case in cases:
        keys = key_differences(_case_keys(paper_claims, case), papers, paper_claims.may_grow)
        if keys:
            lines.append(f"{case.name}: {', '.join(keys[:max_keys])}" + (" …" if len(keys) > max_keys else ""))
    return "; ".join(lines[:MAX_REASON_ITEMS]) + (
        f"; and {len(lines) - MAX_REASON_ITEMS} more" if len(lines) > MAX_REASON_ITEMS else ""
    )


def _rows_of_cases(table: "pd.DataFrame", names: set[str]) -> "pd.DataFrame":
    """The rows of a table for these cases, or without a case."""
    return table[table["case"].isin(names)] if "case" in table else table


@dataclass(frozen=True)
class _MeasuredPart:
    """A part with its result: the numbers, or why there are none."""

    part: Part
    cases: str = ""
    judged: JudgedPart | None = None
    old: str = ""
    why: str = ""
    tables_read: tuple[tuple[str, str], ...] = ()


def rows_of_claim(
    claim: Claim, paper: str, evidence: Any, changed: str = "", of_config: bool = True
) -> list[dict[str, Any]]:
    """Rows of claims.csv for a claim, a row each part. evidence: an `Evidence`, or one of its kind; None where no case
    is the paper's, and `changed` says in what they differ."""
    if evidence is None and not (of_config and changed):
        return []
    measured_parts = [_measure_part(part, evidence, changed) for part in claim.parts]
    if not of_config and any(measured_part.judged is None for measured_part in measured_parts):
        return []
    judged_parts = [
        (measured_part, measured_part.judged) for measured_part in measured_parts if measured_part.judged is not None
    ]
    outcome = claim_outcome([judged for _, judged in judged_parts], **claim.judging_options) if judged_parts else None
    sampled_parts = sum(judged.is_sampled and not judged.is_void and judged.asserted for _, judged in judged_parts)
    asserted = [
        measured_part for measured_part in measured_parts if measured_part.part.asserted
    ] or measured_parts  # other parts decide nothing
    is_complete = all(measured_part.judged is not None for measured_part in asserted) or (
        outcome is not None and outcome.kind == REFUTED
    )
    is_complete = is_complete and not (
        outcome is not None and lacks_number(outcome, [judged for _, judged in judged_parts])
    )
    return [
        _part_row(claim, paper, measured_part, outcome if is_complete else None, sampled_parts)
        for measured_part in measured_parts
    ]


def lacks_number(outcome: ClaimOutcome, parts: Sequence[JudgedPart]) -> bool:
    """Whether a claim is undecided for want of a number, which no run of any length would give."""
    asserted = [part for part in parts if part.asserted] or parts
    return outcome.kind == UNDECIDED and not all(part.has_number for part in asserted)


def _measure_part(part: Part, evidence: Evidence | None, changed: str) -> _MeasuredPart:
    """Measure a part, or give the reason why not."""
    if evidence is None:
        return _MeasuredPart(part, why=ANOTHER_EXPERIMENT.format(changed=changed))
    evidence.tables_read.clear()
    try:
        measured = part.measure(evidence)
        cases = [evidence.case(key) for key in part.cases]
        judged = judged_part(part, evidence, measured, min((case.count for case in cases), default=0))
    except MissingEvidence as missing:
        default_reason = ANOTHER_EXPERIMENT.format(changed=changed) if changed else "a required case is missing"
        reason = missing.why or default_reason
        return _MeasuredPart(part, why=reason)
    except MeasureError as error:
        return _MeasuredPart(part, why=f"{MEASURE_FAILED}: {error.lines[0]}")
    tables_with_components = {table for table, component in evidence.tables_read if component}
    tables_read = tuple(
        sorted(read for read in evidence.tables_read if read[1] or read[0] not in tables_with_components)
    )
    judged = replace(judged, exact=exact_value(part, evidence, measured))
    names = ", ".join(dict.fromkeys(case.name for case in cases))
    old = old_verdict(measured, part.expected.strict)
    why = disagreement_message(part, judged) if judged.has_number else NO_NUMBER
    return _MeasuredPart(part, names, judged, old, why, tables_read)


def judged_part(part: Part, evidence: Evidence, measured: Estimate, n: int) -> JudgedPart:
    """A part with its numbers, before its exact value is known; n: realisations."""
    value, lo, hi = (float(number) for number in measured)
    return JudgedPart(
        *(value, lo, hi, part.expected.lo, part.expected.hi),
        margin=part.expected.margin * (part.scale(evidence) if part.scale else 1.0),
        kind=part.expected.kind,
        ceiling=part.ceiling(evidence) if part.ceiling else math.nan,
        n=n,
        **{name: getattr(part, name) for name in ("statement", "number", "variant", "against_print", "asserted")},
    )


def exact_value(part: Part, evidence: Evidence, measured: Estimate) -> float:
    """The exact value of a part, NaN where unknown: an estimate with an interval is not exact, whatever it read."""
    try:
        if part.exact:
            return float(part.exact(evidence))
        estimate = part.measure(evidence.exactly())
    except MissingEvidence:
        estimate = measured if isinstance(measured, ExactNumber) else UNKNOWN
    return math.nan if has_interval(estimate) else float(estimate.value)


def disagreement_message(part: Part, judged: JudgedPart) -> str:
    """A message where a part has an exact value of its own, further off than chance explains; else nothing. All other
    values follow from tables, which `agreement` compares with their exact columns."""
    if part.exact is None or not judged.is_known_exactly or judged.n < MIN_TRUSTED_REALISATIONS:
        return ""
    slack = max(1e-9 * abs(judged.exact), ROUNDING * judged.margin)
    distance = standard_errors(Estimate(judged.measured, judged.lo, judged.hi), judged.exact)
    if abs(judged.exact - judged.measured) <= slack or not distance > ERROR_OF_PROGRAM:
        return ""
    return (
        f"{DISAGREEMENT}: exact {judged.exact:.6g}, simulated {judged.measured:.6g} [{judged.lo:.6g}, {judged.hi:.6g}]"
    )


UNKNOWN = Estimate(math.nan, math.nan, math.nan)
ROUNDING = 1e-3  # of a margin, for values without width: identities hold to the last bits
MEASURE_FAILED = "its measure fails"
DISAGREEMENT = f"exact value and simulation differ by more than {ERROR_OF_PROGRAM} standard errors"


def disagreements(rows: "pd.DataFrame") -> list[str]:
    """A line for each part whose own exact value and simulation disagree: errors of the program."""
    disagreeing = rows[rows["reason"].astype(str).str.startswith(DISAGREEMENT)]
    return [f"{row['claim']}: {row['quantity']} ({row['case']}): {row['reason']}" for _, row in disagreeing.iterrows()]


def failed_measures(rows: "pd.DataFrame") -> list[str]:
    """A line for each measure that failed, with its place: errors of the claims' author."""
    reasons = dict.fromkeys(rows["reason"].astype(str))
    return [why.removeprefix(f"{MEASURE_FAILED}: ") for why in reasons if why.startswith(MEASURE_FAILED)]


def _part_row(
    claim: Claim, paper: str, measured_part: _MeasuredPart, outcome: ClaimOutcome | None, sampled_parts: int
) -> dict[str, Any]:
    part, judged = measured_part.part, measured_part.judged
    row = empty_row(claim, paper) | {
        "case": measured_part.cases,
        **{
            "quantity": part.what,
            "unit": part.unit,
            "margin_kind": part.expected.kind,
            "expected": part.expected.words,
        },
        **{"expected_lo": _table_number(part.expected.lo), "expected_hi": _table_number(part.expected.hi)},
        "variants_of": f"{part.statement}{part.number}" if part.number else "",
        "extension": not (claim.counted and part.asserted),
        "overall": outcome.words if outcome else NOT_JUDGED,
        **dict.fromkeys(("class", "as_shipped"), outcome.kind if outcome else NOT_JUDGED),
        "worst_miss": _table_number(outcome.miss) if outcome else math.nan,
        "needed": outcome.needed if outcome and outcome.needed else math.nan,
        "verdict": NOT_JUDGED,
        "reason": measured_part.why or claim.unstated,
        TABLES_READ: measured_part.tables_read,
    }
    if judged is None:
        return row
    return row | {
        **{name: getattr(judged, name) for name in ("measured", "lo", "hi", "exact", "ceiling", "n")},
        **{"margin": _table_number(judged.margin), "miss": _table_number(miss_in_margins(judged))},
        "verdict": part_verdict(judged, sampled_parts) if judged.has_number else NOT_JUDGED,
        "old_verdict": measured_part.old,
        **dict(zip(("judged_lo", "judged_hi"), judged_interval(judged, sampled_parts), strict=True)),
    }


def empty_row(claim: Claim, paper: str) -> dict[str, Any]:
    """The columns of a claim that do not depend on a measurement; the others empty."""
    empty: dict[str, Any] = dict.fromkeys(COLUMNS, "") | dict.fromkeys(NUMBER_COLUMNS, math.nan)
    return empty | {
        **{"claim": claim.id, "paper": paper, "extension": not claim.counted},
        **{name: getattr(claim, name) for name in ("statement", "place", "interpretation", "original")},
        "reason": claim.unstated,
    }


def not_run_row(claim: Claim, paper: str) -> dict[str, Any]:
    """The row of a claim without a stored verdict."""
    return empty_row(claim, paper) | NOT_RUN_CELLS


def _table_number(value: float) -> float:
    """A number for a table: twelve digits, NaN for infinity."""
    return float(f"{value:.12g}") if math.isfinite(value) else math.nan


def claim_rows(papers: Sequence[PaperClaims], stored: Mapping[str, Sequence[Mapping]]) -> list[dict]:
    """Rows of claims with the columns of claims.csv and `config`: as stored, or one row each as not run.

    stored: config stem → the rows of its claims.csv."""
    rows: list[dict] = []
    for paper, claim in ((paper_claims.paper, claim) for paper_claims in papers for claim in paper_claims.claims):
        claim_rows_of = [dict(row) for row in stored.get(claim.config, ()) if row["claim"] == claim.id]
        if not claim_rows_of:
            claim_rows_of = [not_run_row(claim, paper)]
        rows += [row | {"config": claim.config} for row in claim_rows_of]
    return rows


def rows_without_results(
    paper_claims: PaperClaims, cases: "Sequence[Case]", shipped: ShippedCases, stem: str
) -> list[dict]:
    """A row for each claim that an experiment without stored verdicts certainly judges, or certainly does not.

    With the columns of claims.csv. cases: all of the experiment's. Where none is the paper's, the claim is not judged,
    and the row gives the reason; where the shipped config `stem` holds it, it is not run. A claim that a run might
    judge has no row."""
    rows: list[dict] = []
    for claim in paper_claims.claims:
        papers, state, why = _paper_cases(paper_claims, claim.config, shipped), NOT_RUN, claim.unstated
        if all(paper_members(_case_keys(paper_claims, case), papers, paper_claims.may_grow) is None for case in cases):
            changed = _differences_in_words(paper_claims, cases[:1], papers, MAX_KEYS_OF_ONE_CASE)
            more = f"; and {len(cases) - 1} more" if len(cases) > 1 else ""
            state, why = NOT_JUDGED, ANOTHER_EXPERIMENT.format(changed=changed + more)
        elif not paper_claims.holds(claim, stem):
            continue
        row = empty_row(claim, paper_claims.paper) | dict.fromkeys(NUMBER_COLUMNS, "") | {"reason": why}
        rows.append(row | dict.fromkeys(CLASS_COLUMNS, state))
    return rows


def first_rows(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The first row of each claim."""
    return list({(row["paper"], row["claim"]): row for row in reversed(list(rows))}.values())[::-1]
