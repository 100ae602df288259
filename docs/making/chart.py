"""The chart of every radar, written into the built pages: the live page that docs/chart.md leads to."""

from pathlib import Path

from radarsim.api.doppler_chart import chart


def draw_chart(app, exception) -> None:
    """docs/chart/ beside the page, when it is built as HTML."""
    if exception is None and app.builder.format == "html":
        chart(out=Path(app.outdir, "docs"), figures=False)
