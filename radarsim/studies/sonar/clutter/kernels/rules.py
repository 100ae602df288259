"""The life of a track: confirmed by m plots in its first n scans, dropped after misses, lost too far from the target.

Letters as in `tracker`; i numbers the realisations of a chunk.
"""

from radarsim.kernels.compile import inline, kernel, part
from radarsim.studies.sonar.clutter.kernels import counts as at

NONE, TENTATIVE, CONFIRMED = range(3)
# Rows of a track's status: state, scans since its first plot, plots taken, misses in a row, time since the last plot,
# score and its greatest value so far, whether it is the realisation's first track, whether one was confirmed before;
# then sums over the realisation: ends of confirmed tracks, scans with one, weight of false plots taken, plots taken.
ROWS = 13
STATE, AGE, HITS, MISSES, SINCE, SCORE, BEST, FIRST, BEFORE, ENDS, HELD, WRONG, TAKEN = range(ROWS)


@kernel
def next_state(state, hits, misses, age, m, n, most):
    """State of a track after a scan, by the rule m of n and that of misses."""
    if state == TENTATIVE:
        if hits >= m:
            return CONFIRMED
        return TENTATIVE if hits + (n - age) >= m else NONE
    return NONE if misses >= most else CONFIRMED


@part
def judge_known(tracks, status, n, kept, counts):
    """Tracks of a filter that knows the target's plots are kept from their second plot on; arguments as of `judge`."""
    plots = tracks.plots
    for i in range(n):
        kept[i] = 0.0
        if status[STATE, i] == NONE:
            continue
        kept[i] = 2.0 if plots[i] > 1.5 else 0.0
        status[STATE, i] = CONFIRMED if kept[i] > 0.0 else TENTATIVE
        counts[at.KEPT] += kept[i] > 0.0
        status[HELD, i] += kept[i] > 0.0


@inline
def off_target(tracks, course, limit, i):
    """Whether the track of realisation i is further from the target than limit (r, b), in m and rad."""
    x, truth, shift = tracks.x, course.truth, course.shift
    off = abs(x[0, 0, i] - truth[0, 0] - shift[0, 0, i]) > limit[0]
    return off | (abs(x[1, 0, i] - truth[1, 0] - shift[1, 0, i]) > limit[1])


@part
def judge(trackers, f, n, tracks, status, course, kept, counts):
    """Apply the rules to the target's track in n realisations after a scan; kept (CHUNK,) is 2 where there is one.

    A confirmed track ends when it is dropped, either for misses or because its position has become too uncertain, or
    when it is lost: too far from the target.
    """
    limit, m, of, misses = trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, beyond = tracks.P, (limit * trackers.sigma[0], limit * trackers.sigma[1])
    for i in range(n):
        state = status[STATE, i]
        kept[i] = 0.0
        if state == NONE:
            continue
        now = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, of, misses)
        if now == CONFIRMED:
            off = off_target(tracks, course, beyond, i)
            uncertain = max(P[0, 0, i], P[1, 0, i]) > limit * limit
            if state == CONFIRMED and (off or uncertain):
                counts[at.LOST if off else at.DROPPED] += 1.0
                now = NONE
            elif off:  # confirmed on other plots than the target's
                counts[at.FAILED] += 1.0
                now = NONE
        elif now == NONE:
            counts[at.DROPPED if state == CONFIRMED else at.FAILED] += 1.0
        if now == CONFIRMED:
            kept[i] = 2.0
            counts[at.KEPT] += 1.0
            status[HELD, i] += 1.0
            counts[at.FOUND] += status[BEFORE, i] == 0.0
            status[BEFORE, i] = 1.0
        elif now == TENTATIVE:
            counts[at.TRYING] += 1.0
        elif state == CONFIRMED:
            status[ENDS, i] += 1.0
        if now == NONE:
            status[FIRST, i] = 0.0
        status[STATE, i] = now


@part
def judge_false(trackers, f, n, tracks, status, begun):
    """Apply the rules to every track that a false plot began; returns whether any is left."""
    limit, m, of, misses = trackers.lost[f] * trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, left = tracks.P, False
    for i in range(n):
        state = status[STATE, i]
        if state == NONE:
            continue
        now = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, of, misses)
        if state == CONFIRMED and max(P[0, 0, i], P[1, 0, i]) > limit:
            now = NONE
        begun[at.FALSE_TRYING] += now == TENTATIVE
        begun[at.FALSE_KEPT] += now == CONFIRMED
        begun[at.FALSE_FOUND] += now == CONFIRMED and state == TENTATIVE
        status[STATE, i] = now
        left |= now != NONE
    return left
