"""Exact values against Monte-Carlo: how often the intervals hold them, and how far apart the two come."""

from typing import TYPE_CHECKING

import numpy as np

from radarsim.report import tables as common

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("case", "filter", "component", "unit", "scans", "inside_percent", "largest_difference_percent", "at_k")
MOST_ROWS = 300


def agreement(curves: "pd.DataFrame") -> "pd.DataFrame | None":
    """A row for each case, filter and component of curves.csv whose exact σ is known; None where none is."""
    known = curves[np.isfinite(curves["exact_sigma"]) & (curves["exact_sigma"] > 0) & np.isfinite(curves["sigma_lo"])]
    if not len(known):
        return None
    exact, sigma = known["exact_sigma"], known["sigma"]
    marked = known.assign(
        inside=(known["sigma_lo"] <= exact) & (exact <= known["sigma_hi"]), off=100 * (sigma / exact - 1)
    )
    rows = []
    for keys, own in marked.groupby(["case", "filter", "component"], sort=False):
        worst = own.loc[own["off"].abs().idxmax()]
        share = 100 * float(own["inside"].mean())
        rows.append((*keys, worst["unit"], len(own), round(share, 1), float(worst["off"]), int(worst["k"])))
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(COLUMNS)})
