"""Pictures and formulas of the pages: there, small, shown, of figures that exist; TeX that becomes MathML."""

import io
import re

import numpy as np
import pytest
from making import pictures
from PIL import Image

from radarsim.report.drawing.model import Axis, Figure, Line, Panel, Style

STUDIES = (
    *("range_doppler", "multimodel", "sonar", "sonar_manoeuvre", "sonar_clutter", "discriminator"),
    *("ambiguous_doppler", "pulses_to_tracks"),
)
PAGES = dict(pictures.pages())
IMAGE = re.compile(r"!\[([^\]]+)\]\(([^)]+)\)")
FORMULA = re.compile(r"\$\$(.+?)\$\$|(?<![\w$])\$([^$\n]+)\$", re.DOTALL)


def without_code(text):
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL))


def test_every_picture_is_drawn_small_and_shown():
    """What the marks ask for, the pages show and the folder holds are the same; each under 60 kB, with words beside."""
    shown = set()
    for page, text in PAGES.items():
        for mark in pictures.MARK.finditer(text):
            found = IMAGE.findall(mark[3])
            files = [(page.parent / link).resolve() for _, link in found]
            assert [file.stem for file in files] == [
                pictures.file_stem(*one) for one in pictures.pictures_of_mark(mark[1])
            ]
            assert all(words.strip() for words, _ in found)
            assert mark[3].count("*") >= 2 * len(found)  # captions
            shown |= set(files)
    assert shown == set(pictures.FOLDER.iterdir())
    assert all(file.stat().st_size < pictures.MAX_BYTES for file in shown)


@pytest.mark.parametrize("study", STUDIES)
def test_a_studys_page_begins_with_its_question_its_answer_and_its_figure(study):
    head = (pictures.ROOT / "docs" / f"{study}.md").read_text(encoding="utf-8").partition("\n## ")[0]
    places = [head.find(words) for words in ("**The question", "**The answer", "<!-- picture: ", "![")]
    assert -1 not in places
    assert places == sorted(places)
    assert places[0] < 120  # nothing before but the title


def test_the_readme_and_the_first_papers_six_figures_are_shown():
    assert pictures.ROOT / "README.md" in PAGES
    gallery = [
        pictures.pictures_of_mark(mark[1])
        for mark in pictures.MARK.finditer(PAGES[pictures.ROOT / "docs/range_doppler.md"])
    ]
    six = {"sigma_r", "gain_r", "sigma_Vr", "gain_Vr", "sigma_ar", "gain_ar"}
    assert six in [{name for config, name, _ in own if config == "range_doppler"} for own in gallery]


def test_a_large_picture_becomes_a_small_png():
    rng = np.random.default_rng(1)
    lines = tuple(Line(np.arange(900.0), rng.normal(size=900), f"line {n}", Style(n)) for n in range(12))
    ending, data = pictures.picture_file(
        Figure("f", "F", "F.", (Panel(Axis("x"), Axis("y"), lines),), width_mm=175.0), None
    )
    assert ending == "png"
    assert len(data) < pictures.MAX_BYTES
    assert Image.open(io.BytesIO(data)).width > 1000
    small = Figure("f", "F", "F.", (Panel(Axis("x"), Axis("y"), lines[:1]),))
    assert pictures.picture_file(small, 85.0)[0] == "svg"


def test_marks_are_filled_with_pictures_and_captions(tmp_path):
    figure = Figure("f", "$\\sigma$ of r", "What is seen. How it is drawn.", ())
    page, file = tmp_path / "docs" / "page.md", tmp_path / "docs" / "pictures" / "a_f.svg"
    one = pictures.picture_text(page, [("f", figure, file)])
    assert one == "![σ of r](pictures/a_f.svg)\n\n*σ of r.* What is seen. How it is drawn.\n"
    two = pictures.picture_text(tmp_path / "README.md", [("f", figure, file)] * 2)
    assert two.count("![σ of r](docs/pictures/a_f.svg)") == 2
    assert two.count("* *σ of r.*") == 2


@pytest.mark.slow
@pytest.mark.parametrize("config", [config for config in pictures.figures_by_config() if config != pictures.CHART])
def test_every_figure_that_a_page_shows_is_one_of_its_config(config):
    from radarsim.api import result_content
    from radarsim.api.run import run

    result = run(config, realisations=64)
    drawn = result_content.case_figures(result.cases, result.tables, result.experiment)
    assert {name for name, _ in pictures.figures_by_config()[config]} <= set(drawn)


def test_the_charts_pictures_are_its_figures():
    assert {name for name, _ in pictures.figures_by_config()[pictures.CHART]} == set(
        pictures.figures_of(pictures.CHART, None)
    )


def formulas():
    for page in sorted((pictures.ROOT / "docs").rglob("*.md")):
        if "_build" not in page.parts:
            for found in FORMULA.finditer(without_code(page.read_text(encoding="utf-8"))):
                yield page.name, found[1] or found[2]


def test_formulas_become_mathml():
    """What the built pages hold: a tree of MathML, without a word of TeX left."""
    convert = pytest.importorskip("docutils.utils.math.latex2mathml", reason="pip install 'radarsim[docs]'").tex2mathml
    every = list(formulas())
    assert {"range_doppler.md", "multimodel.md", "discriminator.md", "methods.md"} <= {page for page, _ in every}
    for page, tex in every:
        made = convert(tex, as_block=True)
        assert made.startswith("<math"), (page, tex)
        assert "\\" not in re.sub(r"<[^>]+>", "", made), (page, tex)
