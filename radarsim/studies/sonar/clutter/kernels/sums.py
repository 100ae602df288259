"""Sums over a chunk of tracks: errors, scores, ratios of two numbers of each realisation, and weights.

Letters as in `sonar.kernels.sums`; f numbers trackers, c the lines in range and bearing, k scans.
"""

from radarsim.kernels.compile import inline, part
from radarsim.studies.sonar.kernels.sums import add_sums, rows_of


@part
def add_scores(thresholds, n, first, best, scores):
    """Add to scores (T + 1,) the number of first tracks whose score reached each threshold, and that of first tracks.

    first (CHUNK,) is negative where a realisation had no track; best (CHUNK,) is the greatest score of its first track.
    """
    for i in range(n):
        if first[i] >= 0.0:
            scores[thresholds.size] += 1.0
            for t in range(thresholds.size):
                scores[t] += best[i] >= thresholds[t]


@part
def add_ratio(a, b, n, ratio):
    """Add Σa, Σa², Σb, Σb², Σab over n realisations to ratio (5,)."""
    for i in range(n):
        ratio[0] += a[i]
        ratio[1] += a[i] * a[i]
        ratio[2] += b[i]
        ratio[3] += b[i] * b[i]
        ratio[4] += a[i] * b[i]


@part
def add_errors(trackers, tracks, f, k, course, kept, used, out, sums):
    """Add the errors of the tracks kept of tracker f at scan k, in range and in bearing; out (7,) is scratch."""
    size = tracks.x.shape[0]  # two; were it a constant, the compiler would unroll the loop and compile everything twice
    for c in range(size):
        rows, units = rows_of(tracks.x[c], course, c, kept, used), (trackers.sigma[c], trackers.period)
        add_sums(rows, tracks.P[c], size, tracks.x[c], 0, units, (f, k, c), out, sums)


@inline
def add_weight(w, sums, j):
    """Add an event of weight w to row j of sums (n, 4): Σw, Σw², number and Σw⁴."""
    sums[j, 0] += w
    sums[j, 1] += w * w
    sums[j, 2] += 1.0
    sums[j, 3] += w**4


@inline
def add_drawn(w, plain, drawn):
    """Add a realisation of weight w, drawn as it is or not, to drawn (3,): number of plain ones, Σw and Σw²."""
    drawn[0] += plain
    drawn[1] += w
    drawn[2] += w * w
