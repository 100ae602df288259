"""A number is the same in a table, on the page and in a picture; what is only nearly one is never written as one."""

import math
import re

import numpy as np
import pytest

from radarsim.api.run import run
from radarsim.config.find_files import SHIPPED
from radarsim.report.drawing import canvas as drawing_canvas
from radarsim.report.drawing.marks import MAX_WRITTEN_CELLS
from radarsim.report.drawing.model import Heat, Line
from radarsim.report.math_text import plain_text
from radarsim.report.page_tables import page_tables
from radarsim.report.wording import number

CONFIGS = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
POWER = "10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)"
WHOLE_PART = r"(?:\d{1,4}|\d{2,3}(?:,\d{3})+|\d(?:,\d{3}){2,})"  # in groups from five digits on
NUMBER = re.compile(rf"(−?)(?:({WHOLE_PART}(?:\.\d+)?)(?:·{POWER})?|{POWER})")
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
DIGITS, CELL_DIGITS = 4, 3  # of numbers on pages, and in the cells of maps
TABLES_OF_KINDS = {"sigma": "curves", "gain": "gains"}
ROUNDING = 1e-12  # of a number that is one
FACTORS = 1.0, 180 / math.pi  # from a value in a table to that in a picture


def is_written_as(text, value, digits=DIGITS):
    """Whether a text gives a value at so many digits, and 1 only what is not less."""
    if not math.isfinite(value):
        return not re.search(r"\d", text)  # or in words
    match = NUMBER.fullmatch(text)
    if match is None:
        return False
    sign, mantissa, *powers = match.groups()
    power = (powers[0] or powers[1] or "0").translate(SUPERSCRIPTS)
    read = float(f"{'-' if sign else ''}{(mantissa or '1').replace(',', '')}e{power}")
    step = 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1) if value else 0.0
    return abs(read - value) <= 0.5000001 * step and not (read == 1 and value < 1 - ROUNDING)


def faults_of_page(tables):
    """Cells of numbers on the page that are not those of the table."""
    faults = []
    for page in page_tables(tables):
        table = tables[page["name"]]
        for n, column in enumerate(page["columns"]):
            values = table[column["name"]]
            texts = [str(row[n]) for row in page["rows"]] if values.dtype.kind == "f" else []
            where = f"{page['name']}.{column['name']}"
            faults += [
                f"{where}: {text} for {v!r}" for text, v in zip(texts, values, strict=False) if not _same(text, v)
            ]
    return faults


def _same(text, value):
    return is_written_as(text, float(value))


def faults_of_picture(figure):
    """Values of points that a page shows, and of cells of maps, that no mark of the picture has."""
    shown = dict(drawing_canvas.draw(figure).values)
    panels = [panel for panel in figure.panels if panel.marks]
    has_maps = any(isinstance(mark, Heat) for panel in panels for mark in panel.marks)
    all_axes = drawing_canvas.render(figure).axes if has_maps else [None] * len(panels)
    faults = []
    for panel, axes in zip(panels, all_axes, strict=False):
        title = plain_text(panel.title)
        lines = [mark for mark in panel.marks if isinstance(mark, Line)]
        drawn = np.concatenate([np.asarray(line.y, float) for line in lines] or [np.zeros(0)])
        label = f"{plain_text(panel.y.label)}: "
        for mark in shown.get(title, ()) if lines else ():
            text = mark.text.rpartition("\n")[2].removeprefix(label).split(" [")[0].split(", ")[0]
            if NUMBER.fullmatch(text) and not any(is_written_as(text, value) for value in drawn[np.isfinite(drawn)]):
                faults.append(f"{figure.name}, {title}: {text}")
        for heat in (mark for mark in panel.marks if isinstance(mark, Heat) and mark.half_widths is None):
            if heat.values.size <= MAX_WRITTEN_CELLS:
                texts, values = [text.get_text() for text in axes.texts], heat.values[np.isfinite(heat.values)]
                wrong = [(text, v) for text, v in zip(texts, values, strict=True) if not is_cell_of(text, float(v))]
                faults += [f"{figure.name}, {title}: {text} for {value!r}" for text, value in wrong]
    return faults


def is_cell_of(text, value):
    """Whether a text in a map's cell gives its value, with as many digits as tell it from one."""
    return is_written_as(text, value, math.ceil(-math.log10(1 - value)) if 0 < 1 - value < 1e-3 else CELL_DIGITS)


def faults_of_lines(name, figure, tables):
    """Values of σ and of gains in a picture that its table lacks."""
    table = TABLES_OF_KINDS.get(name.partition("_")[0])
    if table not in tables:
        return []
    columns = tables[table].select_dtypes("float")
    known = np.unique(np.concatenate([factor * columns.to_numpy().ravel() for factor in FACTORS]).round(9))
    faults = []
    for line in (mark for panel in figure.panels for mark in panel.marks if isinstance(mark, Line) and mark.name):
        values = np.concatenate([np.asarray(column, float) for column in (line.y, line.exact) if column is not None])
        values = values[np.isfinite(values)]
        nearest = known[np.clip(np.searchsorted(known, values), 1, len(known) - 1)[:, None] - [0, 1]]
        is_known = np.isclose(nearest, values[:, None], rtol=1e-9, atol=2e-9).any(axis=1)
        faults += [f"{name}, {line.name}: {value!r}" for value in values[~is_known]]
    return faults


def faults_of_run(config, only=None):
    result = run(config, realisations=100)
    pictures = [(name, figure) for name, figure in result._figures_by_name.items() if name in (only or [name])]
    return [
        *faults_of_page(result.tables),
        *(fault for name, figure in pictures for fault in faults_of_lines(name, figure, result.tables)),
        *(fault for _, figure in pictures for fault in faults_of_picture(figure)),
    ]


def test_a_number_is_told_from_its_neighbours():
    assert is_written_as("0.9998", 0.99975)
    assert not is_written_as("1", 0.99975)
    assert is_written_as("1", 1.0)
    assert is_written_as(number(1 - 4e-11), 1 - 4e-11)
    assert is_written_as(number(5e-324), 5e-324)
    assert number(5e-324) == "5·10⁻³²⁴"
    assert is_written_as("−1.235·10⁻⁷", -1.2346e-7)
    assert not is_written_as("−1.235·10⁻⁶", -1.2346e-7)
    assert is_written_as("10⁷", 1e7)
    assert is_written_as("10,210", 10206.7)
    assert not is_written_as("10210", 10206.7)
    assert is_written_as("", math.nan)
    assert not is_written_as("12.3", 12.36)


def test_a_number_is_the_same_on_page_picture_and_table():
    assert faults_of_run("rls2", ["sigma_r", "gain_r"]) == []


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_numbers_of_all_shipped_configs_are_the_same_on_page_picture_and_table(config):
    assert faults_of_run(config) == []
