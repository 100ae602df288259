"""What the report of the chain asks and answers, in words."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.report import panels
from radarsim.studies.pulses_to_tracks.tables import Result

if TYPE_CHECKING:
    import pandas as pd

ALIKE = 1.05  # σ over its idealisation's, up to which the idealisation holds


def warnings(experiment: Experiment) -> list[str]:
    """Forecasts wider than the span of velocity: no estimator of one burst can tell the fold."""
    lines: dict[str, None] = {}
    for case in experiment.cases:
        spec = case.spec
        reach = 3 * spec.prior.sigma_velocity_mps
        if reach > spec.span_mps / 2 and any(one.takes for one in spec.filters):
            half = f"half the span of {spec.span_mps:g} m/s"
            words = f"3 σ of the velocity, {reach:g} m/s, are over {half}: first bursts may be taken in a wrong fold"
            lines[f"{case.stem}: prior.sigma_velocity_mps: {words}"] = None
    return list(lines)


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = " and ".join(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases))
    return f"What are the bursts of {names} worth to the track, and what does a burst that does not lock cost?"


def answer(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """For each case: the burst in numbers; of each filter its locks and its last σ beside the idealisation."""
    shown, others = panels.told(results, 3)
    return [*(sentence for result in shown for sentence in _sentences(result, made)), *others]


def _sentences(result: Result, made: "Mapping[str, pd.DataFrame]") -> list[str]:
    axes, spec = result.axes, result.spec
    bound = axes.bound[..., 0][np.isfinite(axes.bound[..., 0])]
    if not bound.size:
        return []
    energy = (
        f"{axes.energy_db[0]:.3g} dB"
        if np.ptp(axes.energy_db) < 0.05
        else (f"{axes.energy_db.min():.3g} to {axes.energy_db.max():.3g} dB")
    )
    told = [
        f"{panels.plain_label(result)}: {spec.pulses} pulses in {1e3 * spec.burst_s:.3g} ms, {energy} in all, allow "
        f"σ_V = {bound.min():.3g} m/s (Fisher bound)."
    ]
    for f, name in enumerate(axes.filters):
        if axes.ideal[f] >= 0:
            told.append(f"{panels.plain_label(result)}, {name}: {_filter(result, made, name)}.")
    return told


def _filter(result: Result, made: "Mapping[str, pd.DataFrame]", name: str) -> str:
    """Share of bursts that locked over all scans, and σ of the range at the last scan over its idealisation's."""
    locks, ideal = (
        made[t][(made[t]["case"] == result.name) & (made[t]["filter"] == name)] for t in ("locks", "idealisations")
    )
    worst = locks.iloc[int(locks["lock_rate"].to_numpy().argmin())]
    ends = f"[{100 * worst['lock_lo']:.4g}, {100 * worst['lock_hi']:.4g}]"
    said = f"at least {100 * worst['lock_rate']:.4g} % {ends} of the bursts of a scan lock"
    last = ideal[ideal["component"] == "r"].iloc[-1]
    ends = f"[{last['over_ideal_lo']:.3g}, {last['over_ideal_hi']:.3g}]"
    if last["over_ideal_hi"] <= ALIKE:
        return f"{said}; σ of the range at the last scan is its idealisation's, {last['over_ideal']:.4g} times {ends}"
    return f"{said}; σ of the range at the last scan is {last['over_ideal']:.3g} times {ends} its idealisation's"
