"""A page of real results in a real browser; where there is none, these tests are skipped with that reason."""

import pytest

from radarsim.api import run
from tests.browser.chromium import Chromium, found


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """A folder with runs: one radar, and the first paper's comparison."""
    out = tmp_path_factory.mktemp("results")
    for name in ("rls2", "range_doppler"):
        run.run(name, realisations=4000, out=out)
    return out


@pytest.fixture
def page(tmp_path):
    """A browser."""
    if not found():
        pytest.skip("no Chromium here: apt-get install chromium")
    with Chromium(tmp_path / "profile") as browser:
        yield browser
