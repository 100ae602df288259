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

    def swept_keys(self) -> str:
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
    """Each further run's cases against those of the first, and a line for each case without a partner.

    A run of a single case is compared with every case of the other; else cases with the same swept values, or the same
    name, are partners."""
    first, matched, unmatched = runs[0], list[Pair](), list[str]()
    by_name = {side.case: side for side in first} | {side.swept_keys(): side for side in first if side.swept_keys()}
    for run in runs[1:]:
        if min(len(run), len(first)) == 1:
            matched += [Pair(side, against) for side in run for against in first]
            continue
        partners = [(side, by_name.get(side.swept_keys() or side.case)) for side in run]
        matched += [Pair(side, against) for side, against in partners if against is not None]
        unmatched += [f"{side.label}: no such case in {first[0].run}" for side, against in partners if against is None]
    return matched, unmatched


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
    parts = [part for pair in pairs for quantity in shared(pair) if (part := _part(pair, quantity)) is not None]
    return tables.joined(parts, COLUMNS)


def shared(sides: Iterable[Side]) -> list[Quantity]:
    """The quantities measured by two sides or more; the complement of a share differs by the same amount."""
    measured = [quantity for side in sides for quantity in side.measured if not quantity.rest]
    return [quantity for quantity in dict.fromkeys(measured) if measured.count(quantity) > 1]


def filters_of(side: Side) -> list[str]:
    """The filters of a side, in their order."""
    return list(dict.fromkeys(side.tables["curves"]["filter"])) if "curves" in side.tables else []


def _part(pair: Pair, quantity: Quantity) -> dict[str, Any] | None:
    """The columns of one quantity of one pair; None where they share no row."""
    stored = [side.tables.get(quantity.table) for side in pair]
    a, b = (None if table is None or not len(table) else _rows(table, quantity) for table in stored)
    if a is None or b is None:
        return None
    filters, other_filters = filters_of(pair.side), filters_of(pair.against)
    # Two single filters are partners whatever their names.
    are_single = len(filters) == len(other_filters) == 1 and filters != other_filters
    b = b.assign(against_filter=b["filter"])
    if are_single:
        b = b.assign(filter=filters[0])
    keys = [name for name in (*LABELS, "unit") if name in a and name in b]
    a, b = (rows.assign(at=rows["t_s"].round(DIGITS)) for rows in (a, b))
    if not set(a["at"]) & set(b["at"]):  # no common time: the ends of both
        a, b = (rows.groupby(keys, sort=False).tail(1).assign(at=np.nan) for rows in (a, b))
    rows = a.merge(b, on=[*keys, "at"], suffixes=("", "_b"))
    return _columns(pair, quantity, rows) if len(rows) else None


def _rows(table: "pd.DataFrame", quantity: Quantity) -> "pd.DataFrame":
    """Rows of a quantity's table with the columns of `LABELS`, `unit`, `t_s`, `value`, `lo`, `hi` and `exact`. The
    first ones as far as it has them; without times these are not-a-number."""
    values, exact = quantity.read(table)
    labels = {"filter": "filter", quantity.per if quantity.per in LABELS else "component": quantity.per, "unit": "unit"}
    return tables.frame(
        {
            **{name: table[column].to_numpy() for name, column in labels.items() if column in table},
            "t_s": table["t_s"].to_numpy(dtype=float) if "t_s" in table else np.full(len(table), np.nan),
            **tables.interval_columns("value", values, ""),
            "exact": exact,
        }
    )


