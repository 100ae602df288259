"""How P3's claims on manoeuvres are measured: the cases they mean, and the numbers taken from tables."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from radarsim.papers.authoring import CaseResult, Curve, MissingEvidence, ratio, shipped_spec
from radarsim.papers.sonar.measures import CASE_FINDERS, Evidence, Key
from radarsim.report.statistics import Z95, Estimate
from radarsim.studies.sonar.filter_keys import Filter
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes

USUAL_FALSE_ALARM_RATE = 0.01  # false alarms a test
FALSE_ALARM_RATE_AT_ONE = 0.31731050786291415  # false alarms a test at k = 1: a Gaussian outside one σ


def _by_strength(results: Sequence[CaseResult]) -> list[CaseResult[ManoeuvreAxes]]:
    """The cases of an accelerating target with detectors in the polar frame, from the weakest manoeuvre on."""
    manoeuvres = [
        r
        for r in results
        if shipped_spec(r).frame == "polar"
        and shipped_spec(r).detectors
        and shipped_spec(r).target.kind == "accelerating"
    ]
    manoeuvres = [r for r in manoeuvres if r.axes.manoeuvre_s and (r.axes.phase == 1).any()]
    return sorted(manoeuvres, key=lambda r: abs(shipped_spec(r).target.acceleration_mps2))


def _weakest(results: Sequence[CaseResult]) -> CaseResult[ManoeuvreAxes] | None:
    manoeuvres = _by_strength(results)
    return manoeuvres[0] if len(manoeuvres) > 1 else None


def _strongest(results: Sequence[CaseResult]) -> CaseResult[ManoeuvreAxes] | None:
    manoeuvres = _by_strength(results)
    return manoeuvres[-1] if len(manoeuvres) > 1 else None


def _of_one_sigma(results: Sequence[CaseResult]) -> CaseResult[ManoeuvreAxes] | None:
    return next((r for r in _by_strength(results) if abs(_shift_of_five(r) - 1) < 0.01), None)


WEAK, STRONG, EQUAL = "weakest manoeuvre", "strongest manoeuvre", "manoeuvre of one σ_a"
CASE_FINDERS.update({WEAK: _weakest, STRONG: _strongest, EQUAL: _of_one_sigma})


def _detector(result: CaseResult[ManoeuvreAxes], plots: int, threshold_key: str, value: float) -> tuple[int, int]:
    """Index of the detector of so many plots that tests at every scan, and of its threshold; else MissingEvidence."""
    for d, detector in enumerate(shipped_spec(result).detectors):
        thresholds = getattr(detector, threshold_key) or ()
        if detector.plots == plots and detector.test_every == 1 and value in thresholds:
            return d, thresholds.index(value)
    raise MissingEvidence((plots, value))


def _shift_of_five(result: CaseResult[ManoeuvreAxes]) -> float:
    """Mean acceleration of five plots in σ_a at the last scan of the manoeuvre, in the range; zero without them."""
    try:
        d, _ = _detector(result, 5, "threshold_k", 1.0)
    except MissingEvidence:
        return 0.0
    return float(result.axes.shifts[d, 0, _last(result)])


def _last(result: CaseResult[ManoeuvreAxes]) -> int:
    """The last scan of the manoeuvre."""
    return int(np.flatnonzero(result.axes.phase == 1)[-1])


def thresholds_ratio(evidence: Evidence, key: Key, more: int, few: int) -> float:
    """Accelerations at the thresholds of two detectors of the same false alarms: algebra."""
    result, accelerations = evidence.case(key), []
    for plots in (more, few):
        d, _ = _detector(result, plots, "false_alarm_probability", USUAL_FALSE_ALARM_RATE)
        name = shipped_spec(result).detectors[d].name
        rows = evidence.tables["thresholds"]
        rows = rows[(rows["case"] == result.name) & (rows["filter"] == name) & (rows["component"] == "r")]
        nearest = (rows["false_alarm_probability"] - USUAL_FALSE_ALARM_RATE).abs().idxmin()
        accelerations.append(rows.loc[nearest, "threshold_acceleration"])
    return float(accelerations[0] / accelerations[1])


def mean_delay(result: CaseResult[ManoeuvreAxes], plots: int, rate: float = USUAL_FALSE_ALARM_RATE) -> Estimate:
    """Mean time from the beginning to the first alarm in the range, s; where there is none, to the manoeuvre's end."""
    return _mean_time(result, plots, rate, 1)


def mean_delay_of_both_ends(
    result: CaseResult[ManoeuvreAxes], plots: int, rate: float = USUAL_FALSE_ALARM_RATE
) -> Estimate:
    """`mean_delay`, and from the end to the first test without an alarm: their sum, taken as independent."""
    beginning, end = (_mean_time(result, plots, rate, phase) for phase in (1, 2))
    half = float(np.hypot(beginning.hi - beginning.value, end.hi - end.value))
    value = beginning.value + end.value
    return Estimate(value, value - half, value + half)


