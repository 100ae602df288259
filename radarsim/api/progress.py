"""How long work takes, measured on a little of it, and progress that is weighted by it."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from radarsim.api.case_work import CaseWork
from radarsim.errors import ConfigError

Progress = Callable[[int, int, int], None]
Name = TypeVar("Name")

COUNT_FACTOR, EQUAL_TIME_FACTOR = 8, 1.2  # between numbers of realisations tried; between times that count as equal
SHORT_S = 0.01
PATIENCE_S, PILOT_S, PILOT_DIVISOR = (
    1.0,
    0.3,
    20,
)  # work that ends sooner is not timed; of longer work at most 1/PILOT_DIVISOR
TRUSTED_S = 1.0


def seconds_each(work: CaseWork, realisations: int, pilot_s: float) -> float:
    """Seconds of one thread for one realisation, from growing numbers of them, at most a block, in about pilot_s.

    Kernels compute whole chunks, so one realisation may take as long as hundreds. Larger numbers are therefore tried
    while they take no longer."""
    max_count, count, seconds, is_free = min(work.block, realisations), 1, measure_seconds(work, 1), True
    while count < max_count and (is_free or COUNT_FACTOR * seconds < pilot_s):
        larger_count = min(COUNT_FACTOR * count, max_count)
        larger_seconds = measure_seconds(work, larger_count)
        is_free = larger_seconds < EQUAL_TIME_FACTOR * seconds
        count, seconds = larger_count, larger_seconds
    return seconds / count


def measure_seconds(work: CaseWork, count: int) -> float:
    """CPU seconds of `count` realisations; if short, the smaller of two measurements."""
    seconds: list[float] = []
    while not seconds or (len(seconds) < 2 and seconds[0] < SHORT_S):
        started = time.thread_time()
        work.simulate(0, count)
        seconds.append(time.thread_time() - started)
    return min(seconds)


def estimate_seconds(cases: Mapping[Name, tuple[CaseWork, int]]) -> dict[Name, float]:
    """Seconds of one thread for the realisations of each case, from a few of them, after compilation.

    0 for a case that cannot be run: its own run reports the error."""
    seconds = dict.fromkeys(cases, 0.0)
    for key, (work, realisations) in cases.items():
        with suppress(ConfigError):
            work.simulate(0, 1)
            seconds[key] = realisations * seconds_each(
                work, max(1, realisations // PILOT_DIVISOR), PILOT_S / len(cases)
            )
    return seconds


class WeightedProgress:
    """Progress over several cases, in realisations of mean length.

    Cases are weighted by their measured time per realisation. Until that is known, after PATIENCE_S, nothing is
    reported.
    User filters are not called for a forecast: with them all cases have equal weights.
    cases: the work and the number of realisations of each."""

    def __init__(self, progress: Progress | None, cases: Mapping[Any, tuple[CaseWork, int]]):
        self._progress, self._cases = progress, cases
        self._seconds: dict[Any, float] = {key: count for key, (_, count) in cases.items()}
        self._counts = dict.fromkeys(cases, (0, 0))  # realisations done, and how many of these were stored
        is_unweighted = len(cases) < 2 or any(work.case.user_filters for work, _ in cases.values())
        self._due = float("inf") if is_unweighted else time.monotonic() + PATIENCE_S

    def case_callback(self, key: Any) -> Progress:
        """The callback for the progress of one case."""

        def report(done: int, _: int, stored: int) -> None:
            self._counts[key] = done, stored
            if self._progress is not None:
                self._measure_weights()
                self._report(self._progress)

        return report

    def _measure_weights(self) -> None:
        if time.monotonic() > self._due and any(done > stored for done, stored in self._counts.values()):
            self._due = float("inf")
            estimates = estimate_seconds(self._cases)
            if any(estimates.values()):  # a coarse clock may see none of them
                self._seconds = estimates

    def _report(self, progress: Progress) -> None:
        total = sum(count for _, count in self._cases.values())
        if self._due < float("inf") and sum(done for done, _ in self._counts.values()) < total:
            return  # weights that come later would turn progress back
        seconds_each = {key: self._seconds[key] / count for key, (_, count) in self._cases.items()}
        scale = total / sum(self._seconds.values())
        done, stored = (
            round(scale * sum(seconds_each[key] * counts[i] for key, counts in self._counts.items())) for i in (0, 1)
        )
        progress(min(done, total), total, min(stored, total))


@dataclass
class KindOfWork:
    """Work of one kind: expected seconds of a unit, the units ahead, the units done, and the seconds these took."""

    expected_unit_s: float
    units_ahead: float = 0.0
    units_done: float = 0.0
    seconds_done: float = 0.0


class TimedProgress:
    """Progress over work of several kinds, in milliseconds: those passed, and the expected total.

    estimate: called when the first run has computed something; it adds the time that the runs ahead will take."""

    def __init__(self, progress: Progress | None, estimate: Callable[[], None]):
        self._progress, self._estimate, self._kinds = progress, estimate, dict[str, KindOfWork]()
        self._started, self._estimated = time.monotonic(), progress is None

    def add(self, kind: str, expected: float, count: float = 1.0) -> None:
        """Expect `count` more units of a kind, of `expected` seconds each; a negative count removes units."""
        self._kinds.setdefault(kind, KindOfWork(expected)).units_ahead += count

    @contextmanager
    def measure_unit(self, kind: str) -> Iterator[None]:
        """Measure a unit of a kind."""
        started = time.monotonic()
        yield
        self.record_units(kind, 1.0, time.monotonic() - started)

    def record_units(self, kind: str, count: float, seconds: float) -> None:
        """Record that `count` units of a kind took `seconds`."""
        work = self._kinds[kind]
        work.units_ahead, work.units_done, work.seconds_done = (
            work.units_ahead - count,
            work.units_done + count,
            work.seconds_done + seconds,
        )
        self._report()

    def run_callback(self, kind: str, expected: Callable[[], float]) -> Progress:
        """The progress callback of a run, whose units are its expected seconds; these are known after `estimate`."""
        last_time, computed_s, stored_s = time.monotonic(), 0.0, 0.0

        def report(done: int, total: int, stored: int) -> None:
            nonlocal last_time, computed_s, stored_s
            if done == stored and not self._estimated:
                return
            is_first, self._estimated = not self._estimated, True
            if is_first:
                self._estimate()
            now, realisation_s = time.monotonic(), expected() / total
            if is_first:  # kernels were loaded in this time
                self.add(kind, 1.0, -realisation_s * done)
            else:
                self.add(kind, 1.0, stored_s - realisation_s * stored)
                self.record_units(kind, realisation_s * (done - stored) - computed_s, now - last_time)
            last_time, computed_s, stored_s = now, realisation_s * (done - stored), realisation_s * stored

        return report

    def _report(self) -> None:
        if self._progress is not None:
            passed = round(1000 * (time.monotonic() - self._started))
            self._progress(passed, passed + max(0, round(1000 * self._remaining_seconds())), 0)

    def _remaining_seconds(self) -> float:
        """Expected seconds of the work ahead.

        Times are as measured; an expectation counts as TRUSTED_S of measurement, corrected by how much slower all kinds
        are than expected."""
        kinds = self._kinds.values()
        slowdown = (TRUSTED_S + sum(work.seconds_done for work in kinds)) / (
            TRUSTED_S + sum(work.expected_unit_s * work.units_done for work in kinds)
        )
        return sum(
            work.units_ahead
            * (work.seconds_done + TRUSTED_S * slowdown)
            / (work.units_done + TRUSTED_S / work.expected_unit_s)
            for work in kinds
        )
