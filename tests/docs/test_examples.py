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


@pytest.mark.slow_cases(
    "docs/howto/own_radar.md",
    "docs/howto/is_my_filter_better.md",
    "docs/howto/s_band.md",
    "docs/tutorial.md",
    "docs/sonar_clutter.md",
    "docs/howto/recording_asterix.md",
    "docs/reference/python.md",
)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_examples(page, tmp_path, without_drawing):
    check(page, tmp_path, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_all_examples_with_their_figures(page, tmp_path):
    check(page, tmp_path, slow=True)


def test_what_is_written_anew_is_cut_where_the_page_cuts_it():
    said = "Range: 5 %.\n…\ncase=2  r+Vr  r    7.5 m\n…\nWarning: 3 lost.\n"
    rows = [f"case={n}   {name}     {what}    1.5 m" for n in (1, 2) for name in ("r", "r+Vr") for what in ("r", "Vr")]
    printed = "\n".join(["Range: 6 %.", "Velocity: 7 %.", *rows, "Warning: 4 lost.", "More."]) + "\n"
    made = examples.shortened(printed, said)
    assert made == "Range: 6 %.\n…\ncase=2   r+Vr     r    1.5 m\n…\nWarning: 4 lost.\nMore.\n"
    assert examples.agrees(made, printed)
    assert examples.shortened(printed, "Range: 5 %.\n…\n") == "Range: 6 %.\n…\n"


def test_the_s_band_radar_is_answered_in_under_ten_commands():
    page = (ROOT / "docs" / "howto" / "s_band.md").read_text(encoding="utf-8")
    commands = [line for line in page.splitlines() if line.startswith("$ radarsim ")]
    assert 5 < len(commands) < 10
    for asked in ("cure.yaml", "biased.yaml", "flights.yaml", "folded.yaml", "solve sband.yaml"):
        assert any(asked in command for command in commands), asked
