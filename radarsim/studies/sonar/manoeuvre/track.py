"""Filters that respond to manoeuvres over recorded plots, and what their tracks are used for."""

import numpy as np

from radarsim.studies.sonar import track as base
from radarsim.studies.sonar.banks import FilterSpec
from radarsim.studies.sonar.manoeuvre import study
from radarsim.studies.sonar.manoeuvre.uses import QUANTITIES


class Tracker(base.Tracker):
    """The filters of a case over recorded plots, with course, speed and what else the config's `uses` asks for."""

    def specs(self) -> list[FilterSpec]:
        """The filters, those that respond to manoeuvres with their rule or models."""
        return study.with_manoeuvre_response(self.spec, super().specs())

    def derived(
        self, t: np.ndarray, x: np.ndarray, P: np.ndarray, known: np.ndarray
    ) -> tuple[tuple[tuple[str, str], ...], np.ndarray, np.ndarray]:
        """Uses of the tracks and their σ (F, n, U), by names and units."""
        if self.spec.uses is None:
            return super().derived(t, x, P, known)
        return QUANTITIES, *study.uses_of(self.spec, t, x, P, known)
