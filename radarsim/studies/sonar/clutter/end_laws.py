"""Laws that lead to an end of the target's track, prepared for the kernels.

A track ends after misses in a row, or because of what such a run causes: its gate grows, a false plot falls into it,
its velocity carries it away. So there is a law for each of some lengths of a run, under which a run of that length
comes in the scans that are left. Were misses independent, with the probability p of a plot that is missed or outside
the gate, the probability V(i, k) that it comes, with i misses in a row before scan k, would be known by recursion, and
drawing a miss with the probability h = p V(i + 1, k + 1) / V(i, k) would give all tracks with such a run the same
weight, 1 / V: Doob's transform, of no variance (Juneja and Shahabuddin 2006, Handbooks in Operations Research and
Management Science 13, 291). Here misses are nearly independent, and the law is as near to that one.

A young track may also be wrong from its first plots on: because of their errors, so that the next plots are outside its
gate one after the other, or because one of them is false. So there is a law for the track of each number of plots from
its confirmation on, under which the errors that lead there are stretched, and two under which a false plot is in its
gate, beside the target's or in place of it."""

from collections.abc import Sequence

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.rare_event_keys import PLAIN_SHARE
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.kernels.rare_end_laws import EndLaws
from radarsim.studies.sonar.clutter.tracker_design import Conditions, TrackerSpec, gate_threshold

MAX_RUN_LENGTHS = 6
LATE_PLOTS = 3  # number of plots after the confirmation whose errors may still lead a track astray
FALSE_PLOT_LAWS = 2  # a false plot beside the target's, and one in place of it
PLOTS_OUTSIDE = 3  # plots in a row that then leave the gate: more follow by themselves
MAX_RUN = 20  # misses in a row: a track that survives more is dropped, or far off, before


def run_lengths(misses: int) -> np.ndarray:
    """Lengths (R,) of the runs of misses that have a law: evenly from one miss to those that drop a track."""
    longest = min(misses, MAX_RUN)
    return np.unique(np.round(np.linspace(1, longest, min(longest, MAX_RUN_LENGTHS)))).astype(np.int64)


def run_probabilities(miss: np.ndarray, length: int) -> np.ndarray:
    """Probability (length + 1, K + 1) that a run of `length` misses comes from scan k on, after i misses in a row.

    miss (K,): the probability of a miss at each scan."""
    out = np.zeros((length + 1, len(miss) + 1))
    out[length] = 1.0
    for k in range(len(miss) - 1, -1, -1):
        out[:length, k] = miss[k] * out[1:, k + 1] + (1.0 - miss[k]) * out[0, k + 1]
    return out


def undetected_probabilities(probability: np.ndarray, inside: float, length: int) -> np.ndarray:
    """Probability (length, K), as drawn, that the target is not detected at scan k after i misses in a row.

    probability (K,) of detection as it is; inside: probability that the gate contains a plot. A miss has probability h
    if the target is not detected with probability 1 - (1 - h) / inside, since plots outside the gate are misses too.
    Where detection is certain, or not possible, nothing is shifted."""
    p = 1.0 - probability * inside
    run_probability = run_probabilities(p, length)
    missed, hit = p * run_probability[1:, 1:], (1.0 - p) * run_probability[0, 1:]
    with np.errstate(invalid="ignore"):
        hit_share = np.where(missed + hit > 0.0, hit / (missed + hit), 1.0 - p)
    shifted = np.clip(1.0 - hit_share / inside, 1.0 - probability, 1.0)
    return np.where((probability > 0.0) & (probability < 1.0), shifted, 1.0 - probability)


