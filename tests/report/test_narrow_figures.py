"""No figure of any width has words cut, or one over the other; one that cannot be had at a width is wider."""

import io
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from radarsim.api.run import run
from radarsim.config.find_files import SHIPPED
from radarsim.papers.forest_plot import forest_plot
from radarsim.report.drawing import canvas as drawing_canvas
from radarsim.report.drawing.crowded_panels import with_names_at_ends
from radarsim.report.drawing.legend_placement import plan_legends
from radarsim.report.drawing.model import (
    COLUMN_MM,
    MAX_PANEL_LINES,
    PAGE_MM,
    Axis,
    Figure,
    Heat,
    Line,
    Note,
    Panel,
    Style,
)
from radarsim.report.drawing.style import MM, PNG_DPI
from radarsim.report.drawing.word_overlaps import overlapping_words
from tests.report.test_claims_page import row

CONFIGS = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
WIDTHS_MM = (85.0, 120.0, 180.0)
A4_HEIGHT_MM = 297.5
INK = 230  # of 255: a darker pixel is part of a letter or a line


def picture(png):
    """The grey values of a picture, and its width in mm."""
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("L")), image.width / PNG_DPI / MM


def drawn_pixels(canvas):
    """The grey values of a drawing, as those of its PNG without writing and reading that."""
    canvas.canvas.draw()
    return np.asarray(Image.fromarray(np.asarray(canvas.canvas.buffer_rgba())).convert("L"))


def cut_edges(pixels):
    """The edges of a picture that have ink."""
    edges = {"left": pixels[:, 0], "right": pixels[:, -1], "top": pixels[0], "bottom": pixels[-1]}
    return [name for name, edge in edges.items() if (edge < INK).any()]


def faults_of_widths(figures):
    """Figures that at a width, or as they are, are cut, have words that meet, or another width than they say."""
    faults = []
    for name, figure in figures.items():
        for width in (None, *WIDTHS_MM):
            drawn_figure, canvas = drawing_canvas.render_at(figure, width)
            words = overlapping_words(canvas)
            pixels = drawn_pixels(canvas)
            width_mm = pixels.shape[1] / PNG_DPI / MM
            is_tall = len(pixels) / PNG_DPI / MM > A4_HEIGHT_MM
            if (edges := cut_edges(pixels)) or words or is_tall or round(width_mm) != round(drawn_figure.width_mm):
                faults.append(f"{name} at {width} mm: {width_mm:.0f} mm, cut: {edges}, meet: {words}")
    return faults


def claim_figure():
    rows = [row(f"P9.{n}", measured=value, unit="m/s²") for n, value in enumerate((6.0, -1.317e-13, 123456.0))]
    return forest_plot([{**one, "statement": "A statement of many words on what a radar gains " * 2} for one in rows])


def test_claims_keep_statement_and_unit_at_every_width():
    figure = claim_figure()
    assert faults_of_widths({"claims": figure}) == []
    axes = drawing_canvas.render(drawing_canvas.at_width(figure, COLUMN_MM)).axes[0]
    names = [text for text in axes.texts if "A statement" in text.get_text()]
    assert [text.xy[1] for text in names] == [0, 1, 2]
    boxes = [text.get_window_extent() for text in sorted(axes.texts, key=lambda text: text.get_window_extent().y0)]
    for below, above in pairwise(boxes):
        assert below.y1 < above.y0 + 1 or below.x0 > above.x1 or above.x0 > below.x1
    wide = drawing_canvas.render(replace(figure, width_mm=2 * PAGE_MM)).axes[0]
    assert not [text for text in wide.texts if "A statement" in text.get_text()]
    assert all(tick.get_text().count("A statement") == 2 for tick in wide.get_yticklabels())  # none is cut short


def test_notes_along_the_top_that_would_meet_stand_in_rows():
    x = np.linspace(0, 186, 50)
    stages = ((10, "start"), (72, "ballistic"), (147, "manoeuvre"), (178, "after"))
    notes = tuple(Note(float(at), np.nan, name, "top") for at, name in stages)
    panel = Panel(Axis("time, s", limits=(0, None)), Axis("y"), (Line(x, x, "Kalman-1 20"), *notes), title="flight")
    figure = Figure("f", "F", "A flight.", (panel,))
    for width in WIDTHS_MM:
        axes = drawing_canvas.render(drawing_canvas.at_width(figure, width)).axes[0]
        boxes = [text.get_window_extent() for text in axes.texts if text.get_text() in dict(map(reversed, stages))]
        assert len(boxes) == len(stages)
        assert not any(a.overlaps(b) for n, a in enumerate(boxes) for b in boxes[n + 1 :])
        assert axes._left_title.get_window_extent().y0 >= max(box.y1 for box in boxes)


