"""The study's part in `radarsim track`, `simulate` and `fit`."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.multimodel.config import Keys
from radarsim.studies.multimodel.plot_likelihood import PlotLikelihood
from radarsim.studies.multimodel.tracking import Tracker, columns, drawing, sigmas
from radarsim.studies.recording_interface import RecordingInterface


class FlightRecordedPlots(RecordingInterface):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    rows_asked = 2000

    columns, sigmas = staticmethod(columns), staticmethod(sigmas)
    drawing, tracker = staticmethod(drawing), staticmethod(Tracker)

    def scan_period_s(self, spec: Keys) -> float:
        return spec.sensor.scan_period_s

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood:
        names = [member.name for member in case.spec.filters]
        return PlotLikelihood(case, 0 if filter_name is None else names.index(filter_name), tracks)
