"""One pinned picture of each kind of mark: how a figure looks, where Matplotlib is of the version that drew it."""

import io
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

from radarsim.report.drawing import canvas as drawing_canvas
from radarsim.report.drawing.model import Axis, Bars, Figure, Heat, Line, Note, Panel, Reference, Style

FOLDER = Path(__file__).parent / "pixels"
VERSION = "3.11"  # of Matplotlib, that drew them
FAR = 24  # of 255: a pixel that differs by more is another
MOST = 0.01  # of the pixels; a letter's rim may fall otherwise on another machine
X = np.arange(12.0)
KINDS = {
    "line": (
        Line(X, 3 + np.cos(X), "one", Style(0, 0, 0), 2.5 + np.cos(X), 3.5 + np.cos(X), 3 + np.cos(X)),
        Line(X, 5 + np.sin(X), "two", Style(0.5, 1, 1)),
    ),
    "scatter": (Line(X, X**2, "points", Style(2, None, 2), X**2 - 9, X**2 + 9), Note(3.0, 60.0, "a note", "ne")),
    "reference": (Line(X, X, "", Style(1, 3)), Reference(4.0, label="level"), Reference(7.0, "x", "moment")),
    "bars": (Bars(("a", "b", "c"), np.array([1.0, 3.0, 2.0]), np.array([0.8, 2.5, 1.5]), np.array([1.3, 3.4, 2.6])),),
    "heat": (Heat(np.array([1.0, 2.0, 5.0]), np.array([10.0, 20.0]), np.arange(6.0).reshape(2, 3), "value"),),
}


def picture(kind):
    """A small picture (height, width, 3) of a kind."""
    panel = Panel(Axis("x, s"), Axis("$\\sigma$ of $y$, m"), KINDS[kind], "panel")
    canvas = drawing_canvas.render(Figure(kind, "", "", (panel,)))
    out = io.BytesIO()
    canvas.savefig(out, format="png", dpi=70)
    return Image.open(out).convert("RGB")


@pytest.mark.parametrize("kind", KINDS)
def test_it_looks_as_it_did(kind):
    if not matplotlib.__version__.startswith(f"{VERSION}."):
        pytest.skip(f"drawn with Matplotlib {VERSION}, this is {matplotlib.__version__}")
    kept, made = Image.open(FOLDER / f"{kind}.png").convert("RGB"), picture(kind)
    assert made.size == kept.size
    apart = np.abs(np.asarray(made, dtype=int) - np.asarray(kept, dtype=int)).max(axis=2)
    assert (apart > FAR).mean() < MOST
