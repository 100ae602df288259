"""`--width` of every command that writes figures: the files have it, and letters keep their size."""

import io

import pytest
from PIL import Image

from radarsim.api.run import run
from radarsim.report.drawing.style import MM, PNG_DPI
from tests.program import command

WIDTH = "120"  # by default 85


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """A folder with two radars."""
    made = tmp_path_factory.mktemp("results")
    for name in ("rls2", "rls4"):
        run(name, realisations=400, out=made, figures=False)
    return made


@pytest.mark.slow_cases("compare-", "chart-")
@pytest.mark.parametrize(
    ("words", "folder"),
    [
        (["compare", "rls2", "rls4"], "compare/figures"),
        (["chart"], "chart"),
        (["sensitivity", "rls2", "--at", "60"], "sensitivity/rls2"),
    ],
    ids=lambda part: part[0] if isinstance(part, list) else "",
)
def test_the_files_have_the_width_asked_for(words, folder, out):
    command(*words, "--out", out, "--format", "png", "--width", WIDTH)
    drawn = list((out / folder).glob("*.png"))
    assert drawn
    for path in drawn:  # whole pixels
        assert Image.open(io.BytesIO(path.read_bytes())).width == pytest.approx(float(WIDTH) * MM * PNG_DPI, abs=1)


def test_another_width_is_refused_with_those_there_are(out):
    refused = command("chart", "--out", out, "--width", "90", code=2).output
    assert all(width in refused for width in ("85", "120", "175"))
