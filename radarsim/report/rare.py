"""Rare events by importance sampling: the table `rare`, with notes where the weights do not bear what it says.

Realisations are drawn from a law under which the event is frequent, and each counts with its weight w, the ratio of the
laws: the mean of w over those with the event is its probability, whatever the law (docs/rare.md). A share of them is
drawn from the law itself, so that no weight is over one divided by it.

What a sweep shows by itself: σ at the last scan against one swept key, or over two as a map, whatever the study.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import tr
from radarsim.report import panels, seen, statistics, tables
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Figure, Heat, Line, Panel, Style
from radarsim.report.statistics import FEW_EVENTS

if TYPE_CHECKING:
    import pandas as pd


# ---- rare ------------------------------------------------------------------------------------------------------------
UNAIMED = 0.1  # share of Σw² that no shift leads to, from which on it is told
ASTRAY = "much of it in ways that no shift leads to"
FEW = f"under {FEW_EVENTS} effective events"
# 20 such events behind the rate do not tell: losses of lock of 10⁻⁶, shifted along the linear direction of each
# hand-over, 200 × 10 000 bursts, had intervals that covered 81 %, and 5 events behind these. docs/rare.md has both
# conditions and what they were measured to leave.
HEAVY = f"interval of {FEW}: heavy weights"
IN_PART = f"a part of it {FEW}"  # of a rate that is a sum, each part of which has weights of its own size
ERRORS = 4.0  # standard errors of the mean weight beyond which it is not one; of fewer than FEW weights none is known


class Drawn(NamedTuple):
    """How realisations were drawn: all of them, how many from the law itself, Σw and Σw²; numbers, or one a row."""

    n: int
    plain: float | np.ndarray
    weight: float | np.ndarray
    squared: float | np.ndarray


class Counted(NamedTuple):
    """Of an event the realisations that have it: Σw, Σw², their number and Σw⁴, arrays of one shape."""

    weight: np.ndarray
    squared: np.ndarray
    number: np.ndarray
    fourth: np.ndarray


def rate(of: Counted, drawn: Drawn) -> statistics.Estimate:
    """The probability of the event with its interval, from the weights."""
    return statistics.weighted_rate(of.weight, of.squared, drawn.n, drawn.plain)


def complement(of: statistics.Estimate) -> statistics.Estimate:
    """One less a probability."""
    return statistics.Estimate(1 - of.value, 1 - of.hi, 1 - of.lo)


def rows(labels: Mapping[str, Any], event: str, sought: np.ndarray, of: Counted, drawn: Drawn) -> dict[str, Any]:
    """How probable rare events are, with the key `rare`: by the weights of realisations that are drawn for them.

    From labels (case, filter, k, t_s) of n rows and sought (n,). The interval is known from Σw², and that by
    (Σw²)²/Σw⁴ realisations: where few weigh most, larger weights may be missing, and the rate and its interval are too
    small together, and a `note` stands there. docs/rare.md has more.

    event: in words
    sought: whether realisations are drawn for it
    rate ±: its probability
    events: number of realisations that have it; `n_eff` effective ones
    variance_factor: how many times more plain realisations would know the probability as well
    plain: number of the n that are drawn as they are
    mean_weight, mean_weight_se: mean of all weights, which must be one, and its standard error
    """
    estimate, size = rate(of, drawn), len(sought)
    variance = of.squared / drawn.n - estimate.value**2
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(of.number > 0, estimate.value * (1 - estimate.value) / variance, np.nan)
    mean = drawn.weight / drawn.n
    spread = np.sqrt(np.maximum(drawn.squared / drawn.n - mean**2, 0) / max(drawn.n - 1, 1))
    effective = statistics.effective_events(of.weight, of.squared)
    return {
        **labels,
        "event": np.full(size, event, dtype=object),
        "sought": sought,
        "n": np.full(size, drawn.n),
        "rate": estimate,
        "events": of.number.astype(np.int64),
        "n_eff": effective,
        "variance_factor": factor,
        "plain": np.full(size, drawn.plain).astype(np.int64),
        "mean_weight": np.full(size, mean),
        "mean_weight_se": np.full(size, spread),
        "note": note(drawn, of),
    }


def note(drawn: Drawn, *events: Counted) -> np.ndarray:
    """What is to be said (rows,) of rows with the rates of these events: of the first of which there is something.

    Any row of any table with weighted rates has one: shifts lead to the last scan alone, so that few weights, of any
    size, stand behind others. Where an event is common, those that do not have it are counted too.
    """
    said = np.full(events[0].weight.shape, "", dtype=object)
    for of in events:
        having = statistics.effective_events(of.weight, of.squared)
        lacking = statistics.effective_events(drawn.weight - of.weight, drawn.squared - of.squared)
        few = np.minimum(having, lacking) < FEW_EVENTS
        heavy = np.minimum(statistics.effective_events(of.squared, of.fourth), _weighing(of)) < FEW_EVENTS
        said = np.where(said != "", said, np.where(few, FEW, np.where(heavy, HEAVY, "")).astype(object))
    return said


def _weighing(of: Counted) -> np.ndarray:
    """How many of the events have weights of the size that Σw² is made of, by the spread of them all: n_eff²/number.

    Of logarithms of spread τ, Gaussian, w² has its mass 2τ above the middle: where e^{−2τ²} of the events are, and
    n_eff/number is e^{−τ²}. A sample that lacks the heavy ones shows the spread of the others still.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        found = statistics.effective_events(of.weight, of.squared) ** 2 / of.number
    return np.where(of.number > 0, found, 0.0)


