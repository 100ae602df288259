"""All tracks of a tracker over the plots of many scans."""

import numpy as np
import pytest

from radarsim.studies.sonar.clutter import multi_tracker, tracker_design
from radarsim.studies.sonar.clutter.kernels.gate import OPEN_GATE
from tests.studies.sonar.precision import LINE, TERMS
from tests.tolerances import Z, assert_rounded

SIGMA, T = np.array([30.0, 0.0175]), 5.0


def choice(association="nearest", gate=0.99, m=3, n=4, misses=3):
    return tracker_design.TrackerSpec(association, gate, m, n, misses, 10.0, 10.0, np.array([1e-4, 1e-12]))


def charted(of, scans, density=0.0, detection=0.9):
    return multi_tracker.confirmed_tracks(of, tracker_design.Conditions(T, SIGMA, detection, density), scans)


def course(r, b, scans, seed, missed=()):
    """Plots of a target that stands still, one a scan."""
    rng = np.random.default_rng(seed)
    z = np.stack([r + SIGMA[0] * rng.normal(size=scans), b + SIGMA[1] * rng.normal(size=scans)], axis=1)
    return [(k * T, *(z[k : k + 1].T if k not in missed else np.zeros((2, 0)))) for k in range(scans)]


def together(*courses):
    return [(one[0][0], *(np.concatenate([c[j] for c in one]) for j in (1, 2))) for one in zip(*courses, strict=True)]


@pytest.mark.parametrize("association", ["nearest", "pda"])
def test_each_target_gets_a_track(association):
    scans = together(course(9e3, 0.3, 20, 1, missed=(7, 8)), course(6e3, 0.9, 20, 2))
    lives = charted(choice(association), scans, 1e-9)
    assert len(lives) == 2
    ends = sorted((life.states[-1][0], life.states[-1][2]) for life in lives)
    assert (np.abs(np.subtract(ends, [(6e3, 0.9), (9e3, 0.3)])) < Z * SIGMA).all()  # of a plot
    assert all(life.scans == list(range(20)) for life in lives)
    assert all(life.scores[-1] > 30 for life in lives)


def test_m_plots_confirm_and_misses_drop():
    two = course(9e3, 0.3, 6, 1, missed=(2, 3, 4, 5))
    assert charted(choice(), two) == []
    three = course(9e3, 0.3, 12, 1, missed=(2, *range(4, 12)))
    (life,) = charted(choice(), three)
    assert life.scans == list(range(7))[: life.scans[-1] + 1]
    assert life.scans[-1] == 6  # plots at 0, 1, 3; misses at 4, 5, 6


def test_a_plot_goes_to_one_track_and_the_rest_begin_others():
    scans = together(course(9e3, 0.3, 8, 1), course(9e3, 0.3, 8, 2))
    lives = charted(choice(gate=0.9999), scans, 1e-9)
    assert len(lives) == 2  # two targets at one place: every plot is used once
    assert sum(len(life.scans) for life in lives) == 16


def test_bearings_may_jump_by_a_turn():
    scans = course(9e3, np.pi, 10, 3)
    turned = [(t, r, np.mod(b + np.pi, 2 * np.pi) - np.pi) for t, r, b in scans]
    assert any((b < 0).any() for _, _, b in turned)
    (life,) = charted(choice(), turned)
    (other,) = charted(choice(), scans)
    turn = life.states[-1][2] - other.states[-1][2]
    assert_rounded(turn, 2 * np.pi * np.round(turn / (2 * np.pi)), 2 * np.pi, LINE, operations=10 * TERMS)


def test_more_tracks_than_a_chunk_holds():
    rng = np.random.default_rng(4)
    r, b = rng.uniform(2e3, 2e5, 700), rng.uniform(-3, 3, 700)
    scans = [(k * T, r, b) for k in range(4)]
    assert len(charted(choice(), scans)) == 700


def test_gate_thresholds_and_poisson_distribution():
    assert_rounded(tracker_design.gate_threshold(0.99), -2 * np.log(0.01), condition=100)  # of 1 − 0.99
    assert tracker_design.gate_threshold(1.0) == OPEN_GATE
    from scipy import stats

    for mean in (0.0, 0.01, 1.5, 40.0):
        share = tracker_design.poisson_cdf(mean)
        assert_rounded(share, stats.poisson.cdf(np.arange(share.size), mean), condition=1 + mean, operations=10)
        assert share[-1] == 1.0
