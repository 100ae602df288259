"""Tables of detectors of manoeuvres, of filters that respond to them, and of quantities derived from a track (P3).

The `filter` of a detector's row is the detector; `component` may be `joint`, too.

plots: number of plots in the detector's window
threshold_k: its threshold k
false_alarm_probability: of the threshold, by the χ² law"""

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency_tables, interval_notes, statistics
from radarsim.report import tables as common
from radarsim.report.tables import Columns, label_columns
from radarsim.studies.sonar.closed_forms import sigma_acceleration
from radarsim.studies.sonar.manoeuvre import detection_laws
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from radarsim.studies.sonar.manoeuvre.track_uses import QUANTITIES
from radarsim.studies.sonar.tables import Index

table = common.TableMakers()
PHASES = np.array(["steady", "manoeuvre", "after"], dtype=object)
EVENTS = np.array(["false alarm", "alarm", "all clear"], dtype=object)  # the first of a phase
JOINT = "joint"
NEAR_ZERO_VERDICT = "fails: near zero"
MAX_SIGMAS_NEAR_ZERO = 3.0  # nearer to zero the errors of speeds and distances, never negative, are not of first order


def has_detectors(result: CaseResult[ManoeuvreAxes]) -> bool:
    """Whether a case has detectors."""
    return bool(result.spec.detectors)


def group_names(result: CaseResult[ManoeuvreAxes]) -> list[str]:
    """Names of the groups: each coordinate, then all of them jointly."""
    return [*(name for name, _ in result.axes.coordinates), JOINT]


def _test_rows(result: CaseResult[ManoeuvreAxes]) -> tuple[Index, dict[str, np.ndarray]]:
    """Indices (detector, group, threshold, scan), each (n,), of all tests, in this order, and their first columns."""
    tested = np.asarray(result.sums["tested"])
    count = np.array([limits.shape[1] for limits in result.axes.thresholds])
    is_threshold = np.arange(result.sums["alarms"].shape[2]) < count[:, None]
    d, g, t, k = np.nonzero((tested[:, :, None] > 0) & is_threshold[:, None, :, None])
    return (d, g, t, k), _threshold_columns(result, d, g, t) | {
        "k": np.asarray(result.axes.k)[k],
        "t_s": np.asarray(result.axes.t_s, dtype=float)[k],
    }


def _threshold_columns(
    result: CaseResult[ManoeuvreAxes], d: np.ndarray, g: np.ndarray, t: np.ndarray, **labels: np.ndarray
) -> dict[str, np.ndarray]:
    """The first columns of thresholds t of detectors d in groups g, each (n,); `filter` is the detector.

    false_alarm_probability is that of the exact law; labels are further columns after the component."""
    thresholds = result.axes.thresholds
    k = np.array([thresholds[i][j, m] for i, j, m in zip(d, g, t, strict=True)])
    freedom = np.where(g == len(group_names(result)) - 1, len(group_names(result)) - 1, 1)
    return {
        "case": np.full(d.size, result.name, dtype=object),
        "filter": common.pick_names([detector.name for detector in result.spec.detectors], d),
        "component": common.pick_names(group_names(result), g),
        **labels,
        "plots": np.array([detector.plots for detector in result.spec.detectors], dtype=np.int64)[d],
        "threshold_k": k,
        "false_alarm_probability": detection_laws.false_alarm(k, freedom),
    }


@table("detections", has_detectors)
def _detections(result: CaseResult[ManoeuvreAxes]) -> Columns:
    """Alarms of each detector, at each of n tests.

    phase: which the test falls in: steady, manoeuvre, after
    shift: mean of the estimated acceleration in its own σ
    probability ±: of an alarm
    """
    axes = result.axes
    index, columns = _test_rows(result)
    d, g, _, k = index
    n = np.asarray(result.sums["tested"])[d, g, k]
    rates = statistics.rate(np.asarray(result.sums["alarms"])[index], n)
    return columns | {
        "n": n.astype(np.int64),
        "phase": PHASES[axes.phase[k]],
        "shift": axes.shifts[d, g, k],
        "probability": rates,
        "exact_probability": axes.exact_alarms[index],
    }


