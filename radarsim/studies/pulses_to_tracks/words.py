"""What the report of the chain asks and answers, in words."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language import listed, tr
from radarsim.report import panels, tables, wording
from radarsim.studies.pulses_to_tracks.tables import Result

if TYPE_CHECKING:
    import pandas as pd

OVER = ("over_ideal", "over_ideal_lo", "over_ideal_hi")
ALIKE = 1.05  # σ over its idealisation's, up to which the idealisation holds


def warnings(experiment: Experiment) -> list[str]:
    """Forecasts wider than the span of velocity, where a filter takes the nearest fold: no burst alone can tell it."""
    lines: dict[str, None] = {}
    for case in experiment.cases:
        spec = case.spec
        reach = 3 * spec.prior.sigma_velocity_mps
        if reach > spec.span_mps / 2 and any(one.hypotheses == 1 for one in spec.filters):
            words = tr(
                "3 σ of the velocity, {reach:g} m/s, are over half the span of {span:g} m/s: first bursts may be taken "
                "in a wrong fold",
                reach=reach,
                span=spec.span_mps,
            )
            lines[f"{case.stem}: prior.sigma_velocity_mps: {words}"] = None
    return list(lines)


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = listed(list(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases)))
    return tr(
        "What are the bursts of {radars} worth to the track, and what does a burst that does not lock cost?",
        radars=names,
    )


def answer(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Of several cases first each filter where it is furthest from its idealisation. For each case: the filters nearest
    to their idealisation and furthest; of each its locks and σ; the burst."""
    shown, others = panels.reported(results, 3)
    of_all = _of_all(results, made) if len(results) > 1 else []
    return [*of_all, *(sentence for result in shown for sentence in _sentences(result, made)), *others]


def _of_all(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Of each filter the largest σ of the range at the last scan over its idealisation's; none without any."""
    last = tables.where(made["idealisations"], component="r").groupby(["case", "filter"], sort=False).tail(1)
    places = dict(zip((result.name for result in results), panels.names_of(results), strict=True))
    last = last[last["case"].isin(places)].dropna(subset=["over_ideal"])
    worst = last.sort_values("over_ideal", kind="stable").groupby("filter", sort=False).tail(1)
    found = [
        f"{row['filter']} {wording.estimate((row[key] for key in OVER), form='.3g')} ({places[row['case']]})"
        for row in worst.to_dict("records")
    ]
    words = tr(
        "σ of the range at the last scan over its idealisation's, at worst of {count} cases: {found}.",
        count=len(results),
        found="; ".join(found),
    )
    return [words] if found else []


def _sentences(result: Result, made: "Mapping[str, pd.DataFrame]") -> list[str]:
    axes, spec = result.axes, result.spec
    bound = axes.bound[..., 0][np.isfinite(axes.bound[..., 0])]
    if not bound.size:
        return []
    low, high = float(axes.energy_db.min()), float(axes.energy_db.max())
    energy = tr("{low:.3g} dB", low=low) if high - low < 0.05 else tr("{low:.3g} to {high:.3g} dB", low=low, high=high)
    case, names = panels.plain_label(result), [name for f, name in enumerate(axes.filters) if axes.ideal[f] >= 0]
    burst = tr(
        "{case}: {pulses} pulses in {burst_ms:.3g} ms, {energy} in all, allow σ_V = {sigma:.3g} m/s (Fisher bound).",
        case=case,
        pulses=spec.pulses,
        burst_ms=1e3 * spec.burst_s,
        energy=energy,
        sigma=bound.min(),
    )
    ends = [f"{case}: {_ends(result, made, names)}."] if len(names) > 1 else []
    return [*ends, *(f"{case}, {name}: {_filter(result, made, name)}." for name in names), burst]


def _ends(result: Result, made: "Mapping[str, pd.DataFrame]", names: Sequence[str]) -> str:
    """The filters whose last σ of the range is nearest to their idealisation's and furthest from it."""
    last = tables.where(made["idealisations"], case=result.name, component="r").groupby("filter", sort=False).tail(1)
    last = last[last["filter"].isin(names)].sort_values("over_ideal", kind="stable").iloc[[0, -1]]
    near, far = (wording.estimate((row[key] for key in OVER), form=".3g") for row in last.to_dict("records"))
    best, worst = last["filter"]
    return tr(
        "with {best} σ of the range at the last scan is {near} times its idealisation's, with {worst} {far} times",
        best=best,
        near=near,
        worst=worst,
        far=far,
    )


def _filter(result: Result, made: "Mapping[str, pd.DataFrame]", name: str) -> str:
    """Share of bursts that locked over all scans, and σ of the range at the last scan over its idealisation's."""
    locks, ideal = (tables.where(made[t], case=result.name, filter=name) for t in ("locks", "idealisations"))
    worst = locks.iloc[int(locks["lock_rate"].to_numpy().argmin())]
    locked = tr(
        "at least {share} of the bursts of a scan lock",
        share=wording.share(*(100 * worst[key] for key in ("lock_rate", "lock_lo", "lock_hi"))),
    )
    last = ideal[ideal["component"] == "r"].iloc[-1]
    if last["over_ideal_hi"] <= ALIKE:
        ratio = wording.estimate((last[key] for key in OVER), form=".4g")
        words = tr("σ of the range at the last scan is that of its idealisation, {ratio} times", ratio=ratio)
    else:
        ratio = wording.estimate((last[key] for key in OVER), form=".3g")
        words = tr("σ of the range at the last scan is {ratio} times its idealisation's", ratio=ratio)
    return f"{locked}; {words}"
