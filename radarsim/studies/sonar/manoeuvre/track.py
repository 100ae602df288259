"""Filters that respond to manoeuvres over recorded plots, and quantities derived from their tracks."""

import numpy as np

from radarsim.studies.sonar import track as base
from radarsim.studies.sonar.filters import FilterSpec
from radarsim.studies.sonar.manoeuvre import study
from radarsim.studies.sonar.manoeuvre.exact import QUANTITIES

drawing = base.drawing


class Tracker(base.Tracker):
    """The filters of a case over recorded plots, with the quantities that `uses` of the config asks for."""

    def specs(self) -> list[FilterSpec]:
        """The filters; those that respond to manoeuvres have their rule or models."""
        return study.responding_filters(self.spec, super().specs())

    def derived(self, t: np.ndarray, x: np.ndarray, P: np.ndarray, is_known: np.ndarray) -> base.DerivedQuantities:
        """The uses of the tracks."""
        if self.spec.uses is None:
            return super().derived(t, x, P, is_known)
        return base.DerivedQuantities(
            QUANTITIES, *study.estimated_uses(self.spec.uses, self.spec.frame, t, x, P, is_known)
        )