@table("delays", has_detectors)
def _delays(result: CaseResult[ManoeuvreAxes]) -> Columns:
    """How soon the first event of a phase comes.

    event: false alarm, alarm, or end of alarms (all clear)
    delay_s: time since the phase began
    probability ±: that the event has come by then; exact where tests are independent: overlapping windows have no law
    independent_probability: what independent tests would give
    """
    axes, K = result.axes, len(result.axes.k)
    index, columns = _test_rows(result)
    d, k = index[0], index[3]
    phase, since = axes.phase, phase_starts(result)
    p = np.where(phase == 2, 1 - axes.exact_alarms, axes.exact_alarms)
    first = np.asarray(result.sums["first"])
    reached, law = np.zeros(first.shape), np.full(first.shape, np.nan)
    for phase_number in range(3):
        scans = np.arange(K)[phase == phase_number]
        reached[..., scans] = np.cumsum(first[..., scans], axis=-1)
        law[..., scans] = detection_laws.probability_by_then(np.nan_to_num(p[..., scans]))
    # If the law of any test of the phase is unknown, so is that of the first event.
    unknown = np.isnan(p) & (np.asarray(result.sums["tested"])[:, :, None] > 0)
    law[unknown.any(axis=-1)] = np.nan
    rates = statistics.rate(reached[index], result.count)
    return columns | {
        "n": np.full(d.size, result.count, dtype=np.int64),
        "event": EVENTS[phase[k]],
        "delay_s": columns["t_s"] - since[phase[k]],
        "probability": rates,
        "exact_probability": np.where(np.array(axes.independent)[d], law[index], np.nan),
        "independent_probability": law[index],
    }


def phase_starts(result: CaseResult[ManoeuvreAxes]) -> np.ndarray:
    """The start of each phase (3,), s from the first plot; NaN where there is none."""
    times = result.axes.manoeuvre_s or (np.nan, np.nan)
    return np.array([0.0, *times])


@table("classes", has_detectors)
def _classes(result: CaseResult[ManoeuvreAxes]) -> Columns:
    """Tracks classed by their alarms: called manoeuvring if there was one in a phase, of which k is the last scan.

    truth: the track's phase: steady, or manoeuvre
    duration_s: time since the phase began
    called_manoeuvring_share: tracks called so
    error_probability ±: that a steady track is called manoeuvring, or a manoeuvring one steady
    """
    delays = common.spread_estimates(_delays(result))
    last = np.concatenate([_last_rows(delays, event) for event in EVENTS[:2]])
    rows = {name: values[last] for name, values in delays.items()}
    steady = rows["event"] == EVENTS[0]
    wrong = np.where(steady, rows["probability"], 1 - rows["probability"])
    errors = statistics.rate(np.rint(wrong * rows["n"]), rows["n"])
    names = list(rows)
    return {name: rows[name] for name in names[: names.index("n") + 1]} | {
        "truth": PHASES[np.where(steady, 0, 1)],
        "duration_s": rows["delay_s"],
        "called_manoeuvring_share": rows["probability"],
        "error_probability": errors,
        "exact_error_probability": np.where(steady, rows["exact_probability"], 1 - rows["exact_probability"]),
    }


def _last_rows(rows: Columns, event: str) -> np.ndarray:
    """Indices of the last rows of an event, one for each detector, component and threshold, in order."""
    indices = np.flatnonzero(rows["event"] == event)
    keys = [tuple(rows[name][i] for name in ("filter", "component", "threshold_k")) for i in indices]
    return np.array(sorted(dict(zip(keys, indices, strict=True)).values()), dtype=np.int64)


@table("thresholds", has_detectors)
def _thresholds(result: CaseResult[ManoeuvreAxes]) -> Columns:
    """Thresholds of each detector with full windows, and the accelerations that they detect.

    no_alarm_probability: of a test without a manoeuvre
    sigma_acceleration [unit]: σ_a of a window's estimate
    threshold_acceleration [unit]: estimate from which there is an alarm
    threshold_to_plot_variance [1/s⁴]: k σ_a²/σ², the k of the paper, which is compared with the plot's variance
    acceleration_for_50_percent, acceleration_for_68_percent, acceleration_for_90_percent [unit]: detected so often
    """
    axes = result.axes
    indices = [
        (d, *group_and_threshold)
        for d, limits in enumerate(axes.thresholds)
        for group_and_threshold in np.ndindex(*limits.shape)
    ]
    d, g, t = np.array(indices, dtype=np.int64).T
    units = [f"{unit}/s2" for _, unit in axes.coordinates]
    columns = _threshold_columns(result, d, g, t, unit=common.pick_names([*units, ""], g))
    k, n, joint = columns["threshold_k"], columns["plots"], g == len(group_names(result)) - 1
    sigma = np.append(axes.sigma, np.nan)[g]
    per_sigma = np.where(joint, np.nan, sigma_acceleration(n.astype(float), axes.scan_period_s))
    reach = {
        f"acceleration_for_{percent}_percent": sigma
        * per_sigma
        * [detection_laws.shift_for(percent / 100, threshold) for threshold in k]
        for percent in (50, 68, 90)
    }
    return {
        **columns,
        "no_alarm_probability": 1 - columns["false_alarm_probability"],
        "sigma_acceleration": sigma * per_sigma,
        "threshold_acceleration": np.sqrt(k) * sigma * per_sigma,
        "threshold_to_plot_variance": k * per_sigma**2,
        **reach,
    }


