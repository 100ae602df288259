"""The table of floors, and their columns in the table of curves."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.studies.floors.bound import LAGS, Bound, Floor

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.engine.results import CaseResult
    from radarsim.studies.interface import Study


LAG_COLUMNS = tuple(f"lag_{lag}" for lag in LAGS)
COLUMNS = ("case", "filter", "component", "unit", "k", "t_s", "floor", *LAG_COLUMNS, "smoothed", "reached", "kind")


def floors(study: "Study", results: "Sequence[CaseResult]") -> "pd.DataFrame":
    """What no estimator can do better than with the plots of a filter, where a floor is known: what quantities read.

    `floor` is the least σ with the plots up to the scan; `lag_1` … `lag_10` that so many scans later, of fixed-lag
    smoothing; `smoothed` that after the last scan, of fixed-interval smoothing. `reached` says whether some estimator
    reaches it, `kind` which bound it is."""
    from radarsim.report import tables

    return tables.join_columns(
        (part for result in results for part in _parts(study.floor(result.spec, result.axes), result)), COLUMNS
    )


def with_floors(curves: "pd.DataFrame", floors: "pd.DataFrame") -> "pd.DataFrame":
    """Curves with the floor of each row; empty where none is known.

    floor [unit]: lower bound on σ (CRB) for the plots that the filter is given up to the scan
    floor_kind: `CRB`, of a target that is the same in all realisations, under unbiased estimators; `posterior CRB`, of
        a random one, under any; and how missed plots count, see `docs/methods.md`
    """
    keys, note = ["case", "filter", "component", "k"], curves.columns.isin(["note"])
    columns = curves.loc[:, ~note]
    if "believed_sigma" not in columns:
        columns = columns.assign(believed_sigma=np.nan)
    if len(floors):
        floor_columns = floors[[*keys, "floor", "kind"]].rename(columns={"kind": "floor_kind"})
        columns = columns.merge(floor_columns, on=keys, how="left", validate="many_to_one").fillna({"floor_kind": ""})
    else:
        columns = columns.assign(floor=np.nan, floor_kind="")
    return columns.set_index(curves.index).join(curves.loc[:, note])


def _parts(floor: Floor | None, result: "CaseResult") -> Iterator[dict[str, Any]]:
    """The rows of a case, filter by filter; user filters are given all plots."""
    if floor is None:
        return
    for f, bound in enumerate(floor.bounds):
        if bound is not None:
            yield _rows(floor, f, bound, result)
    if (user_filters := result.user_filters) is not None and floor.of_all is not None:
        for f in range(len(user_filters.axes.filters)):
            yield _rows(floor, f, floor.of_all, user_filters)


def _rows(floor: Floor, f: int, bound: Bound, result: "CaseResult") -> dict[str, Any]:
    from radarsim.report import tables

    c, k = np.nonzero((result.axes.available[f] & np.isfinite(bound.sigma)).T)
    kinds = np.array(
        [", ".join(filter(None, (floor.kind, pattern_kind))) for pattern_kind in bound.patterns], dtype="O"
    )
    rows = tables.label_columns(result, np.full(k.size, f), k, **tables.component_columns(result, c))
    if floor.t_s is not None:
        rows["t_s"] = floor.t_s[f, k]
    lags = {name: lagged[k, c] for name, lagged in zip(LAG_COLUMNS, bound.lagged, strict=True)}
    last_columns = {"smoothed": bound.smoothed[k, c], "reached": np.full(k.size, bound.is_attained), "kind": kinds[k]}
    return rows | {"floor": bound.sigma[k, c]} | lags | last_columns
