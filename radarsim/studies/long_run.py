"""The long run of a case whose steady σ no formula gives: its horizon is extended until the filters have settled."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.counted_scans import settled_scan, spread_by_scan

if TYPE_CHECKING:
    from radarsim.studies.interface import Study

SETTLING_TIMES = 3  # from within 5 % to a fraction of 0.05³, where σ tends to its limit as an exponential
MIN_SCANS, MAX_SCANS = 32, 256
POSTPONED_S = 1e9  # beyond any run


def without_manoeuvre(spec: Any) -> Mapping[str, Any]:
    """The changes of a config's keys that postpone the manoeuvre of its target beyond any run."""
    target: Any = getattr(spec, "target", None)
    if "start_s" not in getattr(type(target), "model_fields", ()):
        return {}
    return {"target": target.model_copy(update={"start_s": POSTPONED_S})}


def extended_case(study: "Study", case: Case, filter_names: Collection[str] | None) -> Case:
    """The case without a manoeuvre, with so many scans that filters have settled, by default all; never fewer than it
    has. Raises ConfigError where one does not settle, or the number of scans cannot be extended."""
    own_scans = getattr(case.spec, "scans", None)
    if "scans" not in getattr(type(case.spec), "model_fields", ()):
        raise no_long_run(case, f"study {case.study} has no scans that could be extended")
    if not isinstance(own_scans, int):
        raise no_long_run(case, "the run lasts as long as the target's flight")
    steady = case.spec.model_copy(update=dict(study.without_manoeuvre(case.spec)))
    least_scans = max(MIN_SCANS, own_scans)
    scans, late = least_scans, list[str]()
    while scans <= max(MAX_SCANS, least_scans):
        extended = replace(case, spec=steady.model_copy(update={"scans": scans}))
        try:
            axes = study.prepare(extended).axes
            chosen = [f for f, name in enumerate(axes.filters) if filter_names is None or name in filter_names]
            spreads = [spread_by_scan(study, extended, axes, c, chosen) for c in range(len(axes.components))]
        except ConfigError as error:
            raise no_long_run(case, error.lines[0].removeprefix(f"{case.name}: ")) from None
        settled = {axes.filters[f]: _settled_scan(rows) for f, *rows in zip(chosen, *spreads, strict=True)}
        late = [name for name, scan in settled.items() if scan > scans]
        if not late and any(settled.values()):
            enough = max(least_scans, SETTLING_TIMES * max(settled.values()))
            return replace(extended, spec=steady.model_copy(update={"scans": enough}))
        scans *= 2
    raise no_long_run(case, f"errors of {', '.join(late) or 'the filters'} do not settle within {scans // 2} scans")


def _settled_scan(spreads: Sequence[np.ndarray]) -> int:
    """The scan, from 1, at which the spreads (K,) of a filter's errors in all components settle; K + 1 where one does
    not, 0 where there are none."""
    return max((settled_scan(row, may_grow=False) for row in spreads if not np.isnan(row).all()), default=0)


def no_long_run(case: Case, reason: str) -> ConfigError:
    """The error that says why a case has no long run."""
    return ConfigError(f"{case.name}: no long run: {reason}: give a time")
