"""A comparison: cases of stored results and their partners; table, sentences and figures.

The table has every measured value of two sides at common times, and their difference with its interval. Where both
sides use the same measurements their errors are correlated, and the interval of a difference needs the correlation ρ of
their mean squares. Stored results hold that of each filter with the baseline of its run. Where both runs have the same
baseline (its rows are equal to the last digit), ρ is at least ρ₁ρ₂ − √((1 − ρ₁²)(1 − ρ₂²)), since a correlation matrix
has no negative eigenvalue: with it the interval covers 95 % or more. Where no filter links them, ρ is taken as −1, the
worst case: the half-widths add. Sides of different noise are independent.

The figures show each quantity of all sides on common axes, and the differences beside it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.language import plural, term, tr
from radarsim.report import seen, tables
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Mark, Panel, Reference, Style
from radarsim.report.panels import MOST, left_out, letter, line, literal, time_axis, with_unit
from radarsim.report.quantities import COMMON, SIGMA, Quantity
from radarsim.report.statistics import Estimate, difference
from radarsim.report.wording import interval, significant_digits
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd


# ---- sides -----------------------------------------------------------------------------------------------------------
LABELS = ("filter", "component", "model")  # that identify the line of a row; the time identifies its point


@dataclass(frozen=True)
class Side:
    """One case of one stored result.

    label: its name here; noise: a hash of all that its measurements depend on, None where unknown; count: its
    realisations; tables: its rows of the stored tables, by name; measured: the quantities of its study."""

    run: str
    case: str
    label: str
    noise: str | None
    count: int
    tables: "Mapping[str, pd.DataFrame]" = field(repr=False)
    measured: tuple[Quantity, ...] = COMMON

    def rest(self) -> str:
        """The name of the case without its config's: the swept keys."""
        return self.case.partition(" ")[2]


class Pair(NamedTuple):
    """A side, and the one it is compared with."""

    side: Side
    against: Side

    @property
    def common_noise(self) -> bool:
        """Whether both use the same measurements: study, seed, target and sensor, and as many realisations."""
        return self.side.noise is not None and self.side.noise == self.against.noise


def pairs(runs: Sequence[Sequence[Side]]) -> tuple[list[Pair], list[str]]:
    """Each further run's cases against those of the first, and a line for each case without a partner. A run of a
    single case is compared with every case of the other; else cases with the same swept values, or the same name, are
    partners."""
    first, found, alone = runs[0], [], []
    for run in runs[1:]:
        own = [Pair(side, other) for side in run for other in first if min(len(run), len(first)) == 1]
        if not own:
            named = {other.case: other for other in first} | {other.rest(): other for other in first if other.rest()}
            answering = {side.label: named.get(side.rest() or side.case) for side in run}
            own = [Pair(side, other) for side in run if (other := answering[side.label]) is not None]
            alone += [f"{label}: no such case in {first[0].run}" for label, other in answering.items() if other is None]
        found += own
    return found, alone


# ---- table -----------------------------------------------------------------------------------------------------------
COLUMNS = (
    *("quantity", "filter", "component", "model", "unit", "t_s", "run", "case", "value", "lo", "hi", "exact"),
    *("against_run", "against_case", "against_filter", "against", "against_lo", "against_hi", "against_exact"),
    *("difference", "difference_lo", "difference_hi", "percent", "percent_lo", "percent_hi", "exact_percent"),
    *("pairing", "label", "against_label"),
)
INDEPENDENT, LINKED, UNLINKED, SAME = "independent", "paired", "common noise", "same numbers"
MEANING = {
    INDEPENDENT: term("independent noise"),
    LINKED: term("paired on common noise through the common baseline; the interval covers 95 % or more"),
    UNLINKED: term("common noise but no common baseline filter; the interval is valid for any correlation"),
    SAME: term("the same numbers"),
}
DIGITS = 9  # of a time, when rows are matched


def compared(pairs: Sequence[Pair]) -> "pd.DataFrame":
    """A row for each value of a side that the other side has too."""
    parts = [part for pair in pairs for of in shared(pair) if (part := _part(pair, of)) is not None]
    return tables.joined(parts, COLUMNS)