def error_directions(t: np.ndarray, min_plots: int) -> np.ndarray:
    """The shortest errors (1 + LATE_PLOTS, J) of J plots at t (J,), s, that bring PLOTS_OUTSIDE plots out of the gate.

    The gate is that of a track after `min_plots` and more plots, a line fitted to them by least squares, as a track
    without manoeuvres begins. The innovations of the next plots are rows A of the errors, each with its own variance
    S = |A|²; all of them are √S at the errors Aᵀ(A Aᵀ)⁻¹√S, the shortest such errors, in units of the root of a gate.
    Zero where there are too few plots."""
    out = np.zeros((1 + LATE_PLOTS, len(t)))
    for row, j in zip(out, range(min_plots, len(t) - PLOTS_OUTSIDE + 1), strict=False):
        A = np.zeros((PLOTS_OUTSIDE, len(t)))
        for h in range(PLOTS_OUTSIDE):
            line = np.stack([np.ones(j), t[:j] - t[j + h]])
            A[h, :j], A[h, j + h] = -np.linalg.solve(line @ line.T, line)[0], 1.0
        row[:] = A.T @ np.linalg.solve(A @ A.T, np.linalg.norm(A, axis=1))
    return out


def stretch_factors(gate: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Factors s (F, n) that stretch errors along directions of radius (F, n), for gates (F, 1), χ² of two components.

    s² is half the smallest square with which plots leave the gate: best for the tail of a Gaussian of two components.
    """
    return np.sqrt(np.maximum(gate * radius**2 / 2.0, 2.0))


def family_shares(plain: float, sizes: Sequence[int]) -> np.ndarray:
    """Shares (1 + laws,) of the law itself and of the laws in families of these sizes; families have equal shares."""
    family_share = (1.0 - plain) / max(sum(size > 0 for size in sizes), 1)
    return np.concatenate([[plain], *(np.full(size, family_share / size) for size in sizes if size)])


def end_laws(case: Case, specs: Sequence[TrackerSpec], conditions: Conditions, labels: ClutterAxes) -> EndLaws:
    """The laws from which the target's track of each tracker is drawn."""
    certain, t, F, K = labels.detections.certain, np.asarray(labels.t_s, dtype=float), len(specs), len(labels.k)
    probability = np.where(certain < 0, labels.detections.probability, certain)
    runs = [run_lengths(tracker_spec.misses) for tracker_spec in specs]
    scans = [np.flatnonzero(certain != 0)[: tracker_spec.m + LATE_PLOTS + PLOTS_OUTSIDE] for tracker_spec in specs]
    max_runs, longest, J = max(map(len, runs)), max(int(run[-1]) for run in runs), max(map(len, scans))
    length, young = np.zeros((F, max_runs), dtype=np.int64), np.full((F, J), -1, dtype=np.int64)
    shares, shifted = np.zeros((F, 1 + max_runs + 1 + LATE_PLOTS + FALSE_PLOT_LAWS)), np.ones((F, max_runs, longest, K))
    direction, radius = np.zeros((F, 1 + LATE_PLOTS, J)), np.zeros((F, 1 + LATE_PLOTS))
    for f, (tracker_spec, run, scan_indices) in enumerate(zip(specs, runs, scans, strict=True)):
        length[f, : len(run)], young[f, : len(scan_indices)] = run, scan_indices
        direction[f, :, : len(scan_indices)] = error_directions(t[scan_indices], tracker_spec.m)
        radius[f] = np.linalg.norm(direction[f], axis=1)
        far_laws = (
            np.flatnonzero(radius[f] > 0.0) if tracker_spec.gate_probability < 1.0 else np.empty(0, dtype=np.int64)
        )
        tracker_shares = family_shares(
            PLAIN_SHARE, (len(run), len(far_laws), FALSE_PLOT_LAWS * (conditions.density > 0.0))
        )
        law_indices = [
            0,
            *range(1, 1 + len(run)),
            *(1 + max_runs + far_laws),
            *(range(-FALSE_PLOT_LAWS, 0) if conditions.density > 0.0 else []),
        ]
        shares[f, law_indices] = tracker_shares
        for j, run_length in enumerate(run):
            shifted[f, j, :run_length] = undetected_probabilities(
                probability, tracker_spec.gate_probability, int(run_length)
            )
    gates = np.array([[gate_threshold(tracker_spec.gate_probability)] for tracker_spec in specs])
    return EndLaws(
        choice=noise_key(case, "rare ends"),
        plots=noise_key(case, "rare plots about the target"),
        shares=shares,
        length=length,
        undetected=shifted,
        young=young,
        direction=direction / np.maximum(radius, 1e-300)[..., None],
        stretch=stretch_factors(gates, radius),
    )
