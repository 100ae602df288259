"""The table `runs`: each run's root mean square error over a span of scans, and its statistics over the runs."""

from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.api.realisation_errors import CaseErrors
from radarsim.errors import ConfigError, argument
from radarsim.report.run_statistics import ScanSpan, statistics_row
from radarsim.report.tables import frame

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.api.result import Result


def parse_span(text: str) -> ScanSpan | None:
    """The span of scans in a text, `2:60`; None of `all`. Raises ConfigError."""
    if text == "all":
        return None
    first, _, last = text.partition(":")
    if not (first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
        raise ConfigError(f"{argument('runs')}: must be FIRST:LAST, such as 2:60, or all, got {text!r}")
    return ScanSpan(int(first), int(last))


def runs_table(result: "Result", span: str = "all") -> "pd.DataFrame":
    """The table `runs`: statistics over the runs of each run's root mean square over a span of scans.

    case, filter, component, unit: as in `curves`
    first_k, last_k: the scans of the span
    n: the runs that have an estimate
    mean ± mean: the mean over the runs of √(mean over the scans of e²)
    variance ± variance, median ± median: of the same numbers
    quantile_05, quantile_25, quantile_50, quantile_75, quantile_95: below which so many of a hundred runs lie"""
    scans = parse_span(span)
    rows = [row for case in result.cases for row in _rows_of_case(case.realisation_errors, scans)]
    return frame({name: [row[name] for row in rows] for name in (rows[0] if rows else ())})


def _rows_of_case(errors: CaseErrors, span: ScanSpan | None) -> list[dict[str, Any]]:
    """The rows of a case: of each filter in each component in which it has an estimate."""
    k, rms = np.asarray(errors.work.plan.axes.k), errors.run_rms(span)
    scans = k if span is None else k[span.indices(k)]
    return [
        {
            **{"case": errors.case.name, "filter": name, "component": component, "unit": unit},
            **{"first_k": int(scans[0]), "last_k": int(scans[-1])},
            **statistics_row(rms[f, :, c]),
        }
        for f, name in enumerate(errors.filters)
        for c, (component, unit) in enumerate(errors.components)
        if np.isfinite(rms[f, :, c]).any()
    ]
