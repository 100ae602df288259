"""The nearest loss of lock: against Gaussian bounds, naive normals, and every other direction around it."""

import math

import numpy as np
import pytest

from radarsim.bursts.kernels.scoring import SIZE
from radarsim.studies.discriminator import importance_sampling, nearest_loss
from tests.studies.discriminator.test_rare import RARELY, lone_window, plan_of
from tests.studies.discriminator.test_study import BASE
from tests.tolerances import rounding

HAND_OVERS = (3, 9, 13)  # of the windows of RARELY, of which there are 16


@pytest.fixture(scope="module")
def plan():
    return plan_of(RARELY)


@pytest.fixture(scope="module")
def room(plan):
    return nearest_loss.BurstWorkspace(plan)


@pytest.fixture(scope="module")
def found(plan, room):
    """The losses ahead and behind of some hand-overs, with the linear direction of each."""
    units = importance_sampling.directions(plan, 0)
    return {k: (units[k], tuple(nearest_loss.losses_on_both_sides(room, 0, units[k]))) for k in HAND_OVERS}


def distance(room, unit, low, high):
    """Where along a unit vector lock is first lost between two distances, to 10⁻⁶ σ, by halving."""
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if room.lost(0, middle * unit[None])[0] else (middle, high)
    return high


def test_gaussian_errors_pass_their_bounds_along_their_own_maps():
    """A lone window scored from the truth, with little noise: each component is lost at five bounds, on either side."""
    plan = lone_window(0.01)
    room, maps = nearest_loss.BurstWorkspace(plan), importance_sampling.window_error_maps(plan, 0).errors[0]
    for c, row in enumerate(maps):
        length = np.linalg.norm(row)
        for side, loss in zip((1, -1), nearest_loss.losses_on_both_sides(room, 0, row / length), strict=True):
            assert loss.unit @ row == pytest.approx(side * length, rel=1e-3)
            assert loss.distance == pytest.approx(5 * plan.potential[0, 0, c] / length, abs=1 / 64)


def test_a_turn_brings_every_loss_nearer(room, found):
    for unit, losses in found.values():
        assert len(losses) == 2
        for side, loss in zip((1, -1), losses, strict=True):
            assert (
                loss.distance
                < nearest_loss.distance_to_loss(room, 0, nearest_loss.round_unit(side * unit), 1.0, 12.0) - 0.05
            )
            assert room.lost(0, loss.distance * loss.unit[None]).all()
            assert not room.lost(0, (loss.distance - 1 / 128) * loss.unit[None]).any()


def test_bounds_of_a_component_are_nearer_than_its_linear_map_says(plan, room):
    """Of the phase at the end, on both sides by itself: more than first order is in an estimate at five σ."""
    unit = importance_sampling.directions(plan, 0)[-5]
    for side in (1, -1):
        straight = nearest_loss.distance_to_loss(room, 0, nearest_loss.round_unit(side * unit), 1.0, 12.0)
        assert straight == pytest.approx(5.06, abs=0.02)
        assert nearest_loss.nearest_loss(room, 0, side * unit).distance < straight - 0.08


def test_no_direction_around_loses_its_lock_sooner(room, found):
    """Of 64 directions a tenth of a radian away none is nearer by more than the search goes on for."""
    draw = np.random.default_rng(4)
    for _, (ahead, behind) in found.values():
        for loss in (ahead, behind):
            away = draw.standard_normal((64, len(loss.unit)))
            away *= np.abs(loss.unit) > 0  # in what its window sees
            away -= np.outer(away @ loss.unit, loss.unit)
            away = loss.unit + 0.1 * away / np.linalg.norm(away, axis=1, keepdims=True)
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            sooner = (loss.distance - 1 / 32) * away
            assert not any(room.lost(0, sooner[i : i + 8]).any() for i in range(0, 64, 8))


def test_the_normal_is_that_of_the_boundary(room, found):
    """How the distance changes as a direction turns, naively: by −s nᵀv/nᵀu towards v at right angles to u.

    At the linear directions, where the normal is not along them, and in what it says strongly: its own rest beside u.
    """
    for unit, _ in found.values():
        unit = nearest_loss.round_unit(unit)
        at = nearest_loss.distance_to_loss(room, 0, unit, 1.0, 12.0)
        n = nearest_loss.loss_boundary_normal(room, 0, unit, at)
        beside = n - (n @ unit) * unit
        beside /= np.linalg.norm(beside)
        small = 1e-3
        ends = [distance(room, unit + side * small * beside, at - 0.1, at + 0.1) for side in (-1, 1)]
        slope = (ends[1] - ends[0]) / (2 * small)
        assert slope == pytest.approx(-at * (n @ beside) / (n @ unit), rel=0.1)


def test_the_conjugate_burst_errs_the_other_way():
    """With complex samples exactly: imaginary parts and forecast turned, real parts as they are."""
    plan = plan_of(RARELY, burst=BASE["burst"] | {"samples": "complex"})
    room = nearest_loss.BurstWorkspace(plan)
    z = np.random.default_rng(2).standard_normal((8, SIZE + 4 * len(plan.world.factor)))
    other = np.array([nearest_loss.mirror_unit(one) for one in z])
    one, two = room.errors(0, z), room.errors(0, other)
    # Where they lock: elsewhere the end of a search is not defined by the arithmetic.
    locked = (np.abs(one) < 5 * plan.potential[0])[..., :5].all(axis=(1, 2))
    assert locked.sum() > 3
    tolerance = plan.options[0]["tolerance"]  # scoring ends at a step of so many σ, squared by the next
    assert (np.abs(one + two)[locked] <= tolerance**2 * plan.potential[0]).all()
    assert np.array_equal(np.array([nearest_loss.mirror_unit(each) for each in other]), z)


def test_last_bits_of_a_direction_are_not_in_what_is_found(room, found):
    unit, (ahead, _) = found[9]
    moved = unit * (1 + 1e-12 * np.random.default_rng(3).standard_normal(len(unit)))
    again = nearest_loss.nearest_loss(room, 0, moved)
    first = nearest_loss.nearest_loss(room, 0, unit)
    assert again.distance == first.distance
    assert np.array_equal(again.unit, first.unit)
    assert ahead.distance <= first.distance
    assert first.distance * 256 == int(first.distance * 256)


def test_without_a_normal_the_direction_stays(room, found, monkeypatch):
    unit, _ = found[9]
    monkeypatch.setattr(nearest_loss, "loss_boundary_normal", lambda *_: None)
    loss = nearest_loss.nearest_loss(room, 0, unit)
    assert np.array_equal(loss.unit, nearest_loss.round_unit(unit))
    assert loss.distance == nearest_loss.distance_to_loss(room, 0, loss.unit, 1.0, 12.0)


def test_a_direction_without_a_loss_has_none(plan, room):
    """The last hand-over is to a window hardly longer, and is always caught."""
    last = importance_sampling.directions(plan, 0)[len(plan.axes.pulses[0]) - 1]
    assert nearest_loss.distance_to_loss(room, 0, nearest_loss.round_unit(last), 1.0, 12.0) is None
    assert nearest_loss.nearest_loss(room, 0, last) is None
    assert not list(nearest_loss.losses_on_both_sides(room, 0, last))


def test_units_have_length_one(found):
    for _, losses in found.values():
        for loss in losses:
            assert math.fsum(loss.unit**2) == pytest.approx(1, rel=rounding(operations=2))