@table("modes", lambda result: "modes" in result.sums)
def _modes(result: CaseResult[ManoeuvreAxes]) -> Columns:
    """What an adaptive filter or an IMM lives by, by scan.

    probability ±: of a manoeuvre: share of realisations in the manoeuvring mode, or mean of the second model's
    memory_plots: mean number of plots that an adaptive filter rests on
    """
    sums = np.asarray(result.sums["modes"])
    kinds = np.array([member.kind for member in result.spec.filters])
    responds = np.isin(kinds, ("adaptive", "imm"))
    f, c, k = np.nonzero(np.broadcast_to(responds[:, None, None], (len(kinds), sums.shape[2], sums.shape[1])))
    total, square, plots = np.moveaxis(sums[f, k, c], -1, 0)
    return {
        **label_columns(result, f, k, component=common.pick_names([name for name, _ in result.axes.coordinates], c)),
        "n": np.full(f.size, result.count, dtype=np.int64),
        "probability": statistics.probability(total, square, result.count),
        "memory_plots": np.where(kinds[f] == "adaptive", plots / result.count, np.nan),
    }


@table("uses", lambda result: "uses" in result.sums)
def _uses(result: CaseResult[ManoeuvreAxes]) -> Columns:
    """Course, speed, predicted position, closest approach: errors beside `believed_sigma` from the track's covariance.

    true_value [unit]: of the quantity that `component` names
    ratio ±: true over believed σ
    distance_in_sigma: distance of speed or closest approach from zero, which they cannot pass, in believed σ
    first_order: whether it holds: within three σ it fails, and with it that of course and time of closest approach
    """
    uses, sums = result.axes.uses, np.asarray(result.sums["uses"])
    if uses is None:
        return {}
    f, u, a = np.nonzero(np.moveaxis(sums[..., 0] > 0, 1, 2))
    n, first, square, fourth, spread = np.moveaxis(sums[f, a, u], -1, 0)
    rms = statistics.root_mean_square(square, fourth, n)
    distance = _distance(sums, uses.true, uses.closing_mps)[f, u, a]
    compared = consistency_tables.ratio_columns(rms, np.sqrt(spread / n))
    verdict = np.select(
        [distance < MAX_SIGMAS_NEAR_ZERO, compared["ratio_lo"] > 1.05, compared["ratio_hi"] < 0.95],
        [NEAR_ZERO_VERDICT, "error larger", "error smaller"],
        "holds within 5 %",
    )
    names, units = zip(*QUANTITIES, strict=True)
    return {
        **label_columns(
            result, f, uses.scans[a], component=common.pick_names(names, u), unit=common.pick_names(units, u)
        ),
        "n": n.astype(np.int64),
        "true_value": uses.true[a, u],
        "bias": first / n,
        **(compared | {"sigma": rms}),
        "distance_in_sigma": distance,
        "first_order": verdict.astype(object),
        "note": np.full(f.size, interval_notes.BELIEVED_VARIES, dtype=object),
    }


def _distance(sums: np.ndarray, true: np.ndarray, closing: np.ndarray) -> np.ndarray:
    """Distance from zero (F, U, A), in believed σ, of the value that each quantity depends on; infinite for positions.

    The closest approach depends on its distance and on the relative speed `closing` (A,), whose σ is that of the
    speed."""
    with np.errstate(invalid="ignore", divide="ignore"):
        believed = np.sqrt(sums[..., 4] / sums[..., 0])
        speed, relative = true[:, 1] / believed[..., 1], closing / believed[..., 1]
        cpa = true[:, 4] / believed[..., 4]
    far = np.full_like(speed, np.inf)
    return np.stack([speed, speed, far, far, np.minimum(cpa, relative), relative], axis=1)


tables = table.make
