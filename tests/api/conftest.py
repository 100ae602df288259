"""What the tests of reports set up, for those of what is written."""

from tests.report.conftest import expected_case, expected_radar, paper, radar_config, swept, swept_all  # noqa: F401
