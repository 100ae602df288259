"""Targets of range_doppler that break its model: what they must say, and that they keep off the radar."""

import math
import random

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.physics import targets
from radarsim.studies.range_doppler.config import Turn
from tests.tolerances import assert_rounded

TURN = {
    "kind": "turn",
    "range_m": 60e3,
    "speed_mps": 250,
    "aspect_deg": 180,
    "start_s": 50,
    "acceleration_g": 3,
    "duration_s": 20,
}
PULSE = {"kind": "jerk_pulse", "coefficients": [1e5], "start_s": 5, "jerk_mps3": 1, "duration_s": 20}
STEP = {"kind": "acceleration_start", "coefficients": [1e5], "start_s": 50, "acceleration_mps2": 20}


@pytest.mark.parametrize(
    ("target", "change", "line"),
    [
        (
            TURN,
            {"start_scan": 3},
            "target.start_scan: unknown key; did you mean start_s? allowed: start_s, kind, range_m, "
            "speed_mps, aspect_rad, aspect_deg, acceleration_g, duration_s, sigma_position_m, sigma_velocity_mps",
        ),
        (TURN, {"start_s": ...}, "target.start_s: required key is missing"),
        (TURN, {"start_s": -1}, "target.start_s: must be >= 0, got -1"),
        (TURN, {"aspect_rad": 3.14}, "target.aspect_deg: given as aspect_rad too"),
        (TURN, {"aspect_deg": "x"}, "target.aspect_deg: must be a number, got 'x'"),
        (TURN, {"aspect_deg": ...}, "target.aspect_rad: required key is missing"),
        (TURN, {"speed_mps": 12_001}, "target.speed_mps: must be <= 12000, got 12001"),
        (TURN, {"acceleration_g": -101}, "target.acceleration_g: must be >= -100, got -101"),
        (TURN, {"duration_s": 0}, "target.duration_s: must be > 0, got 0"),
        (TURN, {"range_m": 0}, "target.range_m: must be > 0, got 0"),
        (
            TURN,
            {"range_m": 1e4},
            "target: must not fly over the radar: it comes within 100 m of it, got {kind: 'turn', range_m: 10000, "
            "speed_mps: 250, aspect_deg: …",
        ),
        (PULSE, {"jerk_mps3": 1001}, "target.jerk_mps3: must be <= 1000, got 1001"),
        (
            PULSE,
            {"jerk_mps2": 1},
            "target.jerk_mps2: unknown key; did you mean jerk_mps3? allowed: start_s, "
            "kind, coefficients, jerk_mps3, duration_s",
        ),
        (STEP, {"acceleration_mps2": -2000}, "target.acceleration_mps2: must be >= -1000, got -2000"),
        (
            STEP,
            {"coefficients": [0, 1e14]},
            "target: must stay within 68e12 m of the radar up to the last plot, at 140 s: beyond, double precision "
            "does not resolve its accuracies, got "
            "{kind: 'acceleration_start', coefficients: [0, 1e14], start…",
        ),
    ],
)
def test_bad_target(good, said, target, change, line):
    good["target"] = {key: value for key, value in {**target, **change}.items() if value is not ...}
    assert said(good) == [f"config: {line}"]


def test_degrees_become_radians(good):
    good["target"] = TURN
    assert_rounded(load(good).cases[0].spec.target.aspect_rad, math.pi, operations=2)


def test_closest_approach_of_a_turn_is_that_of_its_path():
    rng = random.Random(1)
    for _ in range(200):
        target = Turn(
            kind="turn",
            range_m=rng.uniform(100, 20e3),
            speed_mps=rng.uniform(50, 600),
            aspect_rad=rng.uniform(-7, 7),
            acceleration_g=rng.choice([0, rng.uniform(-9, 9)]),
            start_s=rng.uniform(0, 100),
            duration_s=rng.uniform(1, 200),
        )
        end = rng.uniform(1, 200)
        path = targets.turn(
            target.range_m,
            target.speed_mps,
            target.aspect_rad,
            target.acceleration_g,
            target.start_s,
            target.duration_s,
            np.linspace(0, end, 4001),
        )
        half = end / 4000 / 2  # of a step: so near is a place of the grid in time
        assert target.closest_m(end) == pytest.approx(path[:, 0].min(), rel=0, abs=target.speed_mps * half)