@pytest.mark.parametrize("count", [1, 5, 6, 12])
def test_a_figure_of_a_column_is_lower_than_a_page_or_wider(count):
    x = np.arange(3.0)
    panel = Panel(Axis("x"), Axis("y"), tuple(Line(x, x, f"filter {n}") for n in range(9)), direct=False)
    figure = Figure("f", "F", "A flight.", (panel,) * count, 3, PAGE_MM)
    drawing = drawing_canvas.draw(figure, ("png",), COLUMN_MM)
    assert (drawing.figure.width_mm > COLUMN_MM) == (count > 6)
    with Image.open(io.BytesIO(drawing.files["png"])) as image:
        assert image.height / PNG_DPI / MM < A4_HEIGHT_MM


def test_a_width_at_which_words_would_be_cut_is_increased_and_said(tmp_path):
    result = run("rls2", realisations=64, overrides={"figures": ["sigma_r"]})
    written = result.write(tmp_path, figures="png", width_mm=20)
    pixels, width_mm = picture((written.folder / "figures" / "sigma_r.png").read_bytes())
    assert cut_edges(pixels) == []
    assert (
        f"figure sigma_r: drawn {width_mm:.0f} mm wide, as at 20 mm words would be cut or the page exceeded"
        in result.warnings
    )


def crowded_panels(figure):
    """The panels of a figure with more lines than a legend can explain, none of them named at its end."""
    plan = plan_legends(with_names_at_ends(figure))
    named = [
        [mark for mark in panel.marks if isinstance(mark, Line) and mark.style.dash is not None and mark.name]
        for panel in plan.panels
    ]
    return [
        panel.title
        for panel, lines, ends in zip(plan.panels, named, plan.at_ends, strict=True)
        if len(lines) > MAX_PANEL_LINES and not ends
    ]


def test_a_figure_of_many_rows_is_no_taller_than_a_page_at_its_own_width():
    x = np.arange(3.0)
    panel = Panel(Axis("x"), Axis("y"), (Line(x, x),), "panel")
    assert faults_of_widths({"f": Figure("f", "F", "A flight.", (panel,) * 12, 2, PAGE_MM, 56.0)}) == []


def test_words_that_meet_are_found():
    x = np.arange(3.0)
    notes = Note(1.0, 1.0, "one"), Note(1.0, 1.0, "two"), Note(2.0, 0.0, "far", "nw")
    panel = Panel(Axis("x"), Axis("y"), (Line(x, x), *notes))
    assert overlapping_words(drawing_canvas.render(Figure("f", "F", "A flight.", (panel,)))) == [("one", "two")]


def test_a_map_too_narrow_for_its_numbers_has_fewer_columns():
    values = 0.9123 + 0.001 * np.arange(36.0).reshape(6, 6)
    panel = Panel(Axis("x"), Axis("y"), (Heat(np.arange(6) / 16 + 0.0625, np.arange(6.0), values, "share"),))
    figure = Figure("f", "F", "Maps.", (panel,) * 3, 2, PAGE_MM)
    columns = {width: drawing_canvas.render_at(figure, width)[0].columns for width in (None, 120.0)}
    assert columns == {None: 2, 120.0: 1}


@pytest.mark.parametrize("width", WIDTHS_MM)
def test_a_long_name_in_a_legend_is_broken_into_rows(width):
    x = np.arange(3.0)
    names = ("r+V, ideal = r+V+a, ideal = r+V, random jerk = r+V+a, random jerk = r+V = r+V+a", "r")
    panel = Panel(Axis("x"), Axis("y"), tuple(Line(x, x + n, name) for n, name in enumerate(names)))
    for count in (1, 3):
        assert faults_of_widths({"f": Figure("f", "F", "A flight.", (panel,) * count, 3, width)}) == []


@pytest.mark.parametrize("count", [2, 3])
def test_a_legend_below_each_panel_ends_within_the_figure(count):
    x, motions = np.arange(3.0), ("constant velocity", "constant accelerations")
    panels = [
        Panel(
            Axis("time, s"),
            Axis("mean probability", limits=(0, 1)),
            tuple(
                Line(x, x / 2, f"{m} {motion}, $\\sigma_a$ = {5 * n + 1} m/s²", Style(m, m))
                for m, motion in enumerate(motions)
            ),
            direct=False,
        )
        for n in range(count)
    ]
    assert faults_of_widths({"f": Figure("f", "F", "A flight.", tuple(panels), count, PAGE_MM)}) == []


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_no_figure_of_a_shipped_config_is_cut_or_crowded(config):
    figures = run(config, realisations=200)._figures_by_name
    sizes = [drawing_canvas.at_width(figure, width) for figure in figures.values() for width in (None, *WIDTHS_MM)]
    assert {figure.name: panels for figure in sizes if (panels := crowded_panels(figure))} == {}
    assert faults_of_widths(figures) == []
