"""claims.csv: verdicts on the claims of an experiment, and the reasons where there is none."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.errors import MeasureError
from radarsim.papers.claim import Claim, PaperClaims, Part
from radarsim.papers.claim_outcome import ClaimOutcome, claim_outcome
from radarsim.papers.evidence import Evidence, ExactNumber, MissingEvidence
from radarsim.papers.paper_cases import CaseKeys, ShippedCases, case_keys, key_differences, paper_members
from radarsim.papers.verdict_rule import CONFIRMED, REFUTED, JudgedPart, judged_interval, miss_in_margins, part_verdict
from radarsim.report import tables
from radarsim.report.statistics import ERROR_OF_PROGRAM, FEW, Estimate, standard_errors

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.config.experiment import Case


UNCLEAR, NOT_RUN, NOT_JUDGED = "not distinguishable", "not run", "not judged here"
MAX_REASON_ITEMS, MAX_KEYS_OF_ONE_CASE = 3, 8  # keys and cases in a reason; keys in a reason on one case
ANOTHER_EXPERIMENT = "not the paper's experiment: {changed}"


def old_verdict(of: Estimate, strict: tuple[float, float]) -> str:
    """Whether an interval lies inside a range, outside, or neither: the rule of version 0.1."""
    if not (of.lo <= of.hi):
        return UNCLEAR
    if strict[0] <= of.lo and of.hi <= strict[1]:
        return CONFIRMED
    if of.hi < strict[0] or of.lo > strict[1]:
        return REFUTED
    return UNCLEAR


COLUMNS = (
    *("claim", "paper", "statement", "case", "measured", "lo", "hi", "expected", "verdict"),
    *("expected_lo", "expected_hi", "what", "unit", "place", "interpretation", "overall"),
    *("exact", "margin", "miss", "class", "holds", "of", "depends_on", "old_verdict", "original"),
    *("margin_kind", "ceiling", "n", "worst_miss", "needed", "extension", "number", "why", "as_shipped"),
    *("judged_lo", "judged_hi"),
)
CLASS_COLUMNS = ("verdict", "overall", "class", "as_shipped")  # of these columns
# Of these columns; empty where there is none.
NUMBER_COLUMNS = (
    *("measured", "lo", "hi", "expected_lo", "expected_hi", "exact", "margin", "miss", "holds", "of"),
    *("ceiling", "n", "worst_miss", "needed", "judged_lo", "judged_hi"),
)


def claims_table(
    of: PaperClaims | None,
    results: Sequence[CaseResult],
    made: "Mapping[str, pd.DataFrame]",
    shipped: ShippedCases,
    stem: str = "",
) -> "pd.DataFrame":
    """claims.csv: a row for each part of each claim that these results can judge.

    A claim uses only the paper's cases: those of its config, which `shipped` gives by its stem. Claims of the config
    `stem`, the one that was run, are all listed, with a reason where they cannot be judged; other claims if every part
    can be judged."""
    rows: list[dict[str, Any]] = []
    if of is not None:
        papers = _PaperEvidence(of, results, made, shipped)
        for claim in of.claims:
            rows += _claim_rows(claim, of.paper, papers, own=of.holds(claim, stem))
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

    def __init__(self, of: PaperClaims, results: Sequence[CaseResult], made: Mapping, shipped: ShippedCases):
        self._of, self._results, self._made, self._shipped = of, results, made, shipped
        self._seen: dict[str, tuple[Evidence | None, str]] = {}

    def evidence(self, config: str) -> tuple[Evidence | None, str]:
        """The evidence for claims of a config, None where no case is the paper's; differences of the other cases."""
        if config not in self._seen:
            of = self._of
            specs = _paper_cases(of, config, self._shipped)
            self._seen[config] = self._evidence(specs), _differences_in_words(of, self._results, specs)
        return self._seen[config]

    def _evidence(self, shipped: Sequence[CaseKeys]) -> Evidence | None:
        grow = self._of.may_grow
        every = {result.name: paper_members(_case_keys(self._of, result), shipped, grow) for result in self._results}
        places = {name: own for name, own in every.items() if own is not None}
        if not places:
            return None
        made = self._made
        if len(places) < len(every):
            made = {name: _rows_of_cases(table, set(places)) for name, table in made.items()}
        return self._of.evidence([result for result in self._results if result.name in places], made, places)


def _paper_cases(of: PaperClaims, config: str, shipped: ShippedCases) -> list[CaseKeys]:
    """The paper's cases, by the shipped config that claims name."""
    return [_case_keys(of, case) for case in shipped(config) or ()]


def _case_keys(of: PaperClaims, one: "CaseResult | Case") -> CaseKeys:
    return case_keys(one, of.may_grow, of.may_shorten)


