"""All examples of README and documentation run and print what the pages say."""

from pathlib import Path

import pytest
from making import examples

ROOT = Path(__file__).parents[2]
PAGES = [
    page
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
    if "_build" not in page.parts and examples.blocks(page.read_text(encoding="utf-8"))
]


def check(page, folder, slow):
    for block, text in examples.run(page.read_text(encoding="utf-8"), folder, slow):
        assert text == block.text, f"{page.name}:{block.line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_examples(page, tmp_path, without_drawing):
    check(page, tmp_path, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_all_examples_with_their_figures(page, tmp_path):
    check(page, tmp_path, slow=True)


def test_the_s_band_radar_is_answered_in_under_ten_commands():
    page = (ROOT / "docs" / "howto" / "s_band.md").read_text(encoding="utf-8")
    commands = [line for line in page.splitlines() if line.startswith("$ radarsim ")]
    assert 5 < len(commands) < 10
    for asked in ("cure.yaml", "biased.yaml", "periods.yaml", "flights.yaml", "folded.yaml", "solve sband.yaml"):
        assert any(asked in command for command in commands), asked
