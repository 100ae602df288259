r"""Numbers, units and counts in sentences, and text that is safe to print. Loads no NumPy.

Words of figures have a little mathematical text, `$\sigma$ of $D_M$`; here it is parsed, and written plain."""

import math
import re
from collections.abc import Iterable, Iterator

from radarsim.language import numeral, power_of_ten, term, tr

POWERS = str.maketrans("234", "²³⁴")  # of units in tables, as people write them
SAID = (  # units that a language may write differently
    *(term("m"), term("m²"), term("s"), term("m/s"), term("m/s²"), term("rad"), term("rad/s"), term("rad/s²")),
    *(term("Hz"), term("Hz/s"), term("Hz/s²"), term("Hz/s³"), term("Hz/s⁴"), term("km"), term("°/s"), term("°/s²")),
)
NBSP = "\N{NO-BREAK SPACE}"
KEPT = re.compile(  # the space between a number and its unit, in any language spoken here; and around ±
    r"(?<=\d) (?=(?:%|°|k?m|к?м|m?s|м?с|[kM]?Hz|[кМ]?Гц|dB|дБ|rad|рад)(?:[/²³⁴]\S*)?(?:\W|$))"
    r"|(?<=\S) (?=± )|(?<=±) (?=\d)"
)
SPACES = "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"  # which a language may put into numbers
PLAIN = 6  # digits before the point that are still written out
MOST_NINES = 12  # digits of a share near one


LABELS = (  # of lines
    *(term("claims"), term("tables"), term("figures"), term("report"), term("removed"), term("note"), term("table")),
    *(term("page"), term("total"), term("share"), term("blocks"), term("attains"), term("slope"), term("also at")),
    *(term("check"), term("config"), term("package"), term("plots"), term("track"), term("tracks"), term("passed")),
    *(term("missing"), term("no rows"), term("untested"), term("gaps"), term("best"), term("advice")),
    *(term("again"), term("doubles")),
    *(term("no effect"), term("no estimate"), term("not paired"), term("left out"), term("files")),
)
LONG = 8  # letters of an English label from which it does not set the width of all


def labelled(label: str, text: str) -> str:
    """A line under a label; without one it stands under the line before."""
    label_text, width = tr(label), max(len(tr(name)) for name in LABELS if len(name) < LONG) + 2
    return f"{label_text:<{width}}{text}" if len(label_text) <= width - 2 else f"{label_text}  {text}"


def clock(seconds: float) -> str:
    """Seconds as h:mm:ss."""
    whole_seconds = round(seconds)
    return f"{whole_seconds // 3600}:{whole_seconds // 60 % 60:02}:{whole_seconds % 60:02}"


def plural(count: int, noun: str) -> str:
    """1 case, 2 cases."""
    return f"{count} {noun}{'s' * (count != 1)}"


def number(value: float, digits: int = 4) -> str:
    """A number for people at so many digits: 25600, 0.00012, 1.2·10⁻⁷, ∞; nothing for not-a-number.

    A number under one is never rounded to one.

    >>> [number(one) for one in (25600.0, 1e10, 2.56e7, -0.00005, 0.25, 0.99999)]
    ['25600', '10¹⁰', '2.56·10⁷', '−5·10⁻⁵', '0.25', '0.99999']
    """
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if 0 < 1 - value < 10.0**-digits:
        digits = min(-math.floor(math.log10(1 - value)), MOST_NINES)
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    if value == 0 or -4 <= int(exponent) < PLAIN:
        return numeral(f"{float(f'{value:.{digits}g}') + 0.0:.10g}")
    short = f"{float(mantissa):g}"
    raised = power_of_ten(int(exponent))
    return raised if short == "1" else f"−{raised}" if short == "-1" else f"{numeral(short)}·{raised}"


def interval(low: str, high: str) -> str:
    """The ends of an interval in brackets, with the language's separator of decimal numbers."""
    return tr("[{low}, {high}]", low=low, high=high)


def estimate(values: Iterable[float], unit: str = "", form: str = ".4g") -> str:
    """A value with its unit and its 95 % interval, from the value and the two ends: 12.3 m [12, 12.6]."""
    value, low, high = (numeral(format(number, form)).replace("inf", "∞") for number in values)
    return f"{' '.join(filter(None, (value, unit)))} {interval(low, high)}"


