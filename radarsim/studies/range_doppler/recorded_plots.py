"""P1's part in `radarsim track`, `simulate` and `fit`."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.range_doppler.config import FOLDED_STUDY, Keys, can_fold
from radarsim.studies.range_doppler.plot_likelihood import PlotLikelihood, likelihood_filter
from radarsim.studies.range_doppler.tracking import Tracker, simulated_plots
from radarsim.studies.range_doppler.turn_errors import turn_error
from radarsim.studies.recording_interface import RecordingInterface, TurnError

SIGMAS: dict[str, tuple[str, ...]] = {
    "range_m": ("radar.sigma_range_m",),
    "velocity_mps": ("radar.sigma_velocity_mps",),
}


class RangeDopplerRecordedPlots(RecordingInterface):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    drawing, tracker = staticmethod(simulated_plots), staticmethod(Tracker)

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood | None:
        return PlotLikelihood(case, filter_name, tracks) if likelihood_filter(case.spec, filter_name) else None

    def columns(self, spec: Keys) -> Sequence[Sequence[str]]:
        return (("t_s", "range_m", "velocity_mps"),)

    def sigmas(self, spec: Keys) -> Mapping[str, Sequence[str]]:
        return SIGMAS

    def scan_period_s(self, spec: Keys) -> float:
        return spec.radar.scan_period_s

    def span_mps(self, spec: Keys) -> float | None:
        radar = spec.radar
        return (
            radar.wavelength_m * radar.repetition_rate_hz / 2
            if "repetition_rate_hz" in radar.model_fields_set
            else None
        )

    def unfolding(self, spec: Keys, span_mps: float) -> Sequence[str]:
        rate = f"radar.repetition_rate_hz={2 * span_mps / spec.radar.wavelength_m:.6g}"
        return (FOLDED_STUDY, *([] if self.span_mps(spec) == span_mps else [rate])) if can_fold(spec) else ()

    def in_a_turn(self, case: Case, filter_name: str, values: Mapping[str, float]) -> TurnError | None:
        variance = values.get("manoeuvre_variance")
        return None if variance is None else turn_error(case, filter_name, variance)
