"""Rare events by importance sampling: the table `rare`, with notes where the weights do not support its numbers.

Realisations are drawn from a law under which the event is frequent, and each counts with its weight w, the ratio of the
laws: the mean of w over those with the event is its probability, whatever the law (docs/rare.md). A share of them is
drawn from the original law, so that no weight exceeds one divided by that share."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.language.translate import tr
from radarsim.report import statistics, tables, wording
from radarsim.report.row_notes import RowNote, notes_where
from radarsim.report.statistics import MIN_EVENTS

if TYPE_CHECKING:
    import pandas as pd


UNGUIDED_SHARE = 0.1  # share of Σw² that no shift leads to, from which on a rate has a note
UNGUIDED = RowNote("unguided", "much of it in ways that no shift leads to")
UNDER_FEW_EVENTS = f"under {MIN_EVENTS} effective events"
FEW_EVENTS_NOTE = RowNote("few_events", UNDER_FEW_EVENTS)
# 20 such events behind the rate do not tell: losses of lock of 10⁻⁶, shifted along the linear direction of each
# hand-over, 200 × 10 000 bursts, had intervals that covered 81 %, and 5 events behind these. docs/rare.md has both
# conditions and what they were measured to leave.
HEAVY_WEIGHTS = RowNote("heavy_weights", f"interval of {UNDER_FEW_EVENTS}: heavy weights")
# Of a rate that is a sum, each part of which has weights of its own size.
IN_PART = RowNote("few_events_in_part", f"a part of it {UNDER_FEW_EVENTS}")
MAX_MEAN_ERROR = 4.0  # standard errors of the mean weight from which it is not one; unknown for few weights


class SamplingWeights(NamedTuple):
    """How realisations were drawn: all, how many from the original law, Σw and Σw²; numbers, or one for each row."""

    n: int
    plain_count: float | np.ndarray
    weight: float | np.ndarray
    squared: float | np.ndarray


class EventWeights(NamedTuple):
    """The realisations with an event: Σw, Σw², their number and Σw⁴, arrays of one shape."""

    weight: np.ndarray
    squared: np.ndarray
    number: np.ndarray
    fourth: np.ndarray


def event_rate(event: EventWeights, sampling: SamplingWeights) -> statistics.Estimate:
    """The probability of the event with its interval, from the weights."""
    return statistics.weighted_rate(event.weight, event.squared, sampling.n, sampling.plain_count)


def complement(probability: statistics.Estimate) -> statistics.Estimate:
    """One minus a probability."""
    return statistics.Estimate(1 - probability.value, 1 - probability.hi, 1 - probability.lo)


def rate_columns(
    labels: Mapping[str, Any],
    event: str,
    sought: np.ndarray,
    events: EventWeights,
    sampling: SamplingWeights,
    is_unguided_part: bool = False,
) -> dict[str, Any]:
    """Probabilities of rare events, with the key `rare`: from the weights of realisations drawn for them.

    From labels (case, filter, k, t_s) of n rows and sought (n,). The interval is known from Σw², and that by
    (Σw²)²/Σw⁴ realisations: where few have most of the weight, larger weights may be missing, and the rate and its
    interval are too small together, and a `note` marks the row. docs/rare.md has more.

    event: in words
    sought: whether realisations are drawn for it
    event_rate ±: its probability
    events: number of realisations that have it; `n_eff` effective ones
    variance_factor: how many times as many plain realisations give the same precision
    n_plain: number of the n drawn from the original law
    mean_weight, mean_weight_se: mean of all weights, which must be one, and its standard error"""
    estimate, size = event_rate(events, sampling), len(sought)
    variance = events.squared / sampling.n - estimate.value**2
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(events.number > 0, estimate.value * (1 - estimate.value) / variance, np.nan)
    mean = sampling.weight / sampling.n
    spread = np.sqrt(np.maximum(sampling.squared / sampling.n - mean**2, 0) / max(sampling.n - 1, 1))
    effective = statistics.effective_events(events.weight, events.squared)
    return {
        **labels,
        "event": np.full(size, event, dtype=object),
        "sought": sought,
        "n": np.full(size, sampling.n),
        "event_rate": estimate,
        "events": events.number.astype(np.int64),
        "n_eff": effective,
        "variance_factor": factor,
        "n_plain": np.full(size, sampling.plain_count).astype(np.int64),
        "mean_weight": np.full(size, mean),
        "mean_weight_se": np.full(size, spread),
        "note": weight_notes(sampling, events),
        UNGUIDED_PART: np.full(size, is_unguided_part),
    }


UNGUIDED_PART = "is_unguided_part"  # column of `rows`, not of the table: part of the sought event without a shift


def weight_notes(sampling: SamplingWeights, *events: EventWeights) -> np.ndarray:
    """The notes (rows,) on rows with the rates of these events: for the first event that has one.

    Every row of every table with weighted rates may have one: shifts lead to the last scan alone, so that at other
    scans few weights, of any size, are behind a rate. Where an event is common, realisations without it are counted
    too."""
    notes = np.full(events[0].weight.shape, "", dtype=object)
    for event in events:
        with_event = statistics.effective_events(event.weight, event.squared)
        without_event = statistics.effective_events(sampling.weight - event.weight, sampling.squared - event.squared)
        are_few = np.minimum(with_event, without_event) < MIN_EVENTS
        of_interval = np.minimum(statistics.effective_events(event.squared, event.fourth), _dominant_events(event))
        of_event = notes_where(are_few, FEW_EVENTS_NOTE, notes_where(of_interval < MIN_EVENTS, HEAVY_WEIGHTS))
        notes = np.where(notes != "", notes, of_event)
    return notes


def _dominant_events(event: EventWeights) -> np.ndarray:
    """How many of the events have weights of the size that dominates Σw², by the spread of all weights: n_eff²/number.

    For Gaussian logarithms of spread τ, w² has its mass 2τ above the middle: there are e^{−2τ²} of the events, and
    n_eff/number is e^{−τ²}. A sample that lacks the heavy ones still shows the spread of the others."""
    with np.errstate(divide="ignore", invalid="ignore"):
        dominant = statistics.effective_events(event.weight, event.squared) ** 2 / event.number
    return np.where(event.number > 0, dominant, 0.0)


def rate_table(parts: "Sequence[dict[str, Any]]") -> "pd.DataFrame | None":
    """The table `rare` of cases' columns from `rows`; None where no case has any."""
    if not parts:
        return None
    rates = tables.join_columns(parts)
    notes = notes_where(_is_unguided(rates), UNGUIDED, rates["note"].to_numpy(dtype=object))
    return rates.assign(note=notes).drop(columns=UNGUIDED_PART)