def _columns(pair: Pair, quantity: Quantity, rows: "pd.DataFrame") -> dict[str, Any]:
    n = len(rows)
    empty, blank = np.full(n, np.nan), np.full(n, "", dtype=object)
    unit = np.full(n, quantity.unit, dtype=object)
    measured, against = (_estimate(rows, end) for end in ("", "_b"))
    rho, pairing = correlation(pair, quantity, rows)
    is_same = pairing == SAME

    def difference_of(left: Estimate, right: Estimate) -> Estimate:
        change = difference(left, right, rho)
        return Estimate(change.value, *(np.where(is_same, change.value, end) for end in change[1:]))

    change = difference_of(measured, against)
    exact, against_exact = (rows[f"exact{end}"].to_numpy() for end in ("", "_b"))
    percent, exact_percent = Estimate(empty, empty, empty), empty
    if quantity.kind == "size":
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = difference_of(*(Estimate(*map(np.log, side)) for side in (measured, against)))
            is_finite = np.isfinite(ratio.value)  # not where either was never seen
            percent = Estimate(*(np.where(is_finite, 100 * np.expm1(end), np.nan) for end in ratio))
            exact_percent = 100 * (exact / against_exact - 1)
    return {
        "quantity": np.full(n, quantity.value, dtype=object),
        **{name: _column(rows, name, blank) for name in LABELS},
        "unit": _column(rows, "unit", unit),
        "t_s": rows["t_s"].to_numpy(dtype=float),
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "").items()},
        **tables.interval_columns("value", measured, ""),
        "exact": exact,
        **{name: np.full(n, value, dtype=object) for name, value in _names(pair, "against_").items()},
        "against_filter": rows["against_filter"].to_numpy(),
        **tables.interval_columns("against", against),
        "against_exact": against_exact,
        **tables.interval_columns("difference", change),
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


