"""The life of a track: confirmed by m plots in its first n scans, dropped after misses, lost too far from the target.

i numbers the realisations of a chunk."""

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.studies.sonar.clutter.kernels.track_sums import (
    CONFIRMED_COUNT,
    DROPPED_COUNT,
    FALSE_CONFIRMED,
    FALSE_NEWLY_CONFIRMED,
    FALSE_TENTATIVE,
    FIRST_CONFIRMED_COUNT,
    LOST_COUNT,
    TENTATIVE_COUNT,
    TENTATIVE_DROPPED_COUNT,
)

NONE, TENTATIVE, CONFIRMED = range(3)
# Rows of a track's status: state, scans since its first plot, plots taken, misses in a row, time since the last plot,
# score and its greatest value so far, whether it is the realisation's first track, whether one was confirmed before;
# then sums over the realisation: ends of confirmed tracks, scans with one, weight of false plots taken, plots taken.
ROWS = 13
(
    STATE,
    AGE,
    HITS,
    MISSES,
    TIME_SINCE_PLOT,
    SCORE,
    BEST,
    FIRST,
    CONFIRMED_BEFORE,
    ENDS,
    CONFIRMED_SCANS,
    FALSE_WEIGHT,
    PLOTS_TAKEN,
) = range(ROWS)


@kernel
def next_state(state, hits, misses, age, m, n, max_misses):
    """The state of a track after a scan, by the rule m of n and the rule on misses."""
    if state == TENTATIVE:
        if hits >= m:
            return CONFIRMED
        return TENTATIVE if hits + (n - age) >= m else NONE
    return NONE if misses >= max_misses else CONFIRMED


@kernel_part
def judge_known_association(tracks, status, n, plot_counts, counts):
    """Confirm tracks of a filter with known association at their second plot; arguments as in `judge_target_track`."""
    plots = tracks.plots
    for i in range(n):
        plot_counts[i] = 0.0
        if status[STATE, i] == NONE:
            continue
        plot_counts[i] = 2.0 if plots[i] > 1.5 else 0.0
        status[STATE, i] = CONFIRMED if plot_counts[i] > 0.0 else TENTATIVE
        counts[CONFIRMED_COUNT] += plot_counts[i] > 0.0
        status[CONFIRMED_SCANS, i] += plot_counts[i] > 0.0


@inline
def is_off_target(tracks, course, limit, i):
    """Whether the track of realisation i is farther from the target than limit (r, b), in m and rad."""
    x, truth, shift = tracks.x, course.truth, course.shift
    off = abs(x[0, 0, i] - truth[0, 0] - shift[0, 0, i]) > limit[0]
    return off | (abs(x[1, 0, i] - truth[1, 0] - shift[1, 0, i]) > limit[1])


@kernel_part
def judge_target_track(trackers, f, n, tracks, status, course, plot_counts, counts):
    """Apply the rules to the target's track in n realisations after a scan.

    plot_counts (CHUNK,) becomes 2 where there is a confirmed track, else 0. A confirmed track ends when it is dropped,
    either for misses or because its position has become too uncertain, or when it is lost: too far from the target."""
    limit, m, rule_scans, misses = trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, lost_error = tracks.P, (limit * trackers.sigma[0], limit * trackers.sigma[1])
    for i in range(n):
        state = status[STATE, i]
        plot_counts[i] = 0.0
        if state == NONE:
            continue
        new_state = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, rule_scans, misses)
        if new_state == CONFIRMED:
            is_lost = is_off_target(tracks, course, lost_error, i)
            uncertain = max(P[0, 0, i], P[1, 0, i]) > limit * limit
            if state == CONFIRMED and (is_lost or uncertain):
                counts[LOST_COUNT if is_lost else DROPPED_COUNT] += 1.0
                new_state = NONE
            elif is_lost:  # confirmed on other plots than the target's
                counts[TENTATIVE_DROPPED_COUNT] += 1.0
                new_state = NONE
        elif new_state == NONE:
            counts[DROPPED_COUNT if state == CONFIRMED else TENTATIVE_DROPPED_COUNT] += 1.0
        if new_state == CONFIRMED:
            plot_counts[i] = 2.0
            counts[CONFIRMED_COUNT] += 1.0
            status[CONFIRMED_SCANS, i] += 1.0
            counts[FIRST_CONFIRMED_COUNT] += status[CONFIRMED_BEFORE, i] == 0.0
            status[CONFIRMED_BEFORE, i] = 1.0
        elif new_state == TENTATIVE:
            counts[TENTATIVE_COUNT] += 1.0
        elif state == CONFIRMED:
            status[ENDS, i] += 1.0
        if new_state == NONE:
            status[FIRST, i] = 0.0
        status[STATE, i] = new_state


@kernel_part
def judge_false_tracks(trackers, f, n, tracks, status, begun):
    """Apply the rules to every track that a false plot began; return whether any is alive."""
    limit, m, rule_scans, misses = trackers.lost[f] * trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, any_alive = tracks.P, False
    for i in range(n):
        state = status[STATE, i]
        if state == NONE:
            continue
        new_state = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, rule_scans, misses)
        if state == CONFIRMED and max(P[0, 0, i], P[1, 0, i]) > limit:
            new_state = NONE
        begun[FALSE_TENTATIVE] += new_state == TENTATIVE
        begun[FALSE_CONFIRMED] += new_state == CONFIRMED
        begun[FALSE_NEWLY_CONFIRMED] += new_state == CONFIRMED and state == TENTATIVE
        status[STATE, i] = new_state
        any_alive |= new_state != NONE
    return any_alive
