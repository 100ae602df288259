"""Keys of the sonar study (P3), combined from those of its three parts; and which part a case belongs to."""

from collections.abc import Iterator
from typing import Literal

from radarsim.config.fields import At, Members, at, cross_check, key
from radarsim.studies.sonar import config
from radarsim.studies.sonar.clutter import config as clutter
from radarsim.studies.sonar.manoeuvre import config as manoeuvre

COMPONENTS = tuple(rate + coordinate for coordinate in "rbxyde" for rate in ("", "v", "a"))


class Filter(manoeuvre.Filter, clutter.Filter):
    """A filter that processes each coordinate separately."""


class Sonar(clutter.Keys, manoeuvre.Keys):
    """Sonar plots smoothed and extrapolated."""

    figure_names = (*(f"sigma_{name}" for name in COMPONENTS), *config.FIGURES, *manoeuvre.FIGURES, *clutter.FIGURES)

    filters: Members[Filter] = key("filters", "the filters; all of them process the same plots")

    @property
    def parts(self) -> tuple[Literal["smoothing", "manoeuvre", "clutter"], ...]:
        """The parts whose questions a case asks; the part that computes it comes last.

        `clutter`: its filters have to find their plots among false ones. `manoeuvre`: it measures detectors or uses of
        a track, or has filters that respond to manoeuvres; the questions of `smoothing` are asked of it too.
        """
        if any(member.association is not None for member in self.filters):
            return ("clutter",)
        return ("smoothing", "manoeuvre") if any(self.about_manoeuvres()) else ("smoothing",)

    @cross_check
    def _manoeuvres_of_known_plots(self) -> Iterator[At]:
        if "clutter" in self.parts:
            for name in self.about_manoeuvres():
                yield at(name, "does not go with filters that have an association")
