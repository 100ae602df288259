"""What the tests of configs and of reports set up, for those of the studies."""

from tests.config.conftest import good, house, said  # noqa: F401
from tests.report.conftest import expected_case, expected_radar, paper, radar_config, swept, swept_all  # noqa: F401
