"""The precision that a run is to reach: its quantity, and the table that holds it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.api.case_work import CaseWork
from radarsim.config.experiment import Case, Experiment
from radarsim.config.quantity_phrase import (
    OVER_SCANS,
    TIME_ROUNDING,
    PhraseError,
    QuantityPhrase,
    is_counted,
    parse_phrase,
)
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError, argument
from radarsim.report.quantities import GAIN, Quantity
from radarsim.studies import registry
from radarsim.studies.registry import study

if TYPE_CHECKING:
    from radarsim.report.precision import Table


class PrecisionTarget(NamedTuple):
    """A precision in per cent, its quantity, the table that holds it, and that of curves if errors are heavy-tailed."""

    percent: float
    quantity: Quantity
    table: "Table"
    curves: "Table | None"


def precision_target(work: CaseWork, percent: float, text: str) -> PrecisionTarget:
    """The precision of what is asked for, for a case."""
    quantity = registry.quantity(asked_phrase(text).name, work.case)
    return PrecisionTarget(percent, quantity, asked_table(work.case, text), heavy_tailed_table(work, quantity))


def heavy_tailed_table(work: CaseWork, quantity: Quantity) -> "Table | None":
    """The table of a case's curves where rare large errors may decide a quantity; None where they do not."""
    if not quantity.squares or (work.plan.gaussian and not work.case.user_filters):
        return None
    return _with_user_filters(work.case, "curves", study(work.case.study).curves)


def _with_user_filters(case: Case, name: str, table: "Table") -> "Table":
    """A table of a study, with the rows of user filters where a case has any."""
    if not case.user_filters:
        return table
    from radarsim.report.user_filters import tables as user_filters_tables

    return user_filters_tables.table_with_user_filters(name, table)


def quantity_table(case: Case, quantity: Quantity) -> "Table":
    """The table of a case's study that holds a quantity, from results; empty where it makes none."""
    from radarsim.report import tables

    case_study = study(case.study)
    if quantity == GAIN:
        from radarsim.api.result_content import gains_table

        return _with_user_filters(case, quantity.table, gains_table(case_study))

    def table(results: Sequence[CaseResult]) -> Any:
        rows = case_study.table(quantity.table, results, quantity.value)
        return tables.frame({}) if rows is None else rows

    return _with_user_filters(case, quantity.table, table)


def asked_phrase(text: str) -> QuantityPhrase:
    """What a precision is asked for: a quantity's name, of all its rows, or a phrase. Raises ConfigError."""
    try:
        return parse_phrase(text)
    except PhraseError as error:
        raise ConfigError(f"{argument('of', '--for')}: {error}") from None


def with_long_run(experiments: Sequence[Experiment], text: str) -> tuple[list[Experiment], str]:
    """The experiments in which a phrase is read, and the phrase for them: for the long run their cases last until the
    filters have settled, without a manoeuvre, and it is asked of their end. Raises ConfigError where they do not."""
    phrase = asked_phrase(text)
    if phrase.over != "long run":
        return list(experiments), text
    from radarsim.api.long_experiment import long_experiment

    return [long_experiment(experiment) for experiment in experiments], f"{phrase.name} {phrase.component or ''}"


def asked_table(case: Case, text: str) -> "Table":
    """The table of a case's study that holds what is asked for, with the rows that it is asked of."""
    phrase = asked_phrase(text)
    quantity = registry.quantity(phrase.name, case)
    table = quantity_table(case, quantity)
    if phrase == QuantityPhrase(phrase.name):
        return table
    from_s = registry.counted_from_s(case, phrase.component, phrase.over, phrase.from_s)

    def rows(results: Sequence[CaseResult]) -> Any:
        found = table(results)
        if phrase.component is not None and len(found):
            from radarsim.api.design.quantities import check_name

            column = quantity.per or "filter"
            names = found[column].astype(str)
            check_name(phrase.component, list(dict.fromkeys(names)), column)
            found = found[names == phrase.component]
        return found if "k" not in found or not len(found) else found[_is_asked(phrase, found, from_s)]

    return rows


def _is_asked(phrase: QuantityPhrase, rows: Any, from_s: float | None) -> Any:
    """Which rows lie at the scans of a phrase, by default at the last. Raises ConfigError for a scan beyond the run."""
    last_k, last_s = rows["k"].max(), rows["t_s"].max() if "t_s" in rows else 0.0
    option = argument("of", "--for")
    for time_s in (phrase.at_s, from_s):
        if time_s is not None and not 0 <= time_s <= last_s * (1 + TIME_ROUNDING):
            raise ConfigError(f"{option}: must be from 0 to {last_s:g} s, the last scan's time, got {time_s:g}")
    if phrase.over in OVER_SCANS:
        return is_counted(rows["t_s"], from_s)
    if phrase.at_s is not None:
        distance = (rows["t_s"] - phrase.at_s).abs()
        return distance == distance.min()
    if phrase.at_k is not None and not (rows["k"] == phrase.at_k).any():
        raise ConfigError(f"{option}: must be a scan of the tables, to {last_k}, got {phrase.at_k}")
    return rows["k"] == (last_k if phrase.at_k is None else phrase.at_k)


def unknown_quantity(case: Case, quantity: Quantity) -> str:
    """The line for a case that has no row of a quantity."""
    return f"{case.name}: of: must be what the case has, got {quantity.name}: no {quantity.words}"


def check_precision(experiments: Sequence[Experiment], percent: float, quantity_name: str = "sigma") -> None:
    """Raise ConfigError for an invalid precision, an unmeasured quantity, or too few realisations for a look."""
    from radarsim.report.precision import FIRST_LOOK

    for case in (case for experiment in experiments for case in experiment.cases):
        registry.quantity(asked_phrase(quantity_name).name, case)
    if not 0 < percent <= 100:
        raise ConfigError(f"precision: must be > 0 and ≤ 100 %, got {percent:g}")
    faults = [
        f"{experiment.path or experiment.stem}: realisations: must be at least {FIRST_LOOK} for a precision "
        f"({FIRST_LOOK}, {2 * FIRST_LOOK}, {4 * FIRST_LOOK}, … and the last are "
        f"looked at), got {case.realisations} in {case.name}"
        for experiment in experiments
        for case in experiment.cases
        if case.realisations < FIRST_LOOK
    ]
    if faults:
        raise ConfigError(*faults)
