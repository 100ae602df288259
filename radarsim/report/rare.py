"""Rare events by importance sampling: the table `rare`, with notes where the weights do not support its numbers.

Realisations are drawn from a law under which the event is frequent, and each counts with its weight w, the ratio of the
laws: the mean of w over those with the event is its probability, whatever the law (docs/rare.md). A share of them is
drawn from the original law, so that no weight exceeds one divided by that share."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.language import tr
from radarsim.report import statistics, tables
from radarsim.report.statistics import FEW_EVENTS

if TYPE_CHECKING:
    import pandas as pd


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
    """How realisations were drawn: all, how many from the original law, Σw and Σw²; numbers, or one for each row."""

    n: int
    plain: float | np.ndarray
    weight: float | np.ndarray
    squared: float | np.ndarray


class Counted(NamedTuple):
    """The realisations with an event: Σw, Σw², their number and Σw⁴, arrays of one shape."""

    weight: np.ndarray
    squared: np.ndarray
    number: np.ndarray
    fourth: np.ndarray


def rate(of: Counted, drawn: Drawn) -> statistics.Estimate:
    """The probability of the event with its interval, from the weights."""
    return statistics.weighted_rate(of.weight, of.squared, drawn.n, drawn.plain)


def complement(of: statistics.Estimate) -> statistics.Estimate:
    """One minus a probability."""
    return statistics.Estimate(1 - of.value, 1 - of.hi, 1 - of.lo)


def rows(labels: Mapping[str, Any], event: str, sought: np.ndarray, of: Counted, drawn: Drawn) -> dict[str, Any]:
    """Probabilities of rare events, with the key `rare`: from the weights of realisations drawn for them.

    From labels (case, filter, k, t_s) of n rows and sought (n,). The interval is known from Σw², and that by
    (Σw²)²/Σw⁴ realisations: where few have most of the weight, larger weights may be missing, and the rate and its
    interval are too small together, and a `note` marks the row. docs/rare.md has more.

    event: in words
    sought: whether realisations are drawn for it
    rate ±: its probability
    events: number of realisations that have it; `n_eff` effective ones
    variance_factor: how many times as many plain realisations give the same precision
    plain: number of the n drawn from the original law
    mean_weight, mean_weight_se: mean of all weights, which must be one, and its standard error"""
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
    """The notes (rows,) on rows with the rates of these events: for the first event that has one.

    Every row of every table with weighted rates may have one: shifts lead to the last scan alone, so that at other
    scans few weights, of any size, are behind a rate. Where an event is common, realisations without it are counted
    too."""
    said = np.full(events[0].weight.shape, "", dtype=object)
    for of in events:
        having = statistics.effective_events(of.weight, of.squared)
        lacking = statistics.effective_events(drawn.weight - of.weight, drawn.squared - of.squared)
        few = np.minimum(having, lacking) < FEW_EVENTS
        heavy = np.minimum(statistics.effective_events(of.squared, of.fourth), _weighing(of)) < FEW_EVENTS
        said = np.where(said != "", said, np.where(few, FEW, np.where(heavy, HEAVY, "")).astype(object))
    return said


def _weighing(of: Counted) -> np.ndarray:
    """How many of the events have weights of the size that dominates Σw², by the spread of all weights: n_eff²/number.
    For Gaussian logarithms of spread τ, w² has its mass 2τ above the middle: there are e^{−2τ²} of the events, and
    n_eff/number is e^{−τ²}. A sample that lacks the heavy ones still shows the spread of the others."""
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
    """A row of rare.csv in words: rate with interval, number of events, and effective ones."""
    return {
        "rate": row["rate"],
        "low": row["rate_lo"],
        "high": row["rate_hi"],
        "events": row["events"],
        "n_eff": row["n_eff"],
    }


def unaimed(event: str, how: str) -> str:
    """The name of an event without a shift of its own, part of a sampled one: `how` it comes about."""
    return f"{event} {how}"


def warnings(made: "pd.DataFrame | None") -> list[str]:
    """A line on the worst case whose weights have a wrong mean, which makes every rate wrong."""
    if made is None or not len(rows := made[made["n"] >= statistics.FEW]):
        return []
    off = (rows["mean_weight"] - 1).abs() - ERRORS * rows["mean_weight_se"]
    worst = rows.iloc[int(off.to_numpy().argmax())]
    if off.max() <= 0:
        return []
    return [
        tr(
            "{case}: the mean weight is {mean:.4g} ± {error:.2g} instead of one: do not use the rates of "
            "rare events here",
            case=worst["case"],
            mean=worst["mean_weight"],
            error=worst["mean_weight_se"],
        )
    ]


def _unaimed(made: "pd.DataFrame") -> np.ndarray:
    """The sampled rows (rows,) where events without a shift of their own dominate Σw² = (Σw)²/n_eff."""
    sought, squared = made["sought"].astype(bool), made["rate"] ** 2 / made["n_eff"].clip(lower=1.0)
    parts = ~sought & made["event"].str.startswith(tuple(unaimed(one, "") for one in made["event"][sought].unique()))
    of_parts = squared.where(parts, 0.0).groupby([made[name] for name in ("case", "filter", "k")]).transform("max")
    return (sought & (of_parts > UNAIMED * squared)).to_numpy()
