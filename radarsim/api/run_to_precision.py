"""A run of a case that ends when its widest interval is narrow enough."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.precision_target import PrecisionTarget, unknown_quantity
from radarsim.config.experiment import Case
from radarsim.engine.dispatch import CollectedSums
from radarsim.errors import ConfigError
from radarsim.report.quantities import SIGMA

if TYPE_CHECKING:
    from radarsim.report.precision import WidestInterval


def collect_to_precision(
    case: Case, work: CaseWork, target: PrecisionTarget, collector: Callable[[int], CollectedSums], at_least: int
) -> "tuple[CollectedSums, WidestInterval | None]":
    """The sums of a case once its widest interval is narrow enough, and the cell of that interval.

    The intervals are looked at for a doubling number of realisations; they count from the fewest that rare large errors
    allow (`minimum_realisations`). Ends at the realisations of the case, or when the run is stopped."""
    from radarsim.report.precision import (
        FIRST_LOOK,
        MIN_REALISATIONS_WITHOUT_TAILS,
        look_counts,
        minimum_realisations,
        widest_cell,
    )

    looks: list[CollectedSums] = []
    best, cell = None, None
    looks_at = look_counts(case.realisations, MIN_REALISATIONS_WITHOUT_TAILS if target.curves else FIRST_LOOK)
    for n in dict.fromkeys(max(n, at_least) for n in looks_at):
        looks.append(collector(n))
        # A run that is stopped before a look may hold fewer realisations without a gap than at the previous look.
        if best is None or looks[-1].count > best.count:
            best = looks[-1]
            cell = widest_cell(case_result(case, work, best), target.table, target.quantity) if best.count else None
            if cell is None and best.count and target.quantity != SIGMA:
                raise ConfigError(unknown_quantity(case, target.quantity))
        if looks[-1].stopped or cell is None:
            break
        if cell.percent < target.percent and n >= minimum_realisations(case_result(case, work, best), target.curves):
            break
    assert best is not None  # there is a look at every number of realisations that check_precision accepts
    computed = sum(look.computed for look in looks)
    total = replace(
        best,
        requested=case.realisations,
        computed=computed,
        from_store=max(0, best.count - computed),
        kernel_seconds=sum(look.kernel_seconds for look in looks),
        seconds=sum(look.seconds for look in looks),
        stopped=looks[-1].stopped,
        warnings=tuple(dict.fromkeys(warning for look in looks for warning in look.warnings)),
    )
    return total, cell