def shared(sides: Iterable[Side]) -> list[Quantity]:
    """The quantities measured by two sides or more; the complement of a share differs by the same amount."""
    found = [one for side in sides for one in side.measured if not one.rest]
    return [one for one in dict.fromkeys(found) if found.count(one) > 1]


def filters_of(side: Side) -> list[str]:
    """The filters of a side, in their order."""
    return list(dict.fromkeys(side.tables["curves"]["filter"])) if "curves" in side.tables else []


def _part(pair: Pair, of: Quantity) -> dict[str, Any] | None:
    """The columns of one quantity of one pair; None where they share no row."""
    found = [side.tables.get(of.table) for side in pair]
    a, b = (None if table is None or not len(table) else _rows(table, of) for table in found)
    if a is None or b is None:
        return None
    own, other = filters_of(pair.side), filters_of(pair.against)
    alone = len(own) == len(other) == 1 and own != other  # two single filters are partners whatever their names
    b = b.assign(against_filter=b["filter"])
    if alone:
        b = b.assign(filter=own[0])
    keys = [name for name in (*LABELS, "unit") if name in a and name in b]
    a, b = (rows.assign(at=rows["t_s"].round(DIGITS)) for rows in (a, b))
    if not set(a["at"]) & set(b["at"]):  # no common time: the ends of both
        a, b = (rows.groupby(keys, sort=False).tail(1).assign(at=np.nan) for rows in (a, b))
    rows = a.merge(b, on=[*keys, "at"], suffixes=("", "_b"))
    return _columns(pair, of, rows) if len(rows) else None


def _rows(table: "pd.DataFrame", of: Quantity) -> "pd.DataFrame":
    """Rows of a quantity's table with the columns of `LABELS`, `unit`, `t_s`, `value`, `lo`, `hi` and `exact`. The
    first ones as far as it has them; without times these are not-a-number."""
    values, exact = of.read(table)
    labels = {"filter": "filter", of.per if of.per in LABELS else "component": of.per, "unit": "unit"}
    return tables.frame(
        {
            **{name: table[column].to_numpy() for name, column in labels.items() if column in table},
            "t_s": table["t_s"].to_numpy(dtype=float) if "t_s" in table else np.full(len(table), np.nan),
            **tables.interval_columns("value", values, ""),
            "exact": exact,
        }
    )


def _columns(pair: Pair, of: Quantity, rows: "pd.DataFrame") -> dict[str, Any]:
    n = len(rows)
    empty, blank = np.full(n, np.nan), np.full(n, "", dtype=object)
    unit = np.full(n, of.unit, dtype=object)
    measured, other = (_estimate(rows, end) for end in ("", "_b"))
    rho, pairing = correlation(pair, of, rows)
    same = pairing == SAME

    def apart_of(one: Estimate, two: Estimate) -> Estimate:
        apart = difference(one, two, rho)
        return Estimate(apart.value, *(np.where(same, apart.value, end) for end in apart[1:]))

    apart = apart_of(measured, other)
    exact, against_exact = (rows[f"exact{end}"].to_numpy() for end in ("", "_b"))
    percent, exact_percent = Estimate(empty, empty, empty), empty
    if of.kind == "size":
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = apart_of(*(Estimate(*map(np.log, side)) for side in (measured, other)))
            known = np.isfinite(ratio.value)  # not where either was never seen
            percent = Estimate(*(np.where(known, 100 * np.expm1(end), np.nan) for end in ratio))
            exact_percent = 100 * (exact / against_exact - 1)
    return {
        "quantity": np.full(n, of.value, dtype=object),
        **{name: _column(rows, name, blank) for name in LABELS},
        "unit": _column(rows, "unit", unit),
        "t_s": rows["t_s"].to_numpy(dtype=float),
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "").items()},
        **tables.interval_columns("value", measured, ""),
        "exact": exact,
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "against_").items()},
        "against_filter": rows["against_filter"].to_numpy(),
        **tables.interval_columns("against", other),
        "against_exact": against_exact,
        **tables.interval_columns("difference", apart),
        **tables.interval_columns("percent", percent),
        "exact_percent": exact_percent,
        "pairing": pairing,
    }


def _names(pair: Pair, before: str) -> Mapping[str, str]:
    side = pair.against if before else pair.side
    return {f"{before}run": side.run, f"{before}case": side.case, f"{before}label": side.label}


