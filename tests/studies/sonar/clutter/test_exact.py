"""Exact laws of initiation against enumeration and against plain integration."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from radarsim.studies.sonar.clutter import initiation, tracker_design
from tests.tolerances import assert_rounded


def enumerated(chance, m, n):
    """Probability of a confirmed track by each scan: all patterns of plots, the rules applied to each."""
    out = np.zeros(len(chance))
    for pattern in itertools.product((0, 1), repeat=len(chance)):
        weight = np.prod([p if seen else 1 - p for p, seen in zip(chance, pattern, strict=True)])
        age = hits = 0
        for k, seen in enumerate(pattern):
            if age == 0:
                age, hits = seen, seen
                continue
            age, hits = age + 1, hits + seen
            if hits >= m:
                out[k:] += weight
                break
            if hits + n - age < m:
                age = hits = 0
    return out


@pytest.mark.parametrize(("m", "n"), [(2, 2), (2, 3), (3, 4), (3, 5), (4, 5), (3, 3)])
def test_m_of_n_is_the_sum_over_all_patterns(m, n):
    chance = np.array([0.8, 0.7, 0.0, 1.0, 0.6, 0.9, 0.5, 0.8, 0.8, 0.3])
    wanted = enumerated(chance, m, n)
    assert_rounded(
        initiation.confirmation_probabilities(chance, m, n), wanted, operations=2**10 + 10
    )  # patterns, and a product of each


def test_pairs_of_false_plots_far_from_any_edge():
    """The mean number in a gate that no edge cuts is density · r · π γ √|S|, and the chance follows.

    The two edges in range cut a segment off the ellipses about seeds that lie within a half-axis of one.
    """
    sigma, rule = np.array([30.0, 0.0175]), SimpleNamespace(n=3, speed=10.0, gate_probability=0.99)
    near, far = 9000.0, 9000.001
    ring = SimpleNamespace(range_m=(near - 2e3, far + 2e3), bearing_rad=(-np.pi, np.pi))
    found = initiation.false_pair_probabilities(ring, tracker_design.Conditions(5.0, sigma, 0.9, 1e-6), rule, 10)
    r = np.sqrt(np.linspace((near - 2e3) ** 2, (far + 2e3) ** 2, 20_001))  # evenly in area
    gate, none, wanted = -2 * np.log(0.01), 1.0, []
    for k in (1, 2):
        S = (2 * sigma[0] ** 2 + (50.0 * k) ** 2) * (2 * sigma[1] ** 2 + (50.0 * k / r) ** 2)
        half = np.sqrt(gate * (2 * sigma[0] ** 2 + (50.0 * k) ** 2))
        d = np.minimum(np.minimum(r - r[0], r[-1] - r) / half, 1.0)
        cut = (np.arccos(d) - d * np.sqrt(1 - d**2)) / np.pi
        mean = 1e-6 * r * np.pi * gate * np.sqrt(S) * (1 - cut)
        wanted.append(float(np.mean(none * -np.expm1(-mean))))
        none = none * np.exp(-mean)
    # A segment is at another range than its seed, by a half-axis at most; a rule of 48 nodes meets the edge of cuts.
    assert found[1:3] == pytest.approx(wanted, rel=cut.mean() * half / r[0] + 48.0**-2)
    assert found[0] == 0
    assert (found[3:] == 0).all()