def share(value: float, low: float, high: float) -> str:
    """A share in per cent with its 95 % interval, with digits enough to distinguish the ends from each other, 0 and 100
    %.

    >>> share(100, 99.9962, 100), share(94.123, 93.9, 94.3), share(99.99, 99.9885, 99.9915)
    ('100 % [99.996, 100]', '94.12 % [93.90, 94.30]', '99.990 % [99.989, 99.992]')
    """
    rounded, limits = [round(number, MOST_NINES) for number in (value, low, high)], (0.0, 100.0)
    for digits in range(2, MOST_NINES):
        texts = [f"{number:.{digits}f}" for number in rounded]
        is_blurred = any(
            (float(text) in limits) != (number in limits) for text, number in zip(texts, rounded, strict=True)
        )
        if (texts[1] != texts[2] or low == high) and not is_blurred:
            break
    value_text, *bounds = (
        numeral(f"{number:.0f}" if number in limits else text) for number, text in zip(rounded, texts, strict=True)
    )
    return f"{value_text} % {interval(*bounds)}"


def unit(name: str) -> str:
    """A unit of a table as people write it: m/s² of m/s2."""
    return "Hz" if name == "hz" else name.translate(POWERS)


def unbroken(words: str) -> str:
    """Text in which a unit stays with its number, and a number with a ± before it.

    >>> unbroken("at 60 s: 12 % ± 3 m/s").replace(NBSP, "_")
    'at 60_s: 12_%_±_3_m/s'
    """
    return KEPT.sub(NBSP, words)


def printable(text: str) -> str:
    """Text without control characters: names in a config must not control the terminal."""
    return "".join(c if c.isprintable() or c in SPACES else "�" for c in text)


def in_a_row(numbers: Iterable[str]) -> str:
    """Numbers one after the other, separated by semicolons where the language writes a decimal comma."""
    return (", " if numeral("0.5") == "0.5" else f";{NBSP}").join(numbers)


def clauses(sentence: str) -> list[str]:
    """A sentence's parts between semicolons; one within brackets or between numbers (`in_a_row`) does not separate.

    >>> clauses("locked in 12 % [11; 13] (of 5; 6 lost); lost in 88 %")
    ['locked in 12 % [11; 13] (of 5; 6 lost)', 'lost in 88 %']
    """
    parts: list[str] = []
    for part in sentence.split("; "):
        if parts and any(parts[-1].count(opening) > parts[-1].count(closing) for opening, closing in ("[]", "()")):
            parts[-1] += f"; {part}"
        else:
            parts.append(part)
    return parts


def significant_digits(value: float, form: str = "#.4g") -> str:
    """A number in a format, of four digits, for sentences: no trailing point, no minus zero, a true minus."""
    text = format(value, form).removesuffix(".")
    return numeral(text if float(text) else text.removeprefix("-"))


def shown(value: float, form: str = ".6g") -> str:
    """A number in words."""
    return significant_digits(value, form)


def with_unit(value: float, name: str) -> str:
    """A number with its unit, in words."""
    return f"{shown(value)} {tr(name)}".rstrip()


def known(value: float, form: str = "#.4g", after: str = "") -> str:
    """`figures` of a number and its suffix, or nothing for NaN."""
    return significant_digits(value, form) + after if value == value else ""


# ---- mathematical text -----------------------------------------------------------------------------------------------
LETTERS = {
    **{"sigma": "σ", "beta": "β", "rho": "ρ", "varphi": "φ", "varepsilon": "ε", "theta": "θ", "lambda": "λ"},
    **{"Delta": "Δ", "times": "×", "cdot": "·", "mu": "μ", "chi": "χ", "nu": "ν"},
}
INDEXED = re.compile(
    r"(?<![\w.])(Δ?[^\W\d_])_(?:\{([^{}\s]+)\}|([^\W_²³]{1,3})(?![^\W²³]|\.\w))"
)  # D_M, g_{n−1}, σ_η², no key
DOT_ABOVE, HAT_ABOVE = "\u0307", "\u0302"
PARTS = re.compile(r"\\(dot|hat)\s*(\w)|\\([A-Za-z]+)\s?|([_^])(\{[^}]*\}|\\[A-Za-z]+|.)|([^\W\d_]+)|(.)", re.DOTALL)


def subscripts(text: str) -> Iterator[tuple[str, str]]:
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


def formulas(words: str) -> str:
    r"""Plain words as a text with formulas: letters with an index become such.

    >>> formulas("σ_r² at the best D_M and g_{n−1}: sigma_range_m")
    '$σ_{r}$² at the best $D_{M}$ and $g_{n−1}$: sigma_range_m'
    """
    return INDEXED.sub(lambda match: f"${match[1]}_{{{match[2] or match[3]}}}$", words.replace("$", r"\$"))


def spoken(text: str) -> str:
    """The text without marks, in one line: "σ of D_M"."""
    return " ".join("".join({"sub": "_", "sup": "^"}.get(kind, "") + part for part, kind in subscripts(text)).split())


CYRILLIC_WIDER = 0.12  # of a Latin letter


def letters_in(text: str) -> float:
    """How wide words are, in Latin letters: Cyrillic ones are wider."""
    words = spoken(text)
    return len(words) + CYRILLIC_WIDER * sum("а" <= letter.lower() <= "ё" for letter in words)
