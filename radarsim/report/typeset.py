"""Numbers and text as a page shows them."""

from typing import TYPE_CHECKING

from radarsim.language.numerals import numeral
from radarsim.report import math_text, wording
from radarsim.report.math_text import math_pieces

if TYPE_CHECKING:
    from markupsafe import Markup


def cell_text(value: object) -> str:
    """A number for people, whole ones in full, others at four digits; text unchanged, empty for NaN."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return numeral(str(value)) if isinstance(value, int) else wording.number(value)


def typeset(text: str) -> "Markup":
    """A text in which numbers stay with their units, and with ± before them; letters with an index as formulas."""
    return marked_up(math_text.with_formulas(wording.with_unbroken_units(text)))


def marked_up(text: str) -> "Markup":
    """A text with formulas for a page: <i>, <sub>, <sup>; everything else is escaped."""
    from markupsafe import Markup, escape

    return Markup("").join(
        Markup("<{0}>{1}</{0}>").format(Markup(kind), piece) if kind else escape(piece)
        for piece, kind in math_pieces(text)
    )
