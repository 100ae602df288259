"""P3: smoothing and extrapolation of plots, missed ones, correlated errors."""

from radarsim.studies.sonar.part import SonarPart

PART = SonarPart(__name__, answers_with_sigma=True)
