"""The study's part in `radarsim track`, `simulate` and `fit`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.ambiguous_doppler.plot_likelihood import PlotLikelihood
from radarsim.studies.ambiguous_doppler.tracking import COLUMNS, SPAN, Tracker, drawing, usable_filters
from radarsim.studies.recording_interface import RecordingInterface


class FoldedRecordedPlots(RecordingInterface):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    rows_asked = 300
    from_any_origin = True
    drawing, tracker = staticmethod(drawing), staticmethod(Tracker)

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        return ((*COLUMNS, SPAN), COLUMNS)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        return {"range_m": ("radar.sigma_range_m",), "velocity_mps": ("radar.sigma_velocity_mps",)}

    def scan_period_s(self, spec: Any) -> float:
        return spec.radar.scan_period_s

    def unfolds(self, spec: Any, filter_keys: Any = None) -> bool:
        return filter_keys is None or filter_keys.doppler == "folded"

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood | None:
        candidates = [o for o in usable_filters(case.spec) if o.combine is None]
        if filter_name is None:  # the filter of folded velocities that keeps the most hypotheses
            candidates = [o for o in candidates if o.doppler == "folded"] or candidates
            candidates.sort(key=lambda o: (o.merge == "never", o.hypotheses or 0, o.estimate == "mean"))
        else:
            candidates = [o for o in candidates if o.name == filter_name]
        return PlotLikelihood(case, candidates[-1], tracks) if candidates else None
