"""Formulas as MathML, which browsers draw by themselves: nothing is fetched, and LaTeX need not be there.

docutils, on which Sphinx stands, turns the TeX of a page into it; a file view (GitHub, GitLab) draws the same TeX.
"""

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml


def inline(writer, node) -> None:
    """A formula within a sentence; MathError for TeX that docutils does not know."""
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def block(writer, node) -> None:
    """A formula on lines of its own, which scrolls where it is wider than the page."""
    writer.body.append(f'<div class="formula">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


def setup(app) -> None:
    """Make it known to Sphinx as the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