def _differences_in_words(
    of: PaperClaims, held: "Sequence[CaseResult | Case]", papers: Sequence[CaseKeys], most: int = MAX_REASON_ITEMS
) -> str:
    """The keys in which other cases differ from the nearest of the paper's: at most so many for each case."""
    said = []
    for one in held:
        found = key_differences(_case_keys(of, one), papers, of.may_grow)
        if found:
            said.append(f"{one.name}: {', '.join(found[:most])}" + (" …" if len(found) > most else ""))
    return "; ".join(said[:MAX_REASON_ITEMS]) + (
        f"; and {len(said) - MAX_REASON_ITEMS} more" if len(said) > MAX_REASON_ITEMS else ""
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
    looked: tuple[tuple[str, str], ...] = ()


def _claim_rows(claim: Claim, paper: str, papers: _PaperEvidence, own: bool) -> list[dict[str, Any]]:
    seen, changed = papers.evidence(claim.config)
    if seen is None and not (own and changed):
        return []
    tried = [_measure_part(part, seen, changed) for part in claim.parts]
    if not own and any(one.judged is None for one in tried):
        return []
    here = [(one, one.judged) for one in tried if one.judged is not None]
    outcome = claim_outcome([of for _, of in here], **claim.how) if here else None
    many = sum(of.sampled and not of.void and of.asserted for _, of in here)
    asked = [one for one in tried if one.part.asserted] or tried  # other parts decide nothing
    whole = all(one.judged is not None for one in asked) or (outcome is not None and outcome.kind == REFUTED)
    return [_part_row(claim, paper, one, outcome if whole else None, many) for one in tried]


def _measure_part(part: Part, seen: Evidence | None, changed: str) -> _MeasuredPart:
    """Measure a part, or give the reason why not."""
    if seen is None:
        return _MeasuredPart(part, why=ANOTHER_EXPERIMENT.format(changed=changed))
    seen.looked.clear()
    try:
        measured = part.measure(seen)
        cases = [seen.case(key) for key in part.cases]
        of = judged_part(part, seen, measured, min((case.count for case in cases), default=0))
    except MissingEvidence as missing:
        other = ANOTHER_EXPERIMENT.format(changed=changed) if changed else "a required case is missing"
        reason = missing.why or other
        return _MeasuredPart(part, why=reason)
    except MeasureError as error:
        return _MeasuredPart(part, why=f"{MEASURE_FAILED}: {error.lines[0]}")
    closer = {table for table, component in seen.looked if component}
    looked = tuple(sorted(one for one in seen.looked if one[1] or one[0] not in closer))
    of = replace(of, exact=exact_value(part, seen, measured))
    names = ", ".join(dict.fromkeys(case.name for case in cases))
    old = old_verdict(measured, part.expected.strict)
    return _MeasuredPart(part, names, of, old, disagreement_message(part, of), looked)


def judged_part(part: Part, seen: Evidence, measured: Estimate, n: int) -> JudgedPart:
    """A part with its numbers, before its exact value is known; n: realisations."""
    value, lo, hi = (float(one) for one in measured)
    return JudgedPart(
        *(value, lo, hi, part.expected.lo, part.expected.hi),
        margin=part.expected.margin * (part.scale(seen) if part.scale else 1.0),
        kind=part.expected.kind,
        ceiling=part.ceiling(seen) if part.ceiling else math.nan,
        n=n,
        **{name: getattr(part, name) for name in ("statement", "number", "variant", "against_print", "asserted")},
    )


def exact_value(part: Part, seen: Evidence, measured: Estimate) -> float:
    """The exact value of a part, NaN where unknown."""
    try:
        if part.exact:
            return float(part.exact(seen))
        return float(part.measure(seen.exactly()).value)
    except MissingEvidence:
        return float(measured.value) if isinstance(measured, ExactNumber) else math.nan


def disagreement_message(part: Part, of: JudgedPart) -> str:
    """A message where a part has an exact value of its own, further off than chance explains; else nothing. All other
    values follow from tables, which `agreement` compares with their exact columns."""
    if part.exact is None or not of.known or of.n < FEW:
        return ""
    slack = max(1e-9 * abs(of.exact), ROUNDING * of.margin)
    apart = standard_errors(Estimate(of.measured, of.lo, of.hi), of.exact)
    if abs(of.exact - of.measured) <= slack or not apart > ERROR_OF_PROGRAM:
        return ""
    return f"{DISAGREEMENT}: exact {of.exact:.6g}, simulated {of.measured:.6g} [{of.lo:.6g}, {of.hi:.6g}]"


ROUNDING = 1e-3  # of a margin, for values without width: identities hold to the last bits
MEASURE_FAILED = "its measure fails"
DISAGREEMENT = f"exact value and simulation differ by more than {ERROR_OF_PROGRAM} standard errors"


def disagreements(rows: "pd.DataFrame") -> list[str]:
    """A line for each part whose own exact value and simulation disagree: errors of the program."""
    own = rows[rows["why"].astype(str).str.startswith(DISAGREEMENT)]
    return [f"{row['claim']}: {row['what']} ({row['case']}): {row['why']}" for _, row in own.iterrows()]


def failed_measures(rows: "pd.DataFrame") -> list[str]:
    """A line for each measure that failed, with its place: errors of the claims' author."""
    every = dict.fromkeys(rows["why"].astype(str))
    return [why.removeprefix(f"{MEASURE_FAILED}: ") for why in every if why.startswith(MEASURE_FAILED)]


def _part_row(claim: Claim, paper: str, one: _MeasuredPart, outcome: ClaimOutcome | None, many: int) -> dict[str, Any]:
    part, of = one.part, one.judged
    row = empty_row(claim, paper) | {
        "case": one.cases,
        **{"what": part.what, "unit": part.unit, "margin_kind": part.expected.kind, "expected": part.expected.words},
        **{"expected_lo": _table_number(part.expected.lo), "expected_hi": _table_number(part.expected.hi)},
        "number": f"{part.statement}{part.number}" if part.number else "",
        "extension": not (claim.counted and part.asserted),
        "overall": outcome.words if outcome else NOT_JUDGED,
        **dict.fromkeys(("class", "as_shipped"), outcome.kind if outcome else NOT_JUDGED),
        "worst_miss": _table_number(outcome.miss) if outcome else math.nan,
        "needed": outcome.needed if outcome and outcome.needed else math.nan,
        "verdict": NOT_JUDGED,
        "why": one.why or claim.unstated,
        TABLES_READ: one.looked,
    }
    if of is None:
        return row
    return row | {
        **{name: getattr(of, name) for name in ("measured", "lo", "hi", "exact", "ceiling", "n")},
        **{"margin": _table_number(of.margin), "miss": _table_number(miss_in_margins(of))},
        **{"verdict": part_verdict(of, many), "old_verdict": one.old},
        **dict(zip(("judged_lo", "judged_hi"), judged_interval(of, many), strict=True)),
    }


def empty_row(claim: Claim, paper: str) -> dict[str, Any]:
    """The columns of a claim that do not depend on a measurement; the others empty."""
    empty: dict[str, Any] = dict.fromkeys(COLUMNS, "") | dict.fromkeys(NUMBER_COLUMNS, math.nan)
    return empty | {
        **{"claim": claim.id, "paper": paper, "extension": not claim.counted},
        **{name: getattr(claim, name) for name in ("statement", "place", "interpretation", "original")},
        "why": claim.unstated,
    }


def _table_number(value: float) -> float:
    """A number for a table: twelve digits, NaN for infinity."""
    return float(f"{value:.12g}") if math.isfinite(value) else math.nan


def claim_rows(papers: Sequence[PaperClaims], stored: Mapping[str, Sequence[Mapping]]) -> list[dict]:
    """Rows of claims with the columns of claims.csv and `config`: as stored, or one row each as not run.

    stored: config stem → the rows of its claims.csv."""
    rows: list[dict] = []
    for paper, claim in ((of.paper, claim) for of in papers for claim in of.claims):
        own = [dict(row) for row in stored.get(claim.config, ()) if row["claim"] == claim.id]
        if not own:
            own = [empty_row(claim, paper) | dict.fromkeys(CLASS_COLUMNS, NOT_RUN)]
            own[0] |= dict.fromkeys(NUMBER_COLUMNS, "")
        rows += [row | {"config": claim.config} for row in own]
    return rows


def rows_without_results(of: PaperClaims, cases: "Sequence[Case]", shipped: ShippedCases, stem: str) -> list[dict]:
    """A row for each claim that an experiment without stored verdicts certainly judges, or certainly does not.

    With the columns of claims.csv. cases: all of the experiment's. Where none is the paper's, the claim is not judged,
    and the row gives the reason; where the shipped config `stem` holds it, it is not run. A claim that a run might
    judge has no row."""
    rows: list[dict] = []
    for claim in of.claims:
        papers, state, why = _paper_cases(of, claim.config, shipped), NOT_RUN, claim.unstated
        if all(paper_members(_case_keys(of, case), papers, of.may_grow) is None for case in cases):
            changed = _differences_in_words(of, cases[:1], papers, MAX_KEYS_OF_ONE_CASE)
            more = f"; and {len(cases) - 1} more" if len(cases) > 1 else ""
            state, why = NOT_JUDGED, ANOTHER_EXPERIMENT.format(changed=changed + more)
        elif not of.holds(claim, stem):
            continue
        row = empty_row(claim, of.paper) | dict.fromkeys(NUMBER_COLUMNS, "") | {"why": why}
        rows.append(row | dict.fromkeys(CLASS_COLUMNS, state))
    return rows


def first_rows(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The first row of each claim."""
    return list({(row["paper"], row["claim"]): row for row in reversed(list(rows))}.values())[::-1]
