"""Sums over a chunk of tracks: errors, scores, and ratios of two numbers of each realisation.

Letters as in `sonar.kernels.sums`; f numbers trackers, c the lines in range and bearing, k scans.
"""

from radarsim.kernels.compile import part
from radarsim.studies.sonar.kernels.sums import Course, Estimate, add_sums, ahead_sums


@part
def add_scores(thresholds, n, first, best, scores):
    """How many first tracks' scores reached each threshold, and how many first tracks there were: scores (T + 1,).

    first (CHUNK,) is negative where a realisation had no track, best (CHUNK,) the greatest score of its first.
    """
    for i in range(n):
        if first[i] >= 0.0:
            scores[thresholds.size] += 1.0
            for t in range(thresholds.size):
                scores[t] += best[i] >= thresholds[t]


@part
def add_ratio(a, b, n, ratio):
    """Σa, Σa², Σb, Σb², Σab over n realisations."""
    for i in range(n):
        one, other = a[i], b[i]
        ratio[0] += one
        ratio[1] += one * one
        ratio[2] += other
        ratio[3] += other * other
        ratio[4] += one * other


@part
def add_errors(trackers, tracks, f, k, course, counted, out, sums):
    """Add the errors of the tracks kept of tracker f at scan k, in range and in bearing; out (7,) is scratch."""
    size = tracks.x.shape[0]  # two, but as a number known to the compiler all that is inlined would be compiled twice
    for c in range(size):
        estimate = Estimate(tracks.x[c], tracks.P[c], size, tracks.x[c], 0)
        units = (trackers.sigma[c], trackers.period)
        add_sums(estimate, Course(course.truth[c], course.shift[c]), counted, units, (f, k, c), out, sums)


@part
def add_ahead(tracks, f, k, dt, course, counted, out, sums):
    """Add the errors of tracker f at scan k of what was extrapolated from scan k - 1."""
    size = tracks.x.shape[0]
    for c in range(size):
        ahead_sums(tracks.x[c], size, Course(course.truth[c], course.shift[c]), counted, dt, out)
        for power in range(4):
            sums.ahead[f, k - 1, c, power] += out[power]
