"""What work takes, from a little of it, and progress weighed by that: cases and runs differ in time a hundredfold."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from radarsim.app.case_work import CaseWork
from radarsim.errors import ConfigError

Progress = Callable[[int, int, int], None]
Name = TypeVar("Name")

LADDER, FOR_NOTHING = 8, 1.2  # factor between numbers of realisations tried; times that count as equal
SHORT_S = 0.01
PATIENCE_S, PILOT_S, PART = 1.0, 0.3, 20  # nothing is timed for work that ends sooner; at most a PART of it is
TRUSTED_S = 1.0


def seconds_each(work: CaseWork, realisations: int, pilot_s: float) -> float:
    """Seconds of one thread for one realisation, from growing numbers of them, at most a block, in about pilot_s.
    Kernels calculate whole chunks: one realisation may take as long as hundreds. So larger numbers are tried as long as
    they take no longer."""
    most, count, taken, free = min(work.block, realisations), 1, timed(work, 1), True
    while count < most and (free or LADDER * taken < pilot_s):
        more = min(LADDER * count, most)
        longer = timed(work, more)
        free = longer < FOR_NOTHING * taken
        count, taken = more, longer
    return taken / count


def timed(work: CaseWork, count: int) -> float:
    """CPU seconds of `count` realisations; of short ones the lesser of two measurements."""
    seconds: list[float] = []
    while not seconds or (len(seconds) < 2 and seconds[0] < SHORT_S):
        started = time.thread_time()
        work.simulate(0, count)
        seconds.append(time.thread_time() - started)
    return min(seconds)


def estimated(cases: Mapping[Name, tuple[CaseWork, int]]) -> dict[Name, float]:
    """Seconds of one thread for the realisations of each case, from a few of them, after compilation; 0 of a case that
    cannot be run, which its own run says."""
    seconds = dict.fromkeys(cases, 0.0)
    for key, (work, realisations) in cases.items():
        with suppress(ConfigError):
            work.simulate(0, 1)
            seconds[key] = realisations * seconds_each(work, max(1, realisations // PART), PILOT_S / len(cases))
    return seconds


class Weighed:
    """Progress over cases in realisations of mean length, once a second has passed or all is done; filters from outside
    are not called for a forecast, and count as equally long.

    cases: the work and the number of realisations of each."""

    def __init__(self, progress: Progress | None, cases: Mapping[Any, tuple[CaseWork, int]]):
        self._progress, self._cases = progress, cases
        self._seconds: dict[Any, float] = {key: count for key, (_, count) in cases.items()}
        self._counts = dict.fromkeys(cases, (0, 0))  # done, of them from the store
        equal = len(cases) < 2 or any(work.case.outside for work, _ in cases.values())
        self._due = float("inf") if equal else time.monotonic() + PATIENCE_S

    def of(self, key: Any) -> Progress:
        """Progress of one case."""

        def report(done: int, _: int, held: int) -> None:
            self._counts[key] = done, held
            if self._progress is not None:
                self._weigh()
                self._report(self._progress)

        return report

    def _weigh(self) -> None:
        if time.monotonic() > self._due and any(done > held for done, held in self._counts.values()):
            self._due = float("inf")
            found = estimated(self._cases)
            if any(found.values()):  # a coarse clock may see none of them
                self._seconds = found

    def _report(self, progress: Progress) -> None:
        total = sum(count for _, count in self._cases.values())
        if self._due < float("inf") and sum(done for done, _ in self._counts.values()) < total:
            return  # a share of unweighted cases would go back
        each = {key: self._seconds[key] / count for key, (_, count) in self._cases.items()}
        scale = total / sum(self._seconds.values())
        done, held = (round(scale * sum(each[key] * of[i] for key, of in self._counts.items())) for i in (0, 1))
        progress(min(done, total), total, min(held, total))


@dataclass
class Kind:
    """Work of one kind: expected seconds of one, and how many are ahead and done, in how many seconds."""

    expected: float
    ahead: float = 0.0
    done: float = 0.0
    seconds: float = 0.0


class Ahead:
    """Progress over work of several kinds: milliseconds that have passed, and that all is expected to take.

    estimate: called once a run has computed something; it adds what the runs ahead will take."""

    def __init__(self, progress: Progress | None, estimate: Callable[[], None]):
        self._progress, self._estimate, self._kinds = progress, estimate, dict[str, Kind]()
        self._started, self._estimated = time.monotonic(), progress is None

    def add(self, kind: str, expected: float, count: float = 1.0) -> None:
        """Expect this many more of a kind, each in so many seconds; less than none: they fall away."""
        self._kinds.setdefault(kind, Kind(expected)).ahead += count

    @contextmanager
    def doing(self, kind: str) -> Iterator[None]:
        """Measure one of a kind."""
        started = time.monotonic()
        yield
        self.did(kind, 1.0, time.monotonic() - started)

    def did(self, kind: str, count: float, seconds: float) -> None:
        """This many of a kind took so many seconds."""
        one = self._kinds[kind]
        one.ahead, one.done, one.seconds = one.ahead - count, one.done + count, one.seconds + seconds
        self._report()

    def running(self, kind: str, expected: Callable[[], float]) -> Progress:
        """Progress of a run of a kind that is measured in its expected seconds, which are known after `estimate`."""
        before, computed, stored = time.monotonic(), 0.0, 0.0

        def report(done: int, total: int, held: int) -> None:
            nonlocal before, computed, stored
            if done == held and not self._estimated:
                return
            first, self._estimated = not self._estimated, True
            if first:
                self._estimate()
            now, one = time.monotonic(), expected() / total
            if first:  # kernels were loaded in this time
                self.add(kind, 1.0, -one * done)
            else:
                self.add(kind, 1.0, stored - one * held)
                self.did(kind, one * (done - held) - computed, now - before)
            before, computed, stored = now, one * (done - held), one * held

        return report

    def _report(self) -> None:
        if self._progress is not None:
            passed = round(1000 * (time.monotonic() - self._started))
            self._progress(passed, passed + max(0, round(1000 * self._left())), 0)

    def _left(self) -> float:
        """Expected seconds of what is ahead: as measured, where expectations count as TRUSTED_S of it, slower or faster
        by what all kinds are."""
        kinds = self._kinds.values()
        slower = (TRUSTED_S + sum(one.seconds for one in kinds)) / (
            TRUSTED_S + sum(one.expected * one.done for one in kinds)
        )
        return sum(
            one.ahead * (one.seconds + TRUSTED_S * slower) / (one.done + TRUSTED_S / one.expected) for one in kinds
        )
