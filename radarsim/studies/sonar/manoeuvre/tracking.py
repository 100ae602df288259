"""Filters that respond to manoeuvres over recorded plots, and quantities derived from their tracks."""

import numpy as np

from radarsim.studies.sonar import tracking
from radarsim.studies.sonar.filter_design import FilterSpec
from radarsim.studies.sonar.manoeuvre import responses, use_errors
from radarsim.studies.sonar.manoeuvre.track_uses import QUANTITIES

simulated_plots = tracking.simulated_plots


class Tracker(tracking.Tracker):
    """The filters of a case over recorded plots, with the quantities that `uses` of the config asks for."""

    def specs(self) -> list[FilterSpec]:
        """The filters; those that respond to manoeuvres have their rule or models."""
        return responses.responding_filters(self.spec, super().specs())

    def derived(self, t: np.ndarray, x: np.ndarray, P: np.ndarray, is_known: np.ndarray) -> tracking.DerivedQuantities:
        """The uses of the tracks."""
        if self.spec.uses is None:
            return super().derived(t, x, P, is_known)
        return tracking.DerivedQuantities(
            QUANTITIES, *use_errors.estimated_uses(self.spec.uses, self.spec.frame, t, x, P, is_known)
        )