def rate_fields(row: "pd.Series") -> dict[str, Any]:
    """The fields of a sentence on a row of rare.csv: rate with interval, number of events, and effective ones."""
    return {
        "rate": wording.estimate((row[f"event_rate{end}"] for end in ("", "_lo", "_hi")), form=".3g"),
        "events": row["events"],
        "n_eff": row["n_eff"],
    }


MIN_EFFECTIVE_EVENTS = 2.0  # below, one weight decides: no estimate


def is_estimated(row: "pd.Series") -> bool:
    """Whether a row of rare.csv rests on more than one effective event."""
    return bool(row["n_eff"] >= MIN_EFFECTIVE_EVENTS)


def mean_weight_warnings(rates: "pd.DataFrame | None") -> list[str]:
    """A line on the worst case whose weights have a wrong mean, which makes every rate wrong."""
    if rates is None or not len(rows := rates[rates["n"] >= statistics.MIN_TRUSTED_REALISATIONS]):
        return []
    excess = (rows["mean_weight"] - 1).abs() - MAX_MEAN_ERROR * rows["mean_weight_se"]
    worst = rows.iloc[int(excess.to_numpy().argmax())]
    if excess.max() <= 0:
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


def _is_unguided(rates: "pd.DataFrame") -> np.ndarray:
    """The sought rows (rows,) where a part of the event without a shift dominates Σw² = (Σw)²/n_eff."""
    sought, squared = rates["sought"].astype(bool), rates["event_rate"] ** 2 / rates["n_eff"].clip(lower=1.0)
    of_parts = squared.where(rates[UNGUIDED_PART].astype(bool), 0.0)
    of_parts = of_parts.groupby([rates[name] for name in ("case", "filter", "k")]).transform("max")
    return (sought & (of_parts > UNGUIDED_SHARE * squared)).to_numpy()
