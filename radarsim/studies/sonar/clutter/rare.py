"""How the target's track is drawn where it ends: laws under which runs of misses come, prepared for the kernels.

A track ends after misses in a row, or because of what such a run leads to: its gate grows, a false plot falls into it,
its velocity carries it away. So there is a law for each of some lengths of a run, under which a run of that length
comes in the scans that are left. Were misses independent, with the probability p of a plot that is missed or outside
the gate, the probability V(i, k) that it comes, with i misses in a row before scan k, would be known by recursion, and
to draw a miss with the probability h = p V(i + 1, k + 1) / V(i, k) would give all tracks with such a run the same
weight, 1 / V: Doob's transform, of no variance (Juneja and Shahabuddin 2006, Handbooks in Operations Research and
Management Science 13, 291). Here it is as near to that as misses are to being independent; weights make up for the rest.
"""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar.clutter.filters import TrackerSpec
from radarsim.studies.sonar.clutter.kernels.ends import Ends
from radarsim.studies.sonar.kernels.patterns import Detections

MOST_RUNS = 6
LONGEST = 20  # misses in a row that are drawn for: a track that needs more is dropped, or far off, before


def lengths(misses: int) -> np.ndarray:
    """Lengths of the runs that are drawn for: from one miss to those that drop a track, even, six at most."""
    longest = min(misses, LONGEST)
    return np.unique(np.round(np.linspace(1, longest, min(longest, MOST_RUNS)))).astype(np.int64)


def chances(miss: np.ndarray, length: int) -> np.ndarray:
    """Probability (length + 1, K + 1) that a run of so many misses comes from scan k on, with i in a row before it.

    miss (K,): the probability of a miss at each scan.
    """
    out = np.zeros((length + 1, len(miss) + 1))
    out[length] = 1.0
    for k in range(len(miss) - 1, -1, -1):
        out[:length, k] = miss[k] * out[1:, k + 1] + (1.0 - miss[k]) * out[0, k + 1]
    return out


def undetected(probability: np.ndarray, inside: float, length: int) -> np.ndarray:
    """Probability (length, K) that the target is not detected at scan k, with i misses in a row before it, as drawn.

    probability (K,) of detection as it is; inside: that the gate contains a plot. A miss is drawn with h if this is
    drawn with 1 - (1 - h) / inside, since plots outside the gate are misses too. Where detection is certain, or not
    possible, nothing is shifted.
    """
    p = 1.0 - probability * inside
    to_come = chances(p, length)
    missed, hit = p * to_come[1:, 1:], (1.0 - p) * to_come[0, 1:]
    with np.errstate(invalid="ignore"):
        hits = np.where(missed + hit > 0.0, hit / (missed + hit), 1.0 - p)
    drawn = np.clip(1.0 - hits / inside, 1.0 - probability, 1.0)
    return np.where((probability > 0.0) & (probability < 1.0), drawn, 1.0 - probability)


def ends(case: Case, specs: list[TrackerSpec], detections: Detections) -> Ends:
    """How the target's track of each tracker is drawn; its shares are equal but for the plain one's."""
    plain = case.spec.rare.plain_share
    probability = np.where(detections.certain < 0, detections.probability, detections.certain)
    runs = [lengths(one.misses) for one in specs]
    most, longest = max(map(len, runs)), max(run[-1] for run in runs)
    length, shares = np.zeros((len(specs), most), dtype=np.int64), np.zeros((len(specs), 1 + most))
    drawn = np.ones((len(specs), most, longest, len(probability)))
    for f, (one, run) in enumerate(zip(specs, runs, strict=True)):
        length[f, : len(run)] = run
        shares[f, 0], shares[f, 1 : 1 + len(run)] = plain, (1.0 - plain) / len(run)
        for j, each in enumerate(run):
            drawn[f, j, :each] = undetected(probability, one.gate_probability, int(each))
    return Ends(noise_key(case, "rare ends"), shares, length, drawn)
