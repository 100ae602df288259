"""Numbers as cells of a table have them: with decimal commas, separators, units, signs of hemispheres; and cells that
stand for none."""

import math
import re
from collections.abc import Container, Iterable, Mapping, Sequence

from radarsim.recordings.formats.units import DEGREES, EARTH_DEGREES, RADIANS, cell_unit

LARGEST_NUMBER = 1e15
SIXTY = 60  # minutes in a degree, seconds in a minute
MISSING_TEXTS = {
    *("nan", "-nan", "null", "none", "na", "n/a", "n.a.", "n/d", "nd", "\\n", "<na>", "missing", "void", "invalid"),
    *("error", "err", "unknown", "1.#qnan", "-1.#ind", "1.#ind", "nan(ind)", "-nan(ind)", "k.a.", "kein wert", "fehlt"),
    *("inf", "-inf", "+inf", "infinity", "-infinity", "nil", "no data", "nodata", "b.d", "b.d.", "brak", "s/d"),
    *("sin dato", "sin datos", "нет", "н/д", "нет данных", "нет изм.", "无"),
}
MISSING_BRACKETS = "()[]<>{}"  # about such a text
MISSING_PATTERN = re.compile(r"[-–—*?._~]+|#[^\W\d]+(?:/[^\W\d0]*0?)?[!?]?")  # --, ***, and errors of a spreadsheet
MINUS_SIGNS = "\u2212\u2013\u2012\ufe63\uff0d"  # that are typeset
THOUSANDS_PATTERN = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")  # a number that may be a thousand or a decimal
GROUP_SPACES = " \u00a0\u2009\u202f'"
GROUPED_PATTERN = re.compile(  # 1,234.5, 1.234,5, 1 234,5 and 1,234,567: commas and points of one meaning
    rf"([-+]?\d{{1,3}}(?:(?:,\d{{3}})+(?=\.)|(?:\.\d{{3}})+(?=,)|(?:[{GROUP_SPACES}]\d{{3}})+|"
    r"(,|\.)\d{3}(?:\2\d{3})+))(?:[.,](\d+))?"
)
COMMA_PATTERN = re.compile(r"[-+]?(?:\d+,(?:\d{1,2}|\d{4,})|\d{1,3}(?:\.\d{3})+,\d+|0,\d+)")  # decimal for certain
POINT_PATTERN = re.compile(r"[-+]?(?:\d*\.(?:\d{1,2}|\d{4,})|0\.\d+|\d{4,}\.\d*)")
GROUP_PATTERN = re.compile(r"[-+]?[1-9]\d{0,2}(?:\.\d{3})+")
MONTH_PATTERN = re.compile(r"\d{1,2}[.\s-]+[^\W\d_]{3,}\.?(?:[\s-]+\d{2,4})?|[^\W\d_]{3,}\.?[\s-]+\d{2,4}")
UNIT_CELL_PATTERN = re.compile(r"([-+]?[\d.,]*\d[\d.,]*(?:[eE][-+]?\d+)?)\s*([^\W\d_°º].*|[°º].*)")
SEXAGESIMAL_PATTERN = re.compile(  # 52°18'30.5", 52° 18.5', 52 18 30
    r"([-+]?\d{1,3})\s*[°º:d\s]\s*(\d{1,2}(?:[.,]\d+)?)\s*(?:['′’:m\s]\s*(?:(\d{1,2}(?:[.,]\d+)?)\s*(?:[\"″”s]|'')?)?)?"
)
HEMISPHERES = {  # by quantity: those whose coordinates are negative last; in the languages of the names of columns
    "latitude_deg": (
        ("n", "north", "nord", "norte", "с", "с.ш", "сш", "北"),
        ("s", "south", "süd", "sued", "sud", "sur", "sul", "ю", "ю.ш", "юш", "南"),
    ),
    "longitude_deg": (
        ("e", "east", "ost", "est", "este", "leste", "в", "в.д", "вд", "东", "東"),
        ("w", "west", "ouest", "oeste", "ovest", "з", "з.д", "зд", "西"),
    ),
}
EAST_OR_WEST = "o"  # of Ost, ouest, oeste, ovest


def has_decimal_commas(cells: Iterable[str]) -> bool:
    """Whether the numbers in cells have decimal commas, so that their points can only separate thousands."""
    texts = [cell.strip() for cell in cells]
    return any(map(COMMA_PATTERN.fullmatch, texts)) and not any(map(POINT_PATTERN.fullmatch, texts))


def ungrouped(cell: str) -> str:
    """A cell without the points that separate thousands in 30.004 or 1.030.004."""
    return cell.replace(".", "") if GROUP_PATTERN.fullmatch(cell.strip()) else cell


def ungrouped_cells(row: Sequence[str], places: Container[int]) -> list[str]:
    """A row whose cells in some places are without such points."""
    return [ungrouped(cell) if i in places else cell for i, cell in enumerate(row)]


