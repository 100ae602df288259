"""The table of contents, read off the index: each heading of docs/README.md with the pages that its list links to."""

import posixpath
import re
from pathlib import Path

INDEX = "docs/README"
LINK = re.compile(r"^[*-] \[[^\]]+\]\(([^)#\s]+)\.md\)", re.MULTILINE)
FRONT = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={index}.html">
<title>radarsim</title>
<a href="{index}.html">radarsim: documentation</a>
"""


def sections(text: str) -> list[tuple[str, list[str]]]:
    """Headings of the index and the pages that open the items below each, as paths from the repository's root."""
    found = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        pages = [posixpath.normpath(posixpath.join(posixpath.dirname(INDEX), link)) for link in LINK.findall(body)]
        if pages:
            found.append((heading.strip(), pages))
    return found


def add(app, name: str, source: list[str]) -> None:
    """Add to the index the contents that Sphinx wants; on a file view its lists are enough."""
    if name == INDEX:
        for heading, pages in sections(source[0]):
            entries = "\n".join(f"/{page}" for page in pages)
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {heading}\n\n{entries}\n```\n"


def front_page(app, exception) -> None:
    """index.html leads to the index."""
    if exception is None and app.builder.format == "html":
        Path(app.outdir, "index.html").write_text(FRONT.format(index=INDEX), encoding="utf-8")
