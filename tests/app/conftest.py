"""What the tests of reports set up, for those of what is written."""

from tests.report.conftest import (  # noqa: F401
    expected_case,
    expected_radar,
    paper,
    radar_config,
    swept,
    swept_all,
)
