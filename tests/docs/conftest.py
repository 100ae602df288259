"""What tests of the documentation share."""

import pytest


@pytest.fixture
def without_drawing(monkeypatch):
    """Runs that draw no figure but write its files: drawing is most of an example's time, and tested elsewhere."""
    from radarsim.report import figures

    monkeypatch.setattr(
        figures, "save", lambda figure, formats=("svg", "png"), *_: dict.fromkeys(formats, b"<svg></svg>")
    )
