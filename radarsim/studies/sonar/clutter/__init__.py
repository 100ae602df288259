"""P3: tracks among false plots."""

from radarsim.studies.sonar.part import SonarPart

PART = SonarPart(__name__, claimed=False, tracker_in=__name__, simulated_in=__name__)
