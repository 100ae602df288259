"""Progress that foretells: over cases and runs that differ in time a hundredfold, within a factor of two."""

import random
from types import SimpleNamespace

import pytest

from radarsim.api import progress
from radarsim.api.progress import TimedProgress, WeightedProgress
from radarsim.errors import ConfigError
from tests.tolerances import rounding


class Clock:
    """The time of `ahead`, that passes by hand."""

    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now

    thread_time = monotonic


@pytest.fixture
def clock(monkeypatch):
    one = Clock()
    monkeypatch.setattr(progress, "time", one)
    return one


class Work:
    """Work whose realisations take that many seconds each."""

    block = 4096

    def __init__(self, clock, each, outside=()):
        self.clock, self.each, self.case = clock, each, SimpleNamespace(user_filters=outside)
        self.called = 0

    def simulate(self, _first, count):
        self.called += count
        self.clock.now += self.each * count


def over(clock, works, n, stored=0):
    """What is reported while works are done in tenths, of which the first are stored: when, and what."""
    seen = []
    weighed = WeightedProgress(
        lambda *of: seen.append((clock.now, *of)), {i: (work, n) for i, work in enumerate(works)}
    )
    for i, work in enumerate(works):
        for tenth in range(11):
            held = min(tenth, stored)
            weighed.case_callback(i)(n * tenth // 10, n, n * held // 10)
            if tenth < 10:
                clock.now += work.each * n / 10 * (tenth >= stored)
    return seen


@pytest.mark.parametrize("stored", [0, 3])
def test_progress_over_cases_is_that_of_time(clock, stored):
    """Once a second has passed: shares of what is computed are those of time, whatever a case's realisation takes."""
    works = [Work(clock, each) for each in (0.0002, 0.02, 0.001)]
    start = clock.now
    seen = over(clock, works, 10_000, stored)
    end = seen[-1][0]
    late = [(at, done - held, total - seen[-1][3]) for at, done, total, held in seen if at > start + 2]
    assert seen[-1][1:3] == (30_000, 30_000)
    assert seen[0][0] > start + 1  # before, nothing is known of what cases take
    assert len(late) > 15
    timed = (2 * 10_000 / progress.PILOT_DIVISOR + 21) / 10_000  # of each case at most
    for at, done, total in late:
        assert done / total == pytest.approx((at - start) / (end - start), rel=0, abs=timed)
    assert [done for _at, done, _total, _held in seen] == sorted(done for _at, done, _total, _held in seen)
    assert all(0 < work.called <= 1 + 2 * 10_000 / progress.PILOT_DIVISOR + 20 for work in works)


@pytest.mark.parametrize(("each", "outside"), [(1e-5, ()), (0.01, ("a filter",))])
def test_nothing_is_timed_for_short_work_or_with_filters_from_outside(clock, each, outside):
    works = [Work(clock, each, outside), Work(clock, each)]
    seen = over(clock, works, 10_000)
    assert [work.called for work in works] == [0, 0]
    assert seen[-1][1:] == (20_000, 20_000, 0)


def test_a_case_that_cannot_be_run_is_no_fault_of_the_run_that_foretells(clock):
    class Impossible(Work):
        def simulate(self, _first, _count):
            raise ConfigError("it hits the ground")

    found = progress.estimate_seconds({"one": (Work(clock, 0.01), 1000), "other": (Impossible(clock, 0.01), 1000)})
    assert found == {"one": pytest.approx(10, rel=rounding(operations=1000)), "other": 0}


def foretold(clock, kinds, expected, slower, stored):
    """Runs of each kind, in ten steps: at each report the seconds that passed and that were left, both as reported and
    in truth."""
    seen = []
    runs = [(kind, seconds) for kind, own in kinds.items() for seconds in own]
    left = list(runs)

    def estimate():
        for kind, seconds in left:
            one.add(kind, 1.0, expected(seconds))

    one = TimedProgress(lambda *of: seen.append((clock.now, *of)), estimate)
    for kind, _seconds in runs:
        one.add(f"after {kind}", 0.1)
    for i, (kind, seconds) in enumerate(runs):
        report = one.run_callback(kind, lambda seconds=seconds: expected(seconds))
        for tenth in range(1, 11):
            clock.now += 0.0 if i in stored else seconds / 10
            report(tenth, 10, tenth if i in stored else 0)
        left.remove((kind, seconds))
        with one.measure_unit(f"after {kind}"):
            clock.now += 0.1 * slower
    started, ended = 100.0, clock.now
    return [(done / 1000, at - started, (whole - done) / 1000, ended - at) for at, done, whole, _held in seen]


@pytest.mark.parametrize("seed", range(5))
def test_what_is_left_is_foretold_within_a_factor_of_two(clock, seed):
    """Of two kinds, one forty times as long, on a machine that takes twice as long as expected for all, or half, with
    runs that differ by a fifth; some runs are stored."""
    draw = random.Random(seed)
    kinds = {kind: [each * draw.uniform(0.7, 1.4) for _ in range(12)] for kind, each in (("a", 0.5), ("b", 20.0))}
    slower = draw.choice((0.5, 2.0))
    expected = {each: each * draw.uniform(0.8, 1.25) / slower for own in kinds.values() for each in own}
    seen = foretold(clock, kinds, expected.__getitem__, slower, stored=range(3))
    known = [one for one in seen if one[1] > 1 and one[3] > 2]
    assert len(known) > 100
    for reported, passed, foretold_s, left in known:
        assert reported == pytest.approx(passed, rel=0, abs=0.5e-3 + rounding(passed, 1000))  # whole milliseconds
        assert 0.5 <= foretold_s / left <= 2
    assert seen[-1][2] == 0


def test_what_falls_away_is_not_ahead(clock):
    """A run that turns out to be impossible half-way, and one that needs none at all."""
    seen = []
    one = TimedProgress(lambda *of: seen.append(of), lambda: one.add("run", 1.0, 30.0))
    for _ in range(3):
        report = one.run_callback("run", lambda: 10.0)
        clock.now += 5
        report(5, 10, 0)
        report(1, 1, 1)
    assert seen[-1] == (15_000, 15_000, 0)


def test_nobody_looks(clock):
    """Nothing is measured ahead where nothing is shown."""
    one = TimedProgress(None, lambda: pytest.fail("asked for"))
    one.run_callback("run", lambda: 0.0)(5, 10, 0)
    one.add("figure", 0.1)
    with one.measure_unit("figure"):
        clock.now += 1


def test_a_clock_too_coarse_for_the_pilot_leaves_cases_equally_long(clock, monkeypatch):
    works = [Work(clock, 0.02), Work(clock, 0.02)]
    monkeypatch.setattr(Work, "simulate", lambda *_: None)
    seen = over(clock, works, 10_000)
    assert seen[-1][1:] == (20_000, 20_000, 0)
    assert (2000, 20_000, 0) in {one[1:] for one in seen}