class CellNumbers:
    """Read the numbers of a table; decimal_comma: whether its cells may have one; o_sign: of longitudes with an O."""

    def __init__(self, decimal_comma: bool, o_sign: float = math.nan):
        self.decimal_comma, self.o_sign = decimal_comma, o_sign
        self.doubtful = ""  # the first number whose comma may separate thousands
        self.has_decimal_comma = False  # a comma that cannot has been read

    def number(self, text: str) -> float:
        """The number in a cell; raises ValueError."""
        try:
            return float(text)
        except ValueError:
            return float(self._with_decimal_point(text))

    def quantity(self, text: str, ours: str, factor: float, units: Mapping[str, float]) -> float:
        """A quantity of ours in a cell, by the factor of its column or the unit in the cell; not-a-number where it
        stands for none. Raises ValueError."""
        if is_missing(text):
            return math.nan
        try:
            value = float(text)
        except ValueError:
            value, factor = self._split_quantity(text, ours, factor, units)
        if not abs(value) <= LARGEST_NUMBER and not math.isnan(value):
            raise ValueError(text)
        return value * factor

    def _split_quantity(self, text: str, ours: str, factor: float, units: Mapping[str, float]) -> tuple[float, float]:
        """A number with its factor: of its column, or of a unit or a hemisphere in the cell; raises ValueError."""
        try:
            return float(self._with_decimal_point(text)), factor
        except ValueError:
            pass
        if ours in HEMISPHERES and (sides := split_hemisphere(text, ours, self.o_sign)):
            angle, sign = sides
            return sign * abs(self.quantity(angle, "", 1.0, DEGREES)), 1.0
        if (units in (DEGREES, EARTH_DEGREES, RADIANS)) and (parts := SEXAGESIMAL_PATTERN.fullmatch(text)):
            degrees, minutes, seconds = (float(part.replace(",", ".")) for part in parts.groups(default="0"))
            if max(minutes, seconds) > SIXTY:  # 60.0 is rounded
                raise ValueError(text)
            size = abs(degrees) + minutes / SIXTY + seconds / SIXTY**2
            return math.copysign(size, -1 if text.startswith("-") else 1), units["deg"]
        if (value := self.unit_cell(text, units)) is None:
            raise ValueError(text)
        return value, 1.0

    def unit_cell(self, text: str, units: Mapping[str, float]) -> float | None:
        """The number of a cell that states one of these units, in ours; None of another text."""
        match = UNIT_CELL_PATTERN.fullmatch(text)
        unit = cell_unit(match[2]) if match else ""
        return self.number(match[1]) * units[unit] if match and unit in units else None

    def _with_decimal_point(self, text: str) -> str:
        """A number with a decimal point, and without separators of thousands where they can be nothing else."""
        if "," not in text and " " not in text and "'" not in text and text.count(".") < 2 and text.isascii():
            return text
        text = text.removeprefix("'")  # that marks a text in a spreadsheet
        if text[:1] in MINUS_SIGNS:
            text = f"-{text[1:]}"
        if match := GROUPED_PATTERN.fullmatch(text):
            return re.sub(r"[^\d+-]", "", match[1]) + (f".{match[3]}" if match[3] else "")
        if text.count(",") != 1 or "." in text or (THOUSANDS_PATTERN.fullmatch(text) and not self.decimal_comma):
            return text
        if THOUSANDS_PATTERN.fullmatch(text):
            self.doubtful = self.doubtful or text
        else:
            self.has_decimal_comma = True
        return text.replace(",", ".")


def is_missing(text: str) -> bool:
    """Whether a cell stands for no value."""
    if not text or text.lower() in MISSING_TEXTS or MISSING_PATTERN.fullmatch(text) is not None:
        return True
    return text[0] in MISSING_BRACKETS and text.strip(MISSING_BRACKETS).lower() in MISSING_TEXTS


def spoiled_number_cure(text: str) -> str:
    """What helps where a spreadsheet has made a date of a number, as 12. May of 12.5; '' of another cell."""
    is_date = MONTH_PATTERN.fullmatch(text) is not None
    return "a spreadsheet has made a date of a number: export the column as numbers" if is_date else ""


def unit_of_cells(cells: list[str], units: Mapping[str, float]) -> str:
    """The unit that all cells of a column state; '' where they do not, or state several."""
    matches = [UNIT_CELL_PATTERN.fullmatch(cell) for cell in cells if not is_missing(cell)]
    found = {cell_unit(match[2]) if match else "" for match in matches}
    return found.pop() if len(found) == 1 and found <= set(units) else ""


def hemisphere_sign(text: str, ours: str, o_sign: float = math.nan) -> float:
    """1 or -1 by the hemisphere that a cell names, o_sign where it may be east or west; not-a-number of any other
    text."""
    key = text.strip().rstrip(".").lower()
    if key == EAST_OR_WEST and ours == "longitude_deg":
        return o_sign
    names = zip(HEMISPHERES[ours], (1.0, -1.0), strict=True)
    return next((sign for words, sign in names if key in words), math.nan)


def split_hemisphere(text: str, ours: str, o_sign: float = math.nan) -> tuple[str, float] | None:
    """The angle of a coordinate with its hemisphere before or after it, and the sign of that."""
    for pattern in (r"(\D+?)\s*([\d].*)", r"([\d].*?)\s*([^\W\d][^\d]*)"):
        if match := re.fullmatch(pattern, text):
            letter, angle = match.groups() if pattern.startswith(r"(\D") else match.groups()[::-1]
            if not math.isnan(sign := hemisphere_sign(letter, ours, o_sign)):
                return angle, sign
    return None