def _mean_time(result: CaseResult[ManoeuvreAxes], plots: int, rate: float, phase: int) -> Estimate:
    """Mean time from the beginning of a phase (1, 2) to its first event; where there is none, to its last scan."""
    d, t = _detector(result, plots, "false_alarm_probability", rate)
    scans = np.flatnonzero(result.axes.phase == phase)
    if not scans.size:
        raise MissingEvidence("the run ends before the manoeuvre does")
    share = np.asarray(result.sums["first"])[d, 0, t, scans] / result.count
    share[-1] += 1 - share.sum()
    since_s = (result.axes.manoeuvre_s or (np.nan, np.nan))[phase - 1]
    delay = result.axes.t_s[scans] - since_s
    mean = share @ delay
    half = Z95 * np.sqrt(max(share @ delay**2 - mean**2, 0.0) / result.count)
    return Estimate(float(mean), float(mean - half), float(mean + half))


Until = Literal["beginning", "beginning and end"]
DELAYS = {"beginning": mean_delay, "beginning and end": mean_delay_of_both_ends}


def delays_ratio(evidence: Evidence, key: Key, more: int, few: int, until: Until, rate: float) -> Estimate:
    """Mean delays of two detectors, taken as independent."""
    result, delay = evidence.case(key), DELAYS[until]
    return ratio(delay(result, more, rate), delay(result, few, rate))


def delay_of_more_plots(evidence: Evidence, key: Key, enough: Sequence[int], until: Until, rate: float) -> Estimate:
    """Least mean delay of detectors of more plots than `enough`, over the least of these, less 1, in %; as independent.
    Negative where more plots detect it sooner."""
    delays = _delays(evidence, key, until, rate)
    more = [delay for n, delay in delays.items() if n > max(enough)]
    few = [delay for n, delay in delays.items() if n in enough]
    shortest = [min(delays_of_group, key=lambda delay: delay.value) for delays_of_group in (more, few)]
    return Estimate(*(percent - 100 for percent in ratio(shortest[0], shortest[1], 100)))


def fastest_detector(evidence: Evidence, key: Key, until: Until, rate: float) -> Estimate:
    """Plots of the detector with the least mean delay; the interval spans all that cannot be distinguished from it."""
    delays = _delays(evidence, key, until, rate)
    best = min(delays, key=lambda plots: delays[plots].value)
    near = [plots for plots in delays if delays[plots].lo <= delays[best].hi]
    return Estimate(float(best), float(min(near)), float(max(near)))


def _delays(evidence: Evidence, key: Key, until: Until, rate: float) -> dict[int, Estimate]:
    """Mean delays by plots, of the detectors that test at every scan at a rate of false alarms."""
    result = evidence.case(key)
    detectors = (detector for detector in shipped_spec(result).detectors if detector.test_every == 1)
    plot_counts = [detector.plots for detector in detectors if rate in (detector.false_alarm_probability or ())]
    return {plots: DELAYS[until](result, plots, rate) for plots in plot_counts}


def exact_detected_at_one(evidence: Evidence, key: Key) -> float:
    """`detected_at_one` of the exact law."""
    return float(_at_one(evidence, key)["exact_probability"])


def detected_at_one(evidence: Evidence, key: Key) -> Estimate:
    """Share of alarms of five plots at k = 1 at the last scan of the manoeuvre of one σ_a."""
    row = _at_one(evidence, key)
    return Estimate(*(float(row[part]) for part in ("probability", "probability_lo", "probability_hi")))


def _at_one(evidence: Evidence, key: Key) -> Mapping[str, Any]:
    result = evidence.case(key)
    d, _ = _detector(result, 5, "threshold_k", 1.0)
    name, k = shipped_spec(result).detectors[d].name, int(result.axes.k[_last(result)])
    return evidence.row("detections", case=result.name, filter=name, component="r", threshold_k=1.0, k=k)


def degrees_ratio(evidence: Evidence, key: Key, degree: int) -> Estimate:
    """σ over the run of growing memory of a held degree, over that of the degree switched by five plots."""
    filters = [f for _, f in evidence.members(evidence.case(key))]
    fixed = next((f.name for f in filters if (f.kind, f.degree) == ("growing_memory", degree)), None)
    switched = next((f.name for f in filters if _by_five(f)), None)
    if fixed is None or switched is None:
        raise MissingEvidence((key,))
    over_run = [_over_run(evidence.curve(key, name, "r").since(5)) for name in (fixed, switched)]
    return ratio(over_run[0], over_run[1])


def _by_five(filter_keys: Filter) -> bool:
    detector = filter_keys.detector
    if detector is None or filter_keys.response == "shorten_memory" or (filter_keys.end_after or 1) != 1:
        return False
    return (
        detector.plots == 5
        and detector.false_alarm_probability == USUAL_FALSE_ALARM_RATE
        and detector.coordinates == "each"
    )


def _over_run(curve: Curve) -> Estimate:
    """Root of the mean square of a curve; scans of one realisation go together, so ends are taken all at once."""
    return Estimate(*(float(np.sqrt(np.mean(np.square(part)))) for part in (curve.value, curve.lo, curve.hi)))
