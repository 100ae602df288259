"""The printed numbers under many readings, against the shipped recursion of one, and what the search comes to."""

import numpy as np
import pytest

from radarsim.studies.range_doppler import search
from radarsim.studies.range_doppler.measures import RADARS

SINGLE = float(np.finfo(np.float32).eps)  # numbers are stored in single precision


@pytest.fixture(scope="module")
def found():
    return search.search()


def test_numbers_by_a_plain_loop(found):
    rng = np.random.default_rng(3)
    axes = {key: list(values) for key, values in found.axes.items()}
    for _ in range(40):
        place = tuple(int(rng.integers(len(values))) for values in axes.values())
        taken = found.taken(place)
        want = plainly(taken)
        got = dict(zip(((one.claim, one.what) for one in found.printed), found.measured(place), strict=True))
        for name, value in want.items():
            assert got[name] == pytest.approx(value, rel=SINGLE, abs=100 * SINGLE), (taken, name)  # gains in per cent


def plainly(taken):
    """Some of the numbers of a reading, scan by scan, as the claims' words have them."""
    scans, version = int(taken["scans"]), (taken["process_noise"], float(taken["manoeuvre_variance"]), taken["start"])
    gain, time = {}, {}
    for n, radar in RADARS.items():
        count = scans if radar[2] == 10 or taken["span"] == "same scans" else 2 * scans - 1
        base, own = search.both(radar, [version], count)
        which = "true" if taken["truth"] == "quadratic" else "believed"
        rows = search.gain(getattr(base, which)[0], getattr(own, which)[0])
        first = search.first_scan(taken["start"], 2) - 1
        gain[n] = {c: {k: rows[k, c] for k in range(first, count) if np.isfinite(rows[k, c])} for c in range(3)}
        time[n] = max(gain[n][0], key=gain[n][0].get) * radar[2]
    gone = [k for k, value in gain[2][2].items() if value <= 0]
    return {
        ("P1.1", "RLS 1, least range gain"): min(gain[1][0].values()),
        ("P1.4", "RLS 3, largest range gain"): max(gain[3][0].values()),
        ("P1.4", "RLS 2, time of it"): time[2],
        ("P1.5", "RLS 3, final range gain"): list(gain[3][0].values())[-1],
        ("P1.6", "RLS 2, first velocity gain"): next(iter(gain[2][1].values())),
        ("P1.7", "RLS 2, first time without acceleration gain"): gone[0] * 10 if gone else np.inf,
        ("P1.9", "RLS 3–5, largest velocity gain"): max(max(gain[n][1].values()) for n in (3, 4, 5)),
        ("P1.11", "time of the largest range gain, RLS 3 : RLS 2"): time[3] / time[2],
        ("P1.23", "RLS 2, scans with a loss in acceleration"): sum(value < 0 for value in gain[2][2].values()),
    }


def test_no_reading_gives_more_than_the_shipped_one(found):
    assert found.readings > 1e5
    assert len(found.printed) == 30
    assert found.count(granular=False)[found.place] == 25 == found.count(granular=False).max()
    assert found.count(granular=True)[found.place] == 27 == found.count(granular=True).max()
    assert found.best(granular=False) == found.place
    assert "no reading gives more" in found.sentence()


def test_the_windows_in_the_manoeuvre_variance_of_18_are_disjoint_and_of_25_hardly_meet(found):
    windows = dict(zip([one.what for one in found.printed], found.windows("manoeuvre_variance"), strict=True))
    ends = {
        what: [float(end) for end in windows[what].split(" … ")]
        for what in ("RLS 2, final range gain", "RLS 3, final range gain")
    }
    assert ends["RLS 3, final range gain"][1] < ends["RLS 2, final range gain"][0]
    # A step of the variances looked at, of which a rounding may choose the next, and half a printed digit.
    step = search.FINE[1] / search.FINE[0] - 1
    near = lambda *values: pytest.approx(values, abs=step * max(values) + 0.005e-3)  # noqa: E731
    assert tuple(ends["RLS 2, final range gain"]) == near(0.80e-3, 1.05e-3)
    assert tuple(ends["RLS 3, final range gain"]) == near(0.61e-3, 0.77e-3)
    assert (float(windows["RLS 2, final velocity gain"].split(" … ")[1]),) == near(1.63e-3)
    assert (float(windows["RLS 3, final velocity gain"].split(" … ")[0]),) == near(1.59e-3)
    ten = [one.claim for one in found.printed].index("P1.17")
    assert found.windows("manoeuvre_variance")[ten] == "none"
