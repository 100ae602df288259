"""Recorded plots of all parts of the sonar."""

from collections.abc import Callable
from typing import Any

from radarsim.config.experiment import Case
from radarsim.studies import recording_interface
from radarsim.studies.plot_arrays import DrawPlots
from radarsim.studies.recording_interface import RecordingInterface
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.plot_likelihood import likelihood
from radarsim.studies.sonar.tracking import columns, sigmas


class RecordedSonarPlots(RecordingInterface):
    """Recorded plots of all parts, for `radarsim track` and `radarsim simulate`.

    part_of: the part of a case with these keys."""

    rows_asked = 3000
    columns, sigmas, likelihood = staticmethod(columns), staticmethod(sigmas), staticmethod(likelihood)

    def __init__(self, part_of: Callable[[Any], Any]):
        self.part_of = part_of

    def scan_period_s(self, spec: Keys) -> float:
        return spec.sensor.scan_period_s

    def drawing(self, case: Case) -> DrawPlots:
        draw: DrawPlots = self.part_of(case.spec).drawing(case)
        return draw

    def tracker(self, case: Case) -> recording_interface.Tracker:
        tracker: recording_interface.Tracker = self.part_of(case.spec).tracker(case)
        return tracker
