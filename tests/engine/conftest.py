"""What the tests of the store share."""

import pytest

from tests.engine.fake import WORK


@pytest.fixture
def blocks(tmp_path):
    """The directory of the finished blocks of WORK under the results directory tmp_path."""
    return tmp_path / ".blocks" / WORK.identity
