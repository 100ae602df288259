"""What `radarsim check` estimates, on the terminal."""

import math
from typing import TYPE_CHECKING

from radarsim.cli.console import case_count_text, print_field, print_line, print_table, print_warnings
from radarsim.language.numerals import numeral
from radarsim.language.translate import tr

if TYPE_CHECKING:
    from radarsim.api.cost_estimate import CaseCost, CostEstimate, RequiredRealisations
    from radarsim.config.experiment import Experiment


MAX_STARTED_CASES = 4  # cases whose stored part is listed


def print_cost(experiment: "Experiment", outlook: "CostEstimate") -> None:
    """The cost of a run."""
    print_line(tr("{config}: valid", config=str(experiment.path or experiment.stem)))
    rows = [
        (case.name, case.filters, str(case.scans), numeral(f"{case.realisations:,}"), _seconds_text(case))
        for case in outlook.cases
    ]
    columns = ("case", "filters", "scans", "realisations", "one thread")
    print_table("", columns, rows, right=columns[2:], spare=("scans",))
    from radarsim.api.stored_runs import missing_realisations

    started_cases = [
        (case.name, stock) for case in outlook.cases if (stock := case.stock) and stock.stored and stock.missing
    ]
    for name, stock in started_cases[:MAX_STARTED_CASES]:
        values = {"stored": stock.stored, "asked": stock.requested, "missing": missing_realisations(stock)}
        whole = tr("{stored:,} of {asked:,} stored; missing: {missing}", **values)
        print_field(name, whole if stock.part == (1, 1) else tr("{stored:,} of {asked:,} stored; {missing}", **values))
    if len(started_cases) > MAX_STARTED_CASES:
        print_line(tr("and {cases} more stored in part", cases=case_count_text(len(started_cases) - MAX_STARTED_CASES)))
    if outlook.precision is not None:
        print_required_realisations(experiment, outlook)
    if outlook.share is not None:
        number, share_count = outlook.share
        print_field("share", tr("{number} of {of}", number=number, of=share_count))
    print_field("total", outlook.total)
    print_warnings(outlook.warnings)


def _seconds_text(case: "CaseCost") -> str:
    """Seconds of one thread for a case."""
    if case.timed or not case.seconds:
        return tr("{t_s:.3g} s", t_s=case.seconds)
    return tr("under {t_s:.2g} s", t_s=case.seconds)


def print_required_realisations(experiment: "Experiment", outlook: "CostEstimate") -> None:
    """How many realisations a precision takes, and whether the run may do so many."""
    configured = {case.name: case.realisations for case in experiment.cases}
    needs = {case.name: need for case in outlook.cases if (need := case.need) is not None}
    rows = [
        (
            case.name,
            numeral(f"{need.realisations:,}") if need.realisations is not None else _unreached_text(need),
            tr("{t_s:.3g} s", t_s=float(case.seconds)),
            need.known_by,
            need.last,
        )
        for case in outlook.cases
        if (need := case.need) is not None
    ]
    precision_heading = tr("for ± {percent:g} {unit}", percent=outlook.precision, unit=tr(outlook.of.half_width_unit))
    columns = ("case", precision_heading, "one thread", "known from", "last to get there")
    print_table("", columns, rows, right=columns[1:3], spare=columns[4:])
    unreached_cases = [
        name for name, need in needs.items() if need.realisations is None or need.realisations > configured[name]
    ]
    if unreached_cases:
        largest_need = max((need.realisations or math.inf) for need in needs.values())
        remedy = tr("; -n {most} would do", most=str(largest_need)) if math.isfinite(largest_need) else ""
        cases = case_count_text(len(unreached_cases))
        values = {"cases": cases, "names": ", ".join(unreached_cases[:3]), "cure": remedy}
        print_line(tr("precision not within reach of {cases}: {names}{cure}", **values))


def _unreached_text(need: "RequiredRealisations") -> str:
    """Why a pilot predicts no number of realisations."""
    return tr("out of reach") if need.below is None else tr("none observed: below {rate:.2g}", rate=need.below)
