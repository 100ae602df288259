"""The long run of a case whose steady σ no formula gives: its horizon is extended until the filters have settled."""

from collections.abc import Collection, Mapping
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


def extended_case(study: "Study", case: Case, filter_names: Collection[str] | None) -> Case | None:
    """The case without a manoeuvre, with so many scans that filters have settled, by default all; None where one does
    not, or the number of scans is no key."""
    scans = getattr(case.spec, "scans", None)
    if not isinstance(scans, int):
        return None
    steady = case.spec.model_copy(update=dict(study.without_manoeuvre(case.spec)))
    scans = MIN_SCANS
    while scans <= MAX_SCANS:
        extended = replace(case, spec=steady.model_copy(update={"scans": scans}))
        try:
            axes = study.prepare(extended).axes
            chosen = [f for f, name in enumerate(axes.filters) if filter_names is None or name in filter_names]
            spreads = [spread_by_scan(study, extended, axes, c, chosen) for c in range(len(axes.components))]
        except ConfigError:
            return None
        rows = [row for spread in spreads for row in spread if not np.isnan(row).all()]
        settled = max((settled_scan(row, may_grow=False) for row in rows), default=scans + 1)
        if settled <= scans:
            enough = max(MIN_SCANS, SETTLING_TIMES * settled)
            return replace(extended, spec=steady.model_copy(update={"scans": enough}))
        scans *= 2
    return None
