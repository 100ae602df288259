"""Sphinx over the whole repository, so that links between pages are ordinary relative ones, here as on a file view.

`make docs` builds into docs/_build/html. Commands and Python are read off the program
while building: see making/.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from making import chart, claims, contents, formulas, generated, modules, object_search

import radarsim

project = "radarsim"
author = "radarsim"
version = release = radarsim.__version__
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "docs/README"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/**.md",
    "benchmarks/README.md",
    "results/README.md",
]
exclude_patterns = ["docs/_build", ".venv", ".git", "results/.blocks", "radarsim", "tests"]
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_digits = False  # a price is no formula
html_math_renderer = "mathml"

default_role = "code"  # of single backticks in docstrings
toc_object_entries = False  # thousands of functions, copied into the contents of every page: a quarter of the build
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
# Types of other libraries: their documentation is elsewhere, and the build looks nothing up outside.
nitpick_ignore_regex = [
    (
        "py:.*",
        r"(np|numpy|pd|pandas|matplotlib|collections|contextlib|importlib|_frozen_importlib|ast|io|os|pathlib|types|numba"
        r"|click|re|pydantic|markupsafe|xarray)\..*",
    ),
    ("py:class", r"Canvas|DataclassInstance"),
    # Keys have a page of their own.
    ("py:class", r"radarsim\.config\.\w+\..*|radarsim\.studies\..*\.(config|\w+_keys)\..*|(radarsim\..*\.)?(All)?Keys"),
    ("py:class", r"radarsim\.errors\..*"),  # exceptions are described where they are raised
    ("py:class", r"FieldInfo|NoneType|Markup"),  # of unions, as pydantic and jinja2 spell them
    ("py:class", r"(radarsim\..*\.)?(A_co|Item|M|Maker|Part|Asked|CaseOrResult|ClutterPlan|Row)|Inventory|Table"),
    ("py:class", r"(radarsim\..*\.)?(Name|V)|DrawPlots|GivenGains|Sample|Settings|Shipped|Source|Stop"),
    ("py:class", r"radarsim\.(extensions|papers)\..*"),  # what is optional
    ("py:class", r"(radarsim\.report\.)?notes\.Answer"),
    ("py:(class|obj)", r"(dict|list|tuple|typing\.Literal)\[.*"),  # a subscript that autodoc takes for a name
]
# Several studies have a class of one name, each documented in its own module; a type of that name may be any of them.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"radarsim {version}"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["style"]
html_css_files = ["page.css"]
html_search_scorer = str(Path(__file__).parent / "style" / "search.js")


def setup(app):
    """What is made while building: the contents from the index, pages from the program, a front page."""
    formulas.setup(app)
    object_search.setup(app)
    app.connect("source-read", contents.add)
    app.connect("source-read", generated.fill)
    app.connect("env-get-outdated", generated.outdated)
    app.connect("autodoc-process-docstring", modules.plain)
    app.connect("build-finished", contents.front_page)
    app.connect("build-finished", chart.draw_chart)
    app.connect("build-finished", claims.draw_figure)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
