"""What tests of the documentation share."""

import pytest


@pytest.fixture
def without_drawing(monkeypatch):
    """Runs that draw no figure but write its files: drawing is most of an example's time, and tested elsewhere."""
    from radarsim.report.drawing import canvas
    from radarsim.report.drawing.page_figure import DrawnFigure

    svg = b'<svg viewBox="0 0 1 1"></svg>'
    monkeypatch.setattr(canvas, "save", lambda figure, formats=("svg",), *_: dict.fromkeys(formats, svg))
    monkeypatch.setattr(
        canvas, "draw", lambda figure, formats=("svg",), *_: DrawnFigure(figure, dict.fromkeys(formats, svg), svg)
    )
