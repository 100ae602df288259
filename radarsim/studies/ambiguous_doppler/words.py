"""What the report of folded Doppler asks and answers, in words."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.config.experiment import Experiment
from radarsim.report import panels
from radarsim.studies.ambiguous_doppler.tables import Result

if TYPE_CHECKING:
    import pandas as pd

AS_GOOD = 5.0  # per cent above the oracle's σ


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = list(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases))
    return f"How much is the folded velocity of {', '.join(names)} worth, and from which scan on?"


def answer(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """For each case: from which scan on folded velocity is as good as unfolded, within 5 %; how often it is right."""
    shown, others = panels.told(results, 6)
    return [*(sentence for result in shown for sentence in _sentences(result, made)), *others]


def _sentences(result: Result, made: "Mapping[str, pd.DataFrame]") -> list[str]:
    axes, told = result.axes, []
    spans = ", ".join(f"{span:g}" for span in result.spec.radar.spans_mps)
    best = [f for f, remembers in zip(axes.filters, axes.remembers, strict=True) if remembers]
    best = best or [f for f, folded in zip(axes.filters, axes.folded, strict=True) if folded]
    for name in best:
        told.append(f"{panels.plain_label(result)} ({spans} m/s), {name}: {_as_good(result, name, made)}.")
    return told


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
        ends = f"[{end['above_oracle_lo']:.3g}, {end['above_oracle_hi']:.3g}]"
        above = f"{end['above_oracle_percent']:.3g} % {ends} above that of unfolded velocity"
        return f"σ of the velocity is still {above} at scan {end['k']}, the last; {right}"
    since = rows["k"].to_numpy()[int(late.nonzero()[0][-1]) + 1 if late.any() else 0]
    return f"as good as unfolded velocity, within {AS_GOOD:g} %, from scan {since} on; {right}"
