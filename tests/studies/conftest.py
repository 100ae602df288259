"""What the tests of configs and of reports set up, for those of the studies."""

from tests.config.conftest import good, house, said  # noqa: F401
