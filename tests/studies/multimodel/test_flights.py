"""The flights of the interpretations: within the printed axes, ballistic at first, vertical and lateral ones among
them."""

import numpy as np
import pytest

from radarsim.papers.multimodel.interpretations import Interpretations
from radarsim.studies.multimodel import flight as multimodel_flight
from radarsim.studies.multimodel.flights import FLIGHTS

T = np.arange(0, 186.2, 0.5)
UNFLYABLE = {"dive 60"}


def fly_flight(flight):
    phases = [
        multimodel_flight.Phase(p.start_s, p.lateral_mps2, p.normal_mps2, p.axial_mps2, p.period_s or 0.0, p.trimmed)
        for p in flight.phases
    ]
    return multimodel_flight.fly(
        flight.position_m, flight.velocity_mps, flight.ballistic_coefficient_kgpm2, flight.lag_s, phases, T
    )


@pytest.mark.parametrize("name", sorted(set(FLIGHTS) - UNFLYABLE))
def test_flights_are_within_the_printed_axes(name):
    track = fly_flight(FLIGHTS[name])
    north, up, east = track[:, 0], track[:, 3], track[:, 6]
    assert north.min() >= 0
    assert north.max() <= 200e3
    assert abs(east).max() <= 100.5e3  # the shipped one reaches 100 km
    assert np.linalg.norm(track[:, 1::3], axis=1).max() < 2000
    assert up.min() > 0
    # In the sector of an antenna that looks 30° up: biconical angles are singular where they add to 90°.
    slant, e = np.linalg.norm(track[:, ::3], axis=1), np.radians(30)
    elevation = np.arcsin((up * np.cos(e) - north * np.sin(e)) / slant)
    azimuth = np.arcsin(east / slant)
    assert np.degrees(abs(elevation) + abs(azimuth)).max() < 85
    ballistic = track[(T > 0) & (FLIGHTS[name].phases[1].start_s > T)]
    assert len(ballistic) > 100
    assert np.allclose(ballistic[:, [2, 8]], 0, atol=1.0)  # gravity and little drag: no force to the side


@pytest.mark.parametrize("name", sorted(UNFLYABLE))
def test_impossible_flights_say_why(name):
    with pytest.raises(multimodel_flight.ImpossibleFlight, match="hits the ground"):
        fly_flight(FLIGHTS[name])


def test_starts_of_manoeuvres_vary():
    """A model that takes no part in the ballistic stage would take none either where that is half as long."""
    begins = {flight.phases[1].start_s for flight in FLIGHTS.values()}
    assert {60, 125} <= begins


def test_there_are_enough_of_both_kinds():
    choice = Interpretations.choices[0]
    assert choice.key == "flight"
    begins = {name: f"within the printed axes, ballistic to {o.phases[1].start_s:g} s" for name, o in FLIGHTS.items()}
    assert {o.name: o.reason for o in choice.alternatives[1:]} == begins
    assert len(begins) >= 8
    assert sum("vertical" in name or "pull-up" in name for name in FLIGHTS) >= 4
    assert sum("lateral" in name or "turn" in name for name in FLIGHTS) >= 4
