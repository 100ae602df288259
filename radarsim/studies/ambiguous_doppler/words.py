"""What the report of folded Doppler asks and answers, in words."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.report import panels
from radarsim.studies.ambiguous_doppler.tables import Result

if TYPE_CHECKING:
    import pandas as pd

AS_GOOD = 5.0  # per cent above the oracle's σ
LOST = 100.0  # per cent above it, from which a σ is rather a share of lost tracks


def warnings(experiment: Experiment) -> list[str]:
    """Spans of velocity in which next to nothing can be unfolded: a line for each config and span."""
    lines: dict[str, None] = {}
    for case in experiment.cases:
        radar = case.spec.radar
        for span in radar.spans_mps:
            if span < 2 * radar.sigma_velocity_mps and any(one.folds for one in case.spec.filters):
                sigma = f"2 σ_V, {2 * radar.sigma_velocity_mps:g} m/s"
                words = f"its span of {span:g} m/s is under {sigma}: next to nothing can be unfolded"
                lines[f"{case.stem}: radar.repetition_rate_hz: {words}"] = None
    return list(lines)


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = " and ".join(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases))
    if any(one.folds for case in experiment.cases for one in case.spec.filters):
        return f"How much is the folded velocity of {names} worth, and from which scan on?"
    return f"Which order of filter follows the target of {names}, and how are several combined?"


def answer(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """For each case: from which scan on folded velocity is as good as unfolded, within 5 %; how often it is right.

    Of filters of several orders: the largest error of each over the scans, beside that of the best single order.
    """
    shown, others = panels.told(results, 6)
    return [*(sentence for result in shown for sentence in _sentences(result, made)), *others]


def _sentences(result: Result, made: "Mapping[str, pd.DataFrame]") -> list[str]:
    axes, told = result.axes, []
    spans = ", ".join(f"{span:g}" for span in result.spec.radar.spans_mps)
    for name in _told_of(result):
        told.append(f"{panels.plain_label(result)}, D = {spans} m/s, {name}: {_as_good(result, name, made)}.")
    if axes.combines.any():
        told.append(_orders_sentence(result, made))
    return told


def _told_of(result: Result) -> list[str]:
    """Of the filters that unfold those that are told of: the means over kept hypotheses, else all."""
    unfolding = [one for one in result.spec.filters if one.folds and one.combine is None]
    means = [one for one in unfolding if one.merge == "never" and one.estimate == "mean" and one.hypotheses > 1]
    return [one.name for one in means or unfolding]


def _orders_sentence(result: Result, made: "Mapping[str, pd.DataFrame]") -> str:
    """The largest σ of range over the scans of every filter, and what is left to gain."""
    curves = made["curves"][(made["curves"]["case"] == result.name) & (made["curves"]["component"] == "r")]
    worst = curves.loc[curves.groupby("filter", sort=False)["sigma"].idxmax()]
    said = [
        f"{row['filter']} {row['sigma']:.4g} m [{row['sigma_lo']:.4g}, {row['sigma_hi']:.4g}] at scan {row['k']}"
        for row in worst.to_dict("records")
    ]
    axes = result.axes
    f = int(np.flatnonzero(axes.combines)[0])
    best, whole = (float(np.max(values[f, :, 0])) for values in (axes.best_order, axes.best_combination))
    bounds = f"; who knew the target would have had {best:.4g} m by the best order of each scan"
    bounds += f", {whole:.4g} m by the best combination" if np.isfinite(whole) else ""
    ends = bounds if np.isfinite(best) else ""
    return f"{panels.plain_label(result)}: largest σ of the range: {'; '.join(said)}{ends}."


def _as_good(result: Result, name: str, made: "Mapping[str, pd.DataFrame]") -> str:
    """From which scan on σ of the velocity is within 5 % of the oracle's, for good, and the share of right folds."""
    gains, folds = (made[t][(made[t]["case"] == result.name) & (made[t]["filter"] == name)] for t in ("gains", "folds"))
    rows = gains[gains["component"] == "Vr"].dropna(subset=["above_oracle_percent"])
    last = folds.iloc[-1]
    ends = f"[{100 * last['right_lo']:.3g}, {100 * last['right_hi']:.3g}]"
    right = f"all folds are right in {100 * last['right']:.4g} % {ends} of realisations at scan {last['k']}"
    if not len(rows):
        return right
    late = rows["above_oracle_hi"].to_numpy() > AS_GOOD
    if late[-1]:
        end = rows.iloc[-1]
        if end["above_oracle_percent"] > LOST:
            ends = f"[{100 * last['beyond_lo']:.3g}, {100 * last['beyond_hi']:.3g}]"
            off = f"off by more than half the span in {100 * last['beyond']:.4g} % {ends} of realisations"
            return f"lost: at scan {end['k']}, the last, the velocity is {off}; {right}"
        ends = f"[{end['above_oracle_lo']:.3g}, {end['above_oracle_hi']:.3g}]"
        above = f"{end['above_oracle_percent']:.3g} % {ends} above that of unfolded velocity"
        return f"σ of the velocity is still {above} at scan {end['k']}, the last; {right}"
    since = rows["k"].to_numpy()[int(late.nonzero()[0][-1]) + 1 if late.any() else 0]
    return f"as good as unfolded velocity, within {AS_GOOD:g} %, from scan {since} on; {right}"
