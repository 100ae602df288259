"""Mathematical text of figures, `$\\sigma$ of $D_M$`: parsed, and written plain."""

import re
from collections.abc import Iterator

LETTERS = {
    **{"sigma": "σ", "beta": "β", "rho": "ρ", "varphi": "φ", "varepsilon": "ε", "theta": "θ", "lambda": "λ"},
    **{"Delta": "Δ", "times": "×", "cdot": "·", "mu": "μ", "chi": "χ", "nu": "ν"},
}
INDEXED = re.compile(
    r"(?<![\w.])(Δ?[^\W\d_])_(?:\{([^{}\s]+)\}|([^\W_²³]{1,3})(?![^\W²³]|\.\w))"
)  # D_M, g_{n−1}, σ_η², no key
DOT_ABOVE, HAT_ABOVE = "\u0307", "\u0302"
PARTS = re.compile(r"\\(dot|hat)\s*(\w)|\\([A-Za-z]+)\s?|([_^])(\{[^}]*\}|\\[A-Za-z]+|.)|([^\W\d_]+)|(.)", re.DOTALL)


def math_pieces(text: str) -> Iterator[tuple[str, str]]:
    """Pieces of a text with their kind: "" upright, "i" a letter of a formula, "sub", "sup"."""
    pieces = text.replace(r"\$", "\0").split("$")
    for n, piece in enumerate(pieces):
        piece = piece.replace("\0", "$")
        if n % 2 == 0:
            yield piece, ""
            continue
        for accent, accented, command, shift, shifted, letters, character in PARTS.findall(piece):
            if accent:
                yield accented + {"dot": DOT_ABOVE, "hat": HAT_ABOVE}[accent], "i"
            elif command:
                yield LETTERS.get(command, command), "i"
            elif shift:
                inside = re.sub(r"\\([A-Za-z]+)", lambda m: LETTERS.get(m[1], m[1]), shifted.strip("{}"))
                yield inside, {"_": "sub", "^": "sup"}[shift]
            else:
                yield letters or character, "i" if letters else ""


def with_formulas(words: str) -> str:
    r"""Plain words as a text with formulas: letters with an index become such.

    >>> with_formulas("σ_r² at the best D_M and g_{n−1}: sigma_range_m")
    '$σ_{r}$² at the best $D_{M}$ and $g_{n−1}$: sigma_range_m'
    """
    return INDEXED.sub(lambda match: f"${match[1]}_{{{match[2] or match[3]}}}$", words.replace("$", r"\$"))


def plain_text(text: str) -> str:
    """The text without marks, in one line: "σ of D_M"."""
    return " ".join("".join({"sub": "_", "sup": "^"}.get(kind, "") + part for part, kind in math_pieces(text)).split())


CYRILLIC_WIDER = 0.12  # of a Latin letter


def letters_in(text: str) -> float:
    """How wide words are, in Latin letters: Cyrillic ones are wider."""
    words = plain_text(text)
    return len(words) + CYRILLIC_WIDER * sum("а" <= letter.lower() <= "ё" for letter in words)
