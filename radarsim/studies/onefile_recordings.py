"""Recorded plots of a study in one file."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain, combinations
from typing import TYPE_CHECKING, Any

from radarsim.studies.plot_arrays import DrawPlots
from radarsim.studies.recording_interface import Likelihood, RecordingInterface, Tracker

if TYPE_CHECKING:
    import numpy as np

    from radarsim.config.experiment import Case
    from radarsim.studies.onefile import OneFile


MAX_COLUMN_SETS = 6  # sets of columns of which a file may have any; with more, all sets or one


class OneFileRecordings(RecordingInterface):
    """Recorded plots of a study in one file: a recording may have all columns, or those of some filters."""

    from_any_origin = True
    of_any_keys = True

    def __init__(self, study: "OneFile", drawing: "Callable[[Case], DrawPlots]", tracker: "Callable[[Case], Tracker]"):
        self.study, self._drawing, self._tracker = study, drawing, tracker

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        filter_columns = list(dict.fromkeys(self.study.columns(spec, filter_keys) for filter_keys in spec.filters))
        counts = (
            range(len(filter_columns), 0, -1) if len(filter_columns) <= MAX_COLUMN_SETS else (len(filter_columns), 1)
        )
        choices = [tuple(dict.fromkeys(chain(*chosen))) for n in counts for chosen in combinations(filter_columns, n)]
        return [("t_s", *names) for names in dict.fromkeys(choices)]

    def columns_of(self, spec: Any, filter_keys: Any) -> Sequence[str]:
        return self.study.columns(spec, filter_keys)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        pairs = [
            zip(self.study.columns(spec, filter_keys), self.study.measured, strict=False)
            for filter_keys in spec.filters
        ]
        return {column: number.sigma_keys for columns in pairs for column, number in columns}

    def scan_period_s(self, spec: Any) -> float:
        return self.study.scan_period_s(spec)

    def unfolds(self, spec: Any, filter_keys: Any = None) -> bool:
        # Of one filter: no, as none is said to lose a fold.
        return filter_keys is None and self.study.span_mps(spec) is not None

    def span_mps(self, spec: Any) -> float | None:
        return self.study.span_mps(spec)

    def unfolding(self, spec: Any, span_mps: float) -> Sequence[str]:
        return self.study.unfolding(spec, span_mps)

    def drawing(self, case: "Case") -> DrawPlots:
        return self._drawing(case)

    def tracker(self, case: "Case") -> Tracker:
        return self._tracker(case)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> Likelihood | None:
        return self.study.likelihood(case, filter_name, tracks)
