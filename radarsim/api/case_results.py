"""The sums of a case with their labels."""

from dataclasses import replace
from typing import Any

from radarsim.api.case_work import CaseWork
from radarsim.api.realisation_errors import CaseErrors
from radarsim.config.experiment import Case
from radarsim.engine.dispatch import CollectedSums
from radarsim.engine.results import CaseResult
from radarsim.studies.registry import study


def case_result(case: Case, work: CaseWork, collected: CollectedSums) -> CaseResult:
    """The result of a case: its sums with their labels, under the case's own display names."""
    values = collected.values.view()
    values.flags.writeable = False  # tables and figures are made of them on demand
    count, seconds, results = collected.count, collected.kernel_seconds, []
    unpacked = list(work.unpack(values))
    for plan, plan_case, sums in zip(work.plans, (case, *case.companions), unpacked, strict=False):
        # Cases that differ in display names alone share their work.
        axes = plan.axes if work.case == case else study(case.study).relabelled(plan.axes, plan_case)
        results.append(
            CaseResult(
                plan_case.name, plan_case.study, plan_case.spec, plan_case.swept_values, count, sums, axes, seconds
            )
        )
    errors = CaseErrors(case, count)
    result = replace(results[0], further_baselines=tuple(results[1:]), realisation_errors=errors)
    if not case.user_filters:
        return result
    from radarsim.studies.user_filters import sums as user_filters_sums

    user_plan: Any = work.plans[-1]
    return replace(result, user_filters=user_filters_sums.result(user_plan, result, unpacked[-1]))