def correlation(pair: Pair, quantity: Quantity, rows: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """For each row the correlation of both estimates, in the worst case, and how it is known."""
    n = len(rows)
    if not pair.common_noise:
        return np.zeros(n), np.full(n, INDEPENDENT, dtype=object)
    a, b = (_estimate(rows, end) for end in ("", "_b"))
    is_same = np.all([x == y for x, y in zip(a, b, strict=True)], axis=0)
    rho = np.full(n, -1.0)
    if quantity == SIGMA and pair.side.count == pair.against.count:
        rho_side = _with_baseline(pair.side, rows, "filter")
        rho_against = _with_baseline(pair.against, rows, "against_filter")
        linked = _same_baseline(pair, rows)
        with np.errstate(invalid="ignore"):
            worst = rho_side * rho_against - np.sqrt(np.maximum((1 - rho_side**2) * (1 - rho_against**2), 0))
        rho = np.where(linked & np.isfinite(worst), worst, rho)
    pairing = np.where(rho > -1, LINKED, UNLINKED).astype(object)
    return np.where(is_same, 1.0, rho), np.where(is_same, SAME, pairing)


def _with_baseline(side: Side, rows: "pd.DataFrame", column: str) -> np.ndarray:
    """The correlation of each row's mean square with the baseline's: from the widths of both σ and of their gain."""
    baseline_name, widths = baseline(side), _widths(side.tables["curves"], "sigma_lo", "sigma_hi")
    gains = side.tables["gains"]
    ratios = _widths(gains.assign(hi=100 - gains["gain_lo"], lo=100 - gains["gain_hi"]), "lo", "hi")
    correlations = np.full(len(rows), np.nan)
    for i, (f, c, t) in enumerate(rows[[column, "component", "t_s"]].itertuples(index=False, name=None)):
        width, base_width, ratio_width = widths.get((f, c, t)), widths.get((baseline_name, c, t)), ratios.get((f, c, t))
        if f == baseline_name:
            correlations[i] = 1.0
        elif width and base_width and ratio_width is not None:
            correlations[i] = np.clip((width**2 + base_width**2 - ratio_width**2) / (2 * width * base_width), -1, 1)
    return correlations


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
    baseline_rows = []
    for side in pair:
        curves = side.tables["curves"]
        rows_of_baseline = curves[curves["filter"] == baseline(side)]
        values = rows_of_baseline[["component", "t_s", "sigma", "sigma_lo", "sigma_hi"]].itertuples(
            index=False, name=None
        )
        baseline_rows.append({(c, t): numbers for c, t, *numbers in values})
    points = rows[["component", "t_s"]].itertuples(index=False, name=None)
    return np.array(
        [point in baseline_rows[0] and baseline_rows[0][point] == baseline_rows[1].get(point) for point in points],
        dtype=bool,
    )


# ---- words -----------------------------------------------------------------------------------------------------------
MAX_SENTENCES = 12  # the table has all


def sentences(comparison: "pd.DataFrame", measured: Iterable[Quantity] = COMMON) -> list[str]:
    """Both values and their difference at the last common time, for the first component of `summary_quantities`."""
    last = at_the_end(comparison)
    lines: list[str] = []
    for quantity in summary_quantities(comparison, measured):
        rows = last[last["quantity"] == quantity.value]
        if not len(rows):
            continue
        first = tables.where(rows, component=rows["component"].iloc[0], model=rows["model"].iloc[0])
        lines += [_sentence(quantity.words, row) for row in first.to_dict("records")]
    further = len(lines) - MAX_SENTENCES
    if further <= 0:
        return lines
    remark = plural(
        "{count} further comparison: in comparison.csv.", "{count} further comparisons: in comparison.csv.", further
    )
    return [*lines[:MAX_SENTENCES], remark]


def summary_quantities(comparison: "pd.DataFrame", measured: Iterable[Quantity]) -> list[Quantity]:
    """The quantities in sentences: the first, and those that neither follow from it (gains) nor list many shares."""
    compared_quantities = [quantity for quantity in measured if (comparison["quantity"] == quantity.value).any()]
    return [
        quantity
        for n, quantity in enumerate(compared_quantities)
        if not n or (not quantity.paired and quantity.per in ("", "component"))
    ]


def at_the_end(comparison: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of the last common time of each line, of those with a value on both sides."""
    keys = ["quantity", "label", "against_label", "filter", "component", "model"]
    last = comparison.groupby(keys, sort=False).tail(1)
    return last[last["value"].notna() & last["against"].notna()]


def _sentence(words: str, row: dict[Any, Any]) -> str:
    symbol = str(row["component"] or row["model"])
    unit = tr(unit_of(row["unit"]))
    partner = f"{row['against_label']}" + (
        "" if row["against_filter"] == row["filter"] else f", {row['against_filter']}"
    )
    subject = tr("{quantity} of {symbol}", quantity=tr(words), symbol=symbol) if symbol else tr(words)
    change, exact = changes(row)
    if row["t_s"] == row["t_s"]:
        subject = tr("{what} at {t_s:g} s", what=subject, t_s=row["t_s"])
    return tr(
        "{label}, {filter}: {what} {value} against {against} of {other}: {change}.",
        label=row["label"],
        filter=row["filter"],
        what=subject,
        value=f"{value(row['value'])} {unit}".rstrip(),
        against=f"{value(row['against'])} {unit}".rstrip(),
        other=partner,
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
    percents = row["percent_lo"], row["percent_hi"]
    bounds = [signed(bound, "#.3g") if max(percents) < MULTIPLE else percent(bound) for bound in percents]
    return f"{percent(row['percent'])} {interval(*bounds)}", percent(exact) if exact == exact else ""


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


def pairings(comparison: "pd.DataFrame") -> list[str]:
    """How the differences are paired, a line for each kind."""
    kinds = comparison.loc[comparison["quantity"] == "sigma", "pairing"].tolist()
    counts = {meaning: kinds.count(kind) for kind, meaning in MEANING.items()}
    return [
        tr("{count:,} of {total:,} differences of σ: {words}", count=count, total=len(kinds), words=tr(meaning))
        for meaning, count in counts.items()
        if count
    ]


# ---- figures ---------------------------------------------------------------------------------------------------------
HEIGHT_MM = 70.0


def figures(sides: Sequence[Side], comparison: "pd.DataFrame") -> dict[str, Figure]:
    """A figure for each quantity and component that two sides share: values on the left, differences on the right.

    made is from table.compared. Of more than eight sides the first eight are drawn, and the caption says so."""
    figures_by_name, quantities = {}, {quantity.value: quantity for quantity in shared(sides)}
    for (value_column, component, model), rows in comparison.groupby(["quantity", "component", "model"], sort=False):
        quantity = quantities[str(value_column)]
        component, model = str(component), str(model)
        if rows["t_s"].nunique() < 2:
            continue
        parts = [quantity.value.removesuffix("_percent"), component, f"model{model}" if model else ""]
        name = "_".join(filter(None, parts))
        figures_by_name[name] = _figure(name, quantity, sides, rows, component, model)
    return figures_by_name


def _figure(
    name: str, quantity: Quantity, sides: Sequence[Side], rows: "pd.DataFrame", component: str, model: str
) -> Figure:
    labels = {*rows["label"], *rows["against_label"]}
    compared_sides = [side for side in sides if side.label in labels]
    visible = compared_sides[:MOST]
    filters = list(dict.fromkeys(f for side in visible for f in filters_of(side)))
    unit = rows["unit"].iloc[0]
    symbol = letter(component) if component else model
    axis_text = tr(quantity.axis, symbol=symbol) if quantity.axis else f"{tr(quantity.words)} {symbol}".strip()
    values = [mark for n, side in enumerate(visible) for mark in _values(quantity, side, n, filters, component, model)]
    changes = _change_lines(quantity, visible, rows, filters)
    keys = [(literal(side.label), Style(n, 0)) for n, side in enumerate(visible)]
    keys += [(literal(f), Style(0, n, n)) for n, f in enumerate(filters)] if len(filters) > 1 else []
    low = None if quantity.kind == "signed" else 0.0
    y = Axis(with_unit(axis_text, unit), limits=(low, None))
    change_name = term("change") if quantity.kind == "size" else term("difference")
    against = rows["against_label"].iloc[0] if rows["against_label"].nunique() == 1 else tr("the first")
    difference = Axis(
        with_unit(
            tr("{of} against {name}", of=change_name, name=literal(against)), "%" if quantity.kind == "size" else unit
        )
    )
    panels = (
        Panel(time_axis(), y, tuple(values), direct=False, legend="none"),
        Panel(time_axis(), difference, (Reference(0), *changes), keys=tuple(keys), legend="right"),
    )
    caption = (
        tr(
            "Left: {words} of {value} on common axes. Right: the {of} against {against} at common times. "
            "Bands: 95 % intervals.",
            words=term(quantity.words),
            value=", ".join(side.label for side in visible),
            of=change_name,
            against=against,
        )
    ) + left_out([side.label for side in compared_sides], [side.label for side in visible])
    figure = Figure(name, tr("{what} side by side", what=axis_text), caption, panels, 2, PAGE_MM, HEIGHT_MM)
    return seen.with_meaning_of_crosses(figure)


def _values(quantity: Quantity, side: Side, n: int, filters: Sequence[str], component: str, model: str) -> list[Mark]:
    """A line for each filter of a side."""
    table, marks = side.tables.get(quantity.table), list[Mark]()
    if table is None:
        return marks
    rows = _rows(table, quantity)
    for i, f in enumerate(filters):
        line_rows = rows[rows["filter"] == f]
        line_rows = line_rows[line_rows["component"] == component] if component else line_rows
        line_rows = line_rows[line_rows["model"] == model] if "model" in line_rows and model else line_rows
        if len(line_rows):
            columns = ("t_s", "value", "lo", "hi", "exact")
            marks.append(line(line_rows, columns, "", Style(n, i, i), f"{literal(side.label)}, {literal(f)}"))
    return marks


def _change_lines(
    quantity: Quantity, sides: Sequence[Side], rows: "pd.DataFrame", filters: Sequence[str]
) -> list[Mark]:
    """A line for each filter of each side that is compared with another."""
    value, exact = ("percent", "exact_percent") if quantity.kind == "size" else ("difference", "")
    numbers, marks = {side.label: n for n, side in enumerate(sides)}, list[Mark]()
    has_several_partners = rows["against_label"].nunique() > 1
    for key, line_rows in rows.groupby(["label", "against_label", "filter"], sort=False):
        label, against, f = map(str, key)
        if label not in numbers or against not in numbers:
            continue
        name = f"{literal(label)}, {literal(f)}"
        if has_several_partners:
            name = tr("{name} against {other}", name=name, other=literal(against))
        i = filters.index(f)
        columns = ["t_s", value, f"{value}_lo", f"{value}_hi", *([exact] if exact else [])]
        marks.append(line(line_rows, columns, "", Style(numbers[label], i, i), name))
    return marks
