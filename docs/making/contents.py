"""The table of contents, read off the index and the doors it leads to: the pages that their lists link to."""

import posixpath
import re
from pathlib import Path

INDEX = "docs/README"
DOORS = ("docs/ask", "docs/howto/recordings", "docs/papers", "docs/extend", "docs/reference/README", "docs/ru/README")
LINK = re.compile(r"^[*-] \[[^\]]+\]\(([^)#\s]+)\.md\)", re.MULTILINE)
FRONT = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={index}.html">
<title>radarsim</title>
<a href="{index}.html">radarsim: documentation</a>
"""


def listed(name: str, text: str) -> list[str]:
    """The pages that open the items of a page's lists, from the repository's root; a door is no page of another."""
    pages = [posixpath.normpath(posixpath.join(posixpath.dirname(name), link)) for link in LINK.findall(text)]
    return [page for page in pages if name == INDEX or page not in (INDEX, *DOORS)]


def add(app, name: str, source: list[str]) -> None:
    """Add to the index and the doors the contents that Sphinx wants; on a file view their lists are enough."""
    if name in (INDEX, *DOORS):
        entries = "\n".join(f"/{page}" for page in listed(name, source[0]))
        source[0] += f"\n```{{toctree}}\n:hidden:\n\n{entries}\n```\n"


def front_page(app, exception) -> None:
    """index.html leads to the index."""
    if exception is None and app.builder.format == "html":
        Path(app.outdir, "index.html").write_text(FRONT.format(index=INDEX), encoding="utf-8")
