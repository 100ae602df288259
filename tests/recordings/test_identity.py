"""Plots find their own aircraft by what identifies them, and never another."""

import numpy as np
import pytest

from radarsim.recordings import aircraft_match
from radarsim.recordings.formats.import_options import Options
from radarsim.recordings.formats.import_recording import import_recording
from radarsim.recordings.formats.sites import Site
from tests.tolerances import assert_rounded

T = np.arange(0.0, 100.0, 5.0)


def flight(x=0.0, z=50e3, speed=200.0, t=T):
    """Fixes of an aircraft that flies north at a height of 3 km, z to the east of the radar."""
    return np.column_stack([t, x + speed * t, np.full(len(t), 3000.0), np.full(len(t), z)])


def paths(*aircraft):
    """Of aircraft: fixes, and identities by KINDS."""
    made = aircraft_match.AircraftPaths()
    for number, (fixes, names) in enumerate(aircraft):
        made.add(fixes, [str(number)] * len(fixes), {kind: [name] * len(fixes) for kind, name in names.items()})
    return made


def found(made, at, names, t=T[1:-1] + 1):
    """The paths that plots find which lie where an aircraft from these fixes is."""
    places = np.stack([np.interp(t, at[:, 0], column) for column in at.T[1:]], axis=1)
    r, b = np.linalg.norm(places, axis=1), np.arctan2(places[:, 2], places[:, 0])
    return made.find(t, r + 100, b, {kind: [name] * len(t) for kind, name in names.items()})


HERE, NEXT, THERE = flight(), flight(z=50.009e3), flight(z=120e3)
A, B = {"address": "4ca1fa"}, {"address": "3c6444"}


@pytest.mark.parametrize(
    ("aircraft", "plot", "wanted"),
    [
        ([(HERE, A), (THERE, B)], {"address": "4CA1FA"}, (0, 0)),
        ([(THERE, A), (HERE, B)], A, (0, 0)),  # by address wherever it lies: the distance is judged by aircraft
        ([(HERE, B)], A, None),
        ([(HERE, {})], {}, None),  # the only one there, and nameless
        ([(HERE, A)], {}, None),
        ([(HERE, {"callsign": "KLM1 "})], {"callsign": "klm1"}, (0, 1)),
        ([(HERE, {"mode_3a": "0421"})], {"mode_3a": "421"}, (0, 2)),
        ([(HERE, {"mode_3a": "7000"})], {"mode_3a": "7000"}, None),  # a code of many
        ([(THERE, {"mode_3a": "0421"})], {"mode_3a": "0421"}, None),  # used again elsewhere
        ([(THERE, {"mode_3a": "0421"}), (HERE, {"mode_3a": "0421"})], {"mode_3a": "0421"}, (1, 2)),
        ([(HERE, {"mode_3a": "0421"}), (NEXT, {"mode_3a": "0421"})], {"mode_3a": "0421"}, None),  # either
        ([(HERE, B | {"mode_3a": "0421"})], A | {"mode_3a": "0421"}, None),  # its address is another
        ([(HERE, {"mode_3a": "0421"})], A | {"mode_3a": "0421"}, (0, 2)),
        ([(HERE, {"callsign": "KLM1", "mode_3a": "0421"})], {"callsign": "KLM2", "mode_3a": "0421"}, None),
        ([(flight(t=T + 1000), {"mode_3a": "0421"})], {"mode_3a": "0421"}, None),  # another time
    ],
)
def test_whose_a_plot_is(aircraft, plot, wanted):
    one = found(paths(*aircraft), HERE, plot)
    path, kind = wanted or (-1, -1)
    assert set(one.path_numbers) == {path}
    assert set(one.kind_numbers) == {kind}
    if wanted:
        t = T[1:-1] + 1
        fixes = aircraft[path][0]
        places = np.stack([np.interp(t, fixes[:, 0], column) for column in fixes.T[1:]], axis=1)
        assert_rounded(one.states[:, :3], places, np.abs(fixes[:, 1:]).max(), operations=4)
        moved = np.abs(fixes[:, 1:]).max() / np.diff(fixes[:, 0]).min()
        assert_rounded(one.states[:, 3:], [[200, 0, 0]] * len(t), moved, operations=2)
    else:
        assert np.isnan(one.states).all()


def test_a_code_is_its_aircrafts_only_while_it_is_set():
    """An aircraft takes another code half-way, another aircraft near it then takes the first."""
    made, half = aircraft_match.AircraftPaths(), len(T) // 2
    codes = ["0421"] * half + ["0533"] * half
    made.add(HERE, ["1"] * len(T), {"address": ["4ca1fa"] * len(T), "mode_3a": codes})
    assert set(found(made, HERE, {"mode_3a": "0421"}, t=np.array([20.0])).path_numbers) == {0}
    late = flight(t=T + 1000)
    made.add(late, ["1"] * len(T), {"address": ["4ca1fa"] * len(T), "mode_3a": ["0533"] * len(T)})
    assert set(found(made, late, {"mode_3a": "0421"}, t=T[3:5] + 1000).path_numbers) == {-1}
    assert set(found(made, late, {"mode_3a": "0533"}, t=T[3:5] + 1000).path_numbers) == {0}


def test_a_track_keeps_its_address_where_a_record_does_not_repeat_it():
    made = aircraft_match.AircraftPaths()
    addresses = ["4ca1fa" if k % 3 == 0 else "" for k in range(len(T))]
    made.add(HERE, ["7"] * len(T), {"address": addresses, "mode_3a": ["0421"] * len(T)})
    assert made.names() == ["4ca1fa"]
    assert sum(map(len, made.paths[0].fixes)) == len(T)
    assert set(found(made, HERE, {"mode_3a": "0421"}).path_numbers) == {0}


def table(tmp_path, name, flown):
    """A recording of aircraft in CSV: address and degree of longitude each."""
    rows = [f"{1.7e9 + 5 * k},{one},{52 + 0.01 * k},{lon},9000" for k in range(40) for one, lon in flown.items()]
    path = tmp_path / name
    path.write_text("\n".join(["time,icao24,lat,lon,geoaltitude", *rows]))
    return path


def test_the_truth_of_one_aircraft_is_not_that_of_all(tmp_path):
    """A2 of the findings: plots of many aircraft, and a truth of one."""
    plots = table(tmp_path, "plots", {"4ca815": 4.5, "3c6444": 4.9, "484161": 5.5})
    truth = table(tmp_path, "truth", {"4ca815": 4.5})
    done = import_recording(plots, tmp_path / "out.csv", Options(site=Site(52.3, 4.76, 0.0), truth=str(truth)))
    assert done.notes[-1].startswith("truth: of 40 of 120 plots (33 %; by address 40), which lie ")
    rows = [line.split(",") for line in (tmp_path / "out.csv").read_text().splitlines() if not line.startswith("#")]
    at = rows[0].index("true_r_m")
    assert {row[1] for row in rows[1:] if row[at]} == {"4ca815"}