def table(parts: "Sequence[dict[str, Any]]") -> "pd.DataFrame | None":
    """The table `rare` of cases' columns; None where no case has any."""
    if not parts:
        return None
    made = tables.joined(parts)
    return made.assign(note=made["note"].mask(_unaimed(made), ASTRAY))


def told(row: "pd.Series") -> dict[str, Any]:
    """What a sentence tells of a row of rare.csv: rate with interval, number of events, and effective ones."""
    return {
        "rate": row["rate"],
        "low": row["rate_lo"],
        "high": row["rate_hi"],
        "events": row["events"],
        "n_eff": row["n_eff"],
    }


def unaimed(event: str, how: str) -> str:
    """The name of an event that no shift leads to, part of one that is sought: `how` it comes about."""
    return f"{event} {how}"


def warnings(made: "pd.DataFrame | None") -> list[str]:
    """Where weights have not the mean that they must have, which makes every rate wrong: a line of the worst case."""
    if made is None or not len(rows := made[made["n"] >= statistics.FEW]):
        return []
    off = (rows["mean_weight"] - 1).abs() - ERRORS * rows["mean_weight_se"]
    worst = rows.iloc[int(off.to_numpy().argmax())]
    if off.max() <= 0:
        return []
    return [
        tr(
            "{case}: the mean weight is {mean:.4g} ± {error:.2g}, not one: no rate of a rare event is right here",
            case=worst["case"],
            mean=worst["mean_weight"],
            error=worst["mean_weight_se"],
        )
    ]


def _unaimed(made: "pd.DataFrame") -> np.ndarray:
    """The rows (rows,) sought of which a part that no shift leads to has much of what is known, Σw² = (Σw)²/n_eff."""
    sought, squared = made["sought"].astype(bool), made["rate"] ** 2 / made["n_eff"].clip(lower=1.0)
    parts = ~sought & made["event"].str.startswith(tuple(unaimed(one, "") for one in made["event"][sought].unique()))
    of_parts = squared.where(parts, 0.0).groupby([made[name] for name in ("case", "filter", "k")]).transform("max")
    return (sought & (of_parts > UNAIMED * squared)).to_numpy()


# ---- sweeps ----------------------------------------------------------------------------------------------------------
WIDE = 20  # largest over least swept value from which the axis is logarithmic
VALUES = ("m", "rad")  # units of what is measured itself, not of its rates
MOST_PANELS = 6
BROAD = 12  # letters of a name at an axis, from which it is broken between words


def figures(results: Sequence[CaseResult], curves: Mapping) -> dict[str, Figure]:
    """A figure for each config that is swept over one key or two.

    curves is tables.groups(table, "case", "filter", "component").
    """
    drawn = {}
    for (stem, keys), members in families(results).items():
        several = len({family for family, _ in families(results)}) > 1
        name = "_".join(["sweep", *([stem] if several else []), *(key.rpartition(".")[2] for key in keys)])
        made = line_figure(name, keys[0], members, curves) if len(keys) == 1 else None
        made = map_figure(name, keys, members, curves) if len(keys) == 2 else made
        if made is not None:
            drawn[name] = made
    return drawn


def families(results: Sequence[CaseResult]) -> dict[tuple[str, tuple[str, ...]], list[CaseResult]]:
    """Swept cases by their config and the keys that they differ in."""
    found: dict = {}
    for result in results:
        if result.swept:
            found.setdefault((panels.stem(result), tuple(key for key, _ in result.swept)), []).append(result)
    return {key: members for key, members in found.items() if len(members) > 1}


def components(result: CaseResult) -> list[tuple[str, str]]:
    """The components shown: what is measured; of a single one, its rates too."""
    values = [(name, unit) for name, unit in result.axes.components if unit in VALUES]
    return (values if len(values) > 1 else list(result.axes.components))[:MOST_PANELS]


def places(result: CaseResult, key: str, values: Sequence) -> tuple[np.ndarray, Axis]:
    """Where values of a key that is swept stand on an axis: numbers where they are, anything else one after the other.

    result is one of the swept cases.
    """
    label = panels.axis_of(result, key)
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        x = panels.axis_factor(result, key) * np.array(values, dtype=float)
        return x, Axis(label, "log" if x.min() > 0 and x.max() / x.min() > WIDE else "linear")
    named = [panels.in_short(v, values) for v in values]
    words = [panels.number(v if isinstance(v, str | list | tuple | Mapping) else str(v)) for v in named]
    ticks = tuple((float(i), textwrap.fill(one, BROAD, break_long_words=False)) for i, one in enumerate(words))
    return np.arange(float(len(values))), Axis(label, ticks=ticks)