def _column(rows: "pd.DataFrame", name: str, absent: np.ndarray) -> np.ndarray:
    return rows[name].to_numpy() if name in rows else absent


def _estimate(rows: "pd.DataFrame", end: str) -> Estimate:
    return Estimate(*(rows[f"{name}{end}"].to_numpy(dtype=float) for name in ("value", "lo", "hi")))


def correlation(pair: Pair, of: Quantity, rows: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """For each row the correlation of both estimates, in the worst case, and how it is known."""
    n = len(rows)
    if not pair.common_noise:
        return np.zeros(n), np.full(n, INDEPENDENT, dtype=object)
    a, b = (_estimate(rows, end) for end in ("", "_b"))
    same = np.all([x == y for x, y in zip(a, b, strict=True)], axis=0)
    rho = np.full(n, -1.0)
    if of == SIGMA and pair.side.count == pair.against.count:
        one = _with_baseline(pair.side, rows, "filter")
        two = _with_baseline(pair.against, rows, "against_filter")
        linked = _same_baseline(pair, rows)
        with np.errstate(invalid="ignore"):
            worst = one * two - np.sqrt(np.maximum((1 - one**2) * (1 - two**2), 0))
        rho = np.where(linked & np.isfinite(worst), worst, rho)
    words = np.where(rho > -1, LINKED, UNLINKED).astype(object)
    return np.where(same, 1.0, rho), np.where(same, SAME, words)


def _with_baseline(side: Side, rows: "pd.DataFrame", column: str) -> np.ndarray:
    """The correlation of each row's mean square with the baseline's: from the widths of both σ and of their gain."""
    base, widths = baseline(side), _widths(side.tables["curves"], "sigma_lo", "sigma_hi")
    gains = side.tables["gains"]
    ratios = _widths(gains.assign(hi=100 - gains["gain_lo"], lo=100 - gains["gain_hi"]), "lo", "hi")
    found = np.full(len(rows), np.nan)
    for i, (f, c, t) in enumerate(rows[[column, "component", "t_s"]].itertuples(index=False, name=None)):
        own, other, joint = widths.get((f, c, t)), widths.get((base, c, t)), ratios.get((f, c, t))
        if f == base:
            found[i] = 1.0
        elif own and other and joint is not None:
            found[i] = np.clip((own**2 + other**2 - joint**2) / (2 * own * other), -1, 1)
    return found


def _widths(table: "pd.DataFrame", lo: str, hi: str) -> dict[tuple, float]:
    """Half the logarithm of the upper over the lower end, by filter, component and time."""
    with np.errstate(divide="ignore", invalid="ignore"):
        half = 0.5 * np.log(table[hi].to_numpy(dtype=float) / table[lo].to_numpy(dtype=float))
    keys = table[["filter", "component", "t_s"]].itertuples(index=False, name=None)
    return {key: value for key, value in zip(keys, half.tolist(), strict=True) if np.isfinite(value)}


def baseline(side: Side) -> str:
    """The filter that a side's gains are against; empty where there are no gains."""
    gains = side.tables.get("gains")
    return "" if gains is None or not len(gains) else str(gains["baseline"].iloc[0])


def _same_baseline(pair: Pair, rows: "pd.DataFrame") -> np.ndarray:
    """Whether both sides' baselines have equal numbers at the row's component and time: the same filter."""
    known = []
    for side in pair:
        curves = side.tables["curves"]
        own = curves[curves["filter"] == baseline(side)]
        values = own[["component", "t_s", "sigma", "sigma_lo", "sigma_hi"]].itertuples(index=False, name=None)
        known.append({(c, t): rest for c, t, *rest in values})
    places = rows[["component", "t_s"]].itertuples(index=False, name=None)
    return np.array([place in known[0] and known[0][place] == known[1].get(place) for place in places], dtype=bool)


# ---- words -----------------------------------------------------------------------------------------------------------
MOST_SENTENCES = 12  # sentences; the table has all


def sentences(made: "pd.DataFrame", measured: Iterable[Quantity] = COMMON) -> list[str]:
    """At the last common time, for the first component of each quantity in `told`: both values and their difference."""
    last = at_the_end(made)
    lines: list[str] = []
    for of in told(made, measured):
        rows = last[last["quantity"] == of.value]
        if not len(rows):
            continue
        first = tables.where(rows, component=rows["component"].iloc[0], model=rows["model"].iloc[0])
        lines += [_sentence(of.words, row) for row in first.to_dict("records")]
    left = len(lines) - MOST_SENTENCES
    return lines[:MOST_SENTENCES] + (
        [
            plural(
                "{count} further comparison: in comparison.csv.",
                "{count} further comparisons: in comparison.csv.",
                left,
            )
        ]
        if left > 0
        else []
    )


def told(made: "pd.DataFrame", measured: Iterable[Quantity]) -> list[Quantity]:
    """The quantities in sentences: the first, and those that neither follow from it (gains) nor list many shares."""
    found = [of for of in measured if (made["quantity"] == of.value).any()]
    return [of for n, of in enumerate(found) if not n or (not of.paired and of.per in ("", "component"))]


def at_the_end(made: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of the last common time of each line, of those with a value on both sides."""
    keys = ["quantity", "label", "against_label", "filter", "component", "model"]
    last = made.groupby(keys, sort=False).tail(1)
    return last[last["value"].notna() & last["against"].notna()]


def _sentence(words: str, row: dict[Any, Any]) -> str:
    of = str(row["component"] or row["model"])
    unit = tr(unit_of(row["unit"]))
    other = f"{row['against_label']}" + ("" if row["against_filter"] == row["filter"] else f", {row['against_filter']}")
    what = tr("{quantity} of {symbol}", quantity=tr(words), symbol=of) if of else tr(words)
    change, exact = changes(row)
    if row["t_s"] == row["t_s"]:
        what = tr("{what} at {t_s:g} s", what=what, t_s=row["t_s"])
    return tr(
        "{label}, {filter}: {what} {value} against {against} of {other}: {change}.",
        label=row["label"],
        filter=row["filter"],
        what=what,
        value=f"{value(row['value'])} {unit}".rstrip(),
        against=f"{value(row['against'])} {unit}".rstrip(),
        other=other,
        change=change + (tr(", exactly {value}", value=exact) if exact else ""),
    )


def changes(row: dict[Any, Any]) -> tuple[str, str]:
    """The difference of a value, with its interval; and the exact difference where known beside a sample."""
    if row["percent"] != row["percent"]:
        text = f"{signed(row['difference'])} {tr(unit_of(row['unit']))}".rstrip()
        return f"{text} {interval(signed(row['difference_lo']), signed(row['difference_hi']))}", ""
    exact = row["exact_percent"]
    if row["lo"] == row["hi"] and row["against_lo"] == row["against_hi"] and exact == exact:
        return percent(exact), ""  # of a table of exact values: there is no interval
    ends = row["percent_lo"], row["percent_hi"]
    said = [signed(one, "#.3g") if max(ends) < MULTIPLE else percent(one) for one in ends]
    return f"{percent(row['percent'])} {interval(*said)}", percent(exact) if exact == exact else ""


MULTIPLE = 300  # per cent, from which on a change is written as a multiple


def percent(value: float) -> str:
    """A change in per cent with its sign; from four times on as a multiple."""
    if value >= MULTIPLE:
        return tr("{factor} times", factor=significant_digits(1 + value / 100, ".3g"))
    return f"{signed(value, '.3g')} %"


def signed(value: float, form: str = ".3g") -> str:
    """A number with its sign."""
    text = significant_digits(value, form)
    return text if text.startswith("−") or value == 0 else f"+{text}"


def value(number: float) -> str:
    """A number at four digits."""
    return significant_digits(number)


def pairings(made: "pd.DataFrame") -> list[str]:
    """How the differences are paired, a line for each kind."""
    kinds = made.loc[made["quantity"] == "sigma", "pairing"].tolist()
    counts = {words: kinds.count(kind) for kind, words in MEANING.items()}
    return [
        tr("{count:,} of {total:,} differences of σ: {words}", count=count, total=len(kinds), words=tr(words))
        for words, count in counts.items()
        if count
    ]


# ---- figures ---------------------------------------------------------------------------------------------------------
HEIGHT_MM = 70.0


def figures(sides: Sequence[Side], made: "pd.DataFrame") -> dict[str, Figure]:
    """A figure for each quantity and component that two sides share: values on the left, differences on the right.

    made is from table.compared. Of more than eight sides the first eight are drawn, and the caption says so."""
    drawn, measured = {}, {one.value: one for one in shared(sides)}
    for (quantity, component, model), rows in made.groupby(["quantity", "component", "model"], sort=False):
        of = measured[str(quantity)]
        component, model = str(component), str(model)
        if rows["t_s"].nunique() < 2:
            continue
        parts = [of.value.removesuffix("_percent"), component, f"model{model}" if model else ""]
        name = "_".join(filter(None, parts))
        drawn[name] = _figure(name, of, sides, rows, component, model)
    return drawn


def _figure(name: str, of: Quantity, sides: Sequence[Side], rows: "pd.DataFrame", component: str, model: str) -> Figure:
    taking_part = {*rows["label"], *rows["against_label"]}
    every = [side for side in sides if side.label in taking_part]
    some = every[:MOST]
    filters = list(dict.fromkeys(f for side in some for f in filters_of(side)))
    unit = rows["unit"].iloc[0]
    symbol = letter(component) if component else model
    what = tr(of.axis, symbol=symbol) if of.axis else f"{tr(of.words)} {symbol}".strip()
    values = [mark for n, side in enumerate(some) for mark in _values(of, side, n, filters, component, model)]
    apart = _apart(of, some, rows, filters)
    keys = [(literal(side.label), Style(n, 0)) for n, side in enumerate(some)]
    keys += [(literal(f), Style(0, n, n)) for n, f in enumerate(filters)] if len(filters) > 1 else []
    low = None if of.kind == "signed" else 0.0
    y = Axis(with_unit(what, unit), limits=(low, None))
    apart_by = term("change") if of.kind == "size" else term("difference")
    against = rows["against_label"].iloc[0] if rows["against_label"].nunique() == 1 else tr("the first")
    difference = Axis(
        with_unit(tr("{of} against {name}", of=apart_by, name=literal(against)), "%" if of.kind == "size" else unit)
    )
    panels = (
        Panel(time_axis(), y, tuple(values), direct=False, legend="none"),
        Panel(time_axis(), difference, (Reference(0), *apart), keys=tuple(keys), legend="right"),
    )
    caption = (
        tr(
            "Left: {words} of {value} on common axes. Right: the {of} against {against} at common times. "
            "Bands: 95 % intervals.",
            words=term(of.words),
            value=", ".join(side.label for side in some),
            of=apart_by,
            against=against,
        )
    ) + left_out([side.label for side in every], [side.label for side in some])
    figure = Figure(name, tr("{what} side by side", what=what), caption, panels, 2, PAGE_MM, HEIGHT_MM)
    return seen.with_meaning_of_crosses(figure)


def _values(of: Quantity, side: Side, n: int, filters: Sequence[str], component: str, model: str) -> list[Mark]:
    """A line for each filter of a side."""
    table, marks = side.tables.get(of.table), list[Mark]()
    if table is None:
        return marks
    rows = _rows(table, of)
    for i, f in enumerate(filters):
        own = rows[rows["filter"] == f]
        own = own[own["component"] == component] if component else own
        own = own[own["model"] == model] if "model" in own and model else own
        if len(own):
            columns = ("t_s", "value", "lo", "hi", "exact")
            marks.append(line(own, columns, "", Style(n, i, i), f"{literal(side.label)}, {literal(f)}"))
    return marks


def _apart(of: Quantity, sides: Sequence[Side], rows: "pd.DataFrame", filters: Sequence[str]) -> list[Mark]:
    """A line for each filter of each side that is compared with another."""
    value, exact = ("percent", "exact_percent") if of.kind == "size" else ("difference", "")
    numbers, marks = {side.label: n for n, side in enumerate(sides)}, list[Mark]()
    several = rows["against_label"].nunique() > 1
    for key, own in rows.groupby(["label", "against_label", "filter"], sort=False):
        label, against, f = map(str, key)
        if label not in numbers or against not in numbers:
            continue
        name = f"{literal(label)}, {literal(f)}"
        if several:
            name = tr("{name} against {other}", name=name, other=literal(against))
        i = filters.index(f)
        columns = ["t_s", value, f"{value}_lo", f"{value}_hi", *([exact] if exact else [])]
        marks.append(line(own, columns, "", Style(numbers[label], i, i), name))
    return marks
