"""Words of figures, with the little mathematical text that they use, for a page: marked up, and plain."""

import re
from collections.abc import Iterator

from markupsafe import Markup, escape

LETTERS = {
    **{"sigma": "σ", "beta": "β", "rho": "ρ", "varphi": "φ", "varepsilon": "ε", "theta": "θ", "lambda": "λ"},
    **{"Delta": "Δ", "times": "×", "cdot": "·", "mu": "μ", "chi": "χ", "nu": "ν"},
}
DOT_ABOVE, HAT_ABOVE = "\u0307", "\u0302"
PARTS = re.compile(r"\\(dot|hat)\s*(\w)|\\([A-Za-z]+)\s?|([_^])(\{[^}]*\}|\\[A-Za-z]+|.)|([^\W\d_]+)|(.)", re.DOTALL)
RISE = {"sub": (0.25, 0.75), "sup": (-0.4, 0.75)}  # of the size: how far down, how large


def runs(text: str) -> Iterator[tuple[str, str]]:
    """Pieces of a text with their kind: "" upright, "i" a letter of a formula, "sub", "sup"."""
    pieces = text.replace(r"\$", "\0").split("$")
    for n, piece in enumerate(pieces):
        piece = piece.replace("\0", "$")
        if n % 2 == 0:
            yield piece, ""
            continue
        for accent, under, command, shift, shifted, letters, other in PARTS.findall(piece):
            if accent:
                yield under + {"dot": DOT_ABOVE, "hat": HAT_ABOVE}[accent], "i"
            elif command:
                yield LETTERS.get(command, command), "i"
            elif shift:
                inside = re.sub(r"\\([A-Za-z]+)", lambda m: LETTERS.get(m[1], m[1]), shifted.strip("{}"))
                yield inside, {"_": "sub", "^": "sup"}[shift]
            else:
                yield letters or other, "i" if letters else ""


def spoken(text: str) -> str:
    """The text without marks, in one line: "σ of D_M"."""
    return " ".join("".join({"sub": "_", "sup": "^"}.get(kind, "") + part for part, kind in runs(text)).split())


def html(text: str) -> Markup:
    """The text for a page: <i>, <sub>, <sup>; everything else escaped."""
    return Markup("").join(
        Markup("<{0}>{1}</{0}>").format(Markup(kind), part) if kind else escape(part) for part, kind in runs(text)
    )


def tspans(text: str, size: float) -> Markup:
    """The text for an SVG, of one line: subscripts lowered, letters of formulas slanted; everything else escaped."""
    made, low = Markup(""), 0.0
    for part, kind in runs(text.replace("\n", " ")):
        down, scale = RISE.get(kind, (0.0, 1.0))
        shift = down * size - low
        low = down * size
        look = Markup(' dy="{:.1f}"').format(shift) if shift else Markup("")
        look += Markup(' font-size="{:.1f}"').format(scale * size) if scale != 1 else Markup("")
        look += Markup(' font-style="italic"') if kind == "i" else Markup("")
        made += Markup("<tspan{}>{}</tspan>").format(look, part) if look else escape(part)
    return made
