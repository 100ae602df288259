"""P3: detection of manoeuvres, filters that respond to them, uses of a track."""

from radarsim.studies.sonar.part import SonarPart

PART = SonarPart(__name__, tracker_in=__name__)
