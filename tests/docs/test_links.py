"""Every link in the repository's pages leads somewhere, and every page of docs/ is in the index."""

import re
from pathlib import Path

import pytest
from making import contents, links, words

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / name
    for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "benchmarks/README.md", "results/README.md")
]
PAGES += [page for page in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in page.parts]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    assert not list(links.broken(page))


def test_wrong_links_are_seen(tmp_path):
    (tmp_path / "a.md").write_text("# One\n\n## Two words, `code`\n\n## One\n")
    page = tmp_path / "b.md"
    page.write_text("[x](a.md#two-words-code) [x](a.md#one-1) [x](https://a.b) `[x](y)` [x](c.md) [`x`](a.md#three)\n")
    assert list(links.broken(page)) == ["c.md: no such file", "a.md#three: no such heading"]


def test_every_page_is_in_the_index_or_behind_a_door():
    indexes = {name: (ROOT / f"{name}.md").read_text(encoding="utf-8") for name in (contents.INDEX, *contents.DOORS)}
    listed = [page for name, text in indexes.items() for page in contents.listed(name, text)]
    there = {page.relative_to(ROOT).with_suffix("").as_posix() for page in PAGES} - {contents.INDEX}
    assert sorted(listed) == sorted(there)


def test_pages_that_are_named_without_a_link_exist():
    """`docs/results.md` and the like in code font, in pages and docstrings; or `make` writes them."""
    made = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = re.compile(r"\b(?:docs|configs|scenarios|benchmarks)/[\w/]+\.(?:md|json|yaml|py)\b")
    files = [*PAGES, *sorted((ROOT / "radarsim").rglob("*.py"))]
    missing = {
        (str(file.relative_to(ROOT)), name)
        for file in files
        for name in named.findall(file.read_text(encoding="utf-8"))
        if not (ROOT / name).exists() and not re.search("[A-Z]{4}", name) and name not in made
    }
    assert not missing


def test_what_is_written_by_hand_stays_readable():
    assert words.count("One two, 3 | <!-- value: x -->12.3 %<!-- end --> – four.\n") == 4
    assert sum(words.by_page().values()) <= 45_000, "take away what nobody needs before you add"
