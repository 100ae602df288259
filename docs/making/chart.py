"""The chart of every radar, drawn into the built pages: the figures that docs/chart.md shows, and the live page."""

from pathlib import Path

from radarsim.app.chart import chart


def drawn(app, exception) -> None:
    """docs/chart/ beside the page, when it is built as HTML."""
    if exception is None and app.builder.format == "html":
        chart([], Path(app.outdir, "docs"), formats=("svg",))