def last(result: CaseResult, filter_name: str, component: str, curves: Mapping) -> tuple[float, ...]:
    """σ at the last scan with its interval and exact value; not-a-number where the filter has none."""
    rows = curves.get((result.name, filter_name, component))
    if rows is None or not len(rows):
        return (np.nan,) * 4
    row = rows.iloc[-1]
    return tuple(float(row[name]) for name in ("sigma", "sigma_lo", "sigma_hi", "exact_sigma"))


def line_figure(name: str, key: str, members: Sequence[CaseResult], curves: Mapping) -> Figure | None:
    """σ at the last scan against one key: a panel for each component, a line for each filter."""
    x, axis = places(members[0], key, [dict(result.swept)[key] for result in members])
    order, made = np.argsort(x), []
    filters = list(dict.fromkeys(f for result in members for f in result.axes.filters))
    for n, (component, given) in enumerate(components(members[0])):
        marks, (factor, unit) = [], panels.in_degrees(given)
        for i, f in enumerate(filters):
            found = factor * np.array([last(members[j], f, component, curves) for j in order])
            if np.isfinite(found[:, 0]).any():
                words, exact = panels.literal(f), found[:, 3] if np.isfinite(found[:, 3]).any() else None
                style = Style(i, i, i)
                label = words if n == 0 else ""
                marks.append(Line(x[order], found[:, 0], label, style, found[:, 1], found[:, 2], exact, words))
        if marks:
            words = tr("$\\sigma$ of {symbol} at the end", symbol=panels.letter(component))
            y = panels.fitting_axis(panels.with_unit(words, unit), marks)
            made.append(Panel(axis, y, tuple(marks), direct=False))
    if not made:
        return None
    caption = tr(
        "σ at the last scan against the {key}, of {realisations} each. Bands: 95 % intervals.",
        key=panels.key_label(members[0], key).text,
        realisations=panels.realisations(members),
    )
    columns = min(3 if len(made) != 4 else 2, len(made))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    title = tr("σ over the {key}", key=panels.key_label(members[0], key).text)
    figure = Figure(name, title, caption, tuple(made), columns, width, 60)
    return seen.begun(figure, seen.extremes(figure))


def map_figure(name: str, keys: tuple[str, ...], members: Sequence[CaseResult], curves: Mapping) -> Figure | None:
    """σ of the first component at the last scan over two keys: a map for each filter."""
    component, unit = members[0].axes.components[0]
    members = [result for result in members if component in dict(result.axes.components)]
    shown = [key for key in keys if len({_hashable(dict(r.swept)[key]) for r in members}) > 1]
    if len(shown) < 2:  # the component is of one value of a key alone
        return line_figure(name, shown[0], members, curves) if shown else None
    values = [list(dict.fromkeys(_hashable(dict(r.swept)[key]) for r in members)) for key in keys]
    ranked = [sorted(v, key=lambda one: (isinstance(one, str), one)) for v in values]
    (x, x_axis), (y, y_axis) = (places(members[0], key, v) for key, v in zip(keys, ranked, strict=True))
    made = []
    filters = list(dict.fromkeys(f for result in members for f in result.axes.filters))
    for f in filters[:MOST_PANELS]:
        grid = np.full((len(y), len(x)), np.nan)
        for result in members:
            column, row = (ranked[i].index(_hashable(dict(result.swept)[key])) for i, key in enumerate(keys))
            grid[row, column] = last(result, f, component, curves)[0]
        if np.isfinite(grid).any():
            heat = Heat(
                x, y, grid, panels.with_unit(tr("$\\sigma$ of {symbol}", symbol=panels.letter(component)), unit)
            )
            factors = [panels.axis_factor(members[0], key) for key in keys]
            ticks = [
                tuple(
                    (
                        float(i),
                        panels.number(v) if factor == 1.0 else tables.number(factor * float(v), panels.FEW_DIGITS),
                    )
                    for i, v in enumerate(values)
                )
                for factor, values in zip(factors, ranked, strict=True)
            ]
            columns_axis, rows_axis = (Axis(one.label, ticks=t) for one, t in zip((x_axis, y_axis), ticks, strict=True))
            made.append(Panel(columns_axis, rows_axis, (heat,), panels.literal(f)))
    if not made:
        return None
    first, second = (panels.key_label(members[0], key).text for key in keys)
    caption = tr(
        "σ of {component} at the last scan over the {first} and the {second}, of {realisations} in each cell.",
        component=component,
        first=first,
        second=second,
        realisations=panels.realisations(members),
    )
    caption += panels.left_out(filters, filters[:MOST_PANELS])
    title = tr("σ over the {first} and the {second}", first=first, second=second)
    columns = min(2, len(made))
    width = panels.WIDE_MM if columns == 1 else PAGE_MM
    figure = Figure(name, title, caption, tuple(made), columns, width, 62)
    return seen.begun(figure, seen.extremes(figure))


def _hashable(value: object) -> int | float | str:
    return value if isinstance(value, int | float | str) else str(value)
