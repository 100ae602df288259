"""The run loop: the same bytes whatever the workers do, stops and faults that lose nothing, memory that stays."""

import random
import subprocess
import sys
import time
from itertools import pairwise

import numpy as np
import pytest

from radarsim.engine.collect import collect
from radarsim.engine.dispatch import Pace
from radarsim.engine.executors import Serial, Threads
from radarsim.engine.machine import available_cores
from radarsim.engine.stop_conditions import TimeLimit
from radarsim.errors import NonFiniteError
from tests.engine.fake import Fake, textbook

WORK = Fake()


class Shuffled(Serial):
    """Hands tasks back in an order of its own."""

    workers, depth = 4, 40

    def __init__(self, seed):
        super().__init__()
        self._random = random.Random(seed)

    def finished(self, timeout_s):
        waiting = list(self._tasks)
        self._random.shuffle(waiting)
        self._tasks.clear()
        self._tasks.extend(waiting)
        return [outcome for _ in range(3) for outcome in Serial.take_outcomes(self, timeout_s)]


@pytest.mark.parametrize("realisations", [1, 15, 16, 17, 32, 999, 10_000])
def test_every_number_of_threads_gives_the_bytes_of_the_textbook(realisations):
    expected = textbook(WORK, realisations).tobytes()
    for threads in (0, 1, 2, 3, 5):
        result = collect(WORK, realisations, threads=threads)
        assert (result.count, result.values.tobytes()) == (realisations, expected)
        assert (result.computed, result.from_store, result.stopped) == (realisations, 0, None)


@pytest.mark.parametrize("seed", range(10))
def test_any_order_of_completion_gives_the_same_bytes(seed):
    assert collect(WORK, 5_005, executor=Shuffled(seed)).values.tobytes() == textbook(WORK, 5_005).tobytes()


def test_every_block_is_simulated_once_and_whole():
    calls = []

    class Counted(Fake):
        def simulate(self, first, count):
            calls.append((first, count))
            return super().simulate(first, count)

    collect(Counted(), 1_000, threads=3)
    assert sorted(calls) == [(first, min(16, 1_000 - first)) for first in range(0, 1_000, 16)]


@pytest.mark.slow
def test_tasks_grow_until_they_are_worth_handing_over():
    sizes = []

    class Watched(Threads):
        def submit(self, work, piece):
            sizes.append(getattr(piece, "level", 0))
            super().submit(work, piece)

    collect(Fake(pause_s=2e-4), 16 * 4_000, executor=Watched(1))
    assert sizes[0] == 0
    assert max(sizes) >= 3
    assert len(sizes) < 1_000


def test_threads_work_at_the_same_time():
    result = collect(Fake(pause_s=2e-3), 16 * 400, threads=4)
    assert result.kernel_seconds > 2.5 * result.seconds


def test_progress_comes_at_most_ten_times_a_second_and_ends_at_all():
    seen = []
    collect(Fake(pause_s=1e-3), 16 * 800, threads=2, progress=lambda *given: seen.append((time.perf_counter(), *given)))
    times = [row[0] for row in seen]
    assert all(later - earlier >= 0.1 for earlier, later in pairwise(times[:-1]))
    assert 3 <= len(seen) <= 10 * (times[-1] - times[0]) + 2
    assert [row[1] for row in seen] == sorted(row[1] for row in seen)
    assert seen[-1][1:] == (12_800, 12_800, 0)


@pytest.mark.parametrize("threads", [0, 1, 2, 5])
def test_a_stopped_run_reports_exactly_what_is_done_without_a_gap(threads):
    asked = iter([None] * 12)
    result = collect(Fake(pause_s=1e-3), 10**9, threads=threads, stop=lambda: next(asked, "enough"))
    assert result.stopped == "enough"
    assert 0 < result.count == result.computed < 10**6
    assert result.count % WORK.block == 0
    assert result.values.tobytes() == textbook(WORK, result.count).tobytes()


def test_stopped_before_anything_is_done():
    result = collect(WORK, 1_000, stop=lambda: "at once")
    assert (result.count, result.stopped, result.values.tolist()) == (0, "at once", [0.0] * 5)


def test_a_stop_drops_the_tasks_that_have_not_begun():
    class Deep(Serial):
        depth = 40

    asked = iter([None])
    result = collect(WORK, 10_000, executor=Deep(), stop=lambda: next(asked, "enough"))
    assert (result.count, result.computed) == (16, 16)


def test_a_stop_that_comes_when_all_is_done_is_none():
    asked = iter([None])
    assert collect(WORK, 10, threads=0, stop=lambda: next(asked, "late")).stopped is None


def test_a_time_limit():
    result = collect(Fake(pause_s=1e-3), 10**9, stop=TimeLimit(0.3))
    assert result.stopped == "time limit of 0.3 s"
    assert result.count < 10**9


def test_a_stop_with_grace_does_not_wait_for_a_stuck_task():
    class Impatient:
        grace_s = 0.2

        def __call__(self):
            return "stop" if time.perf_counter() > started + 0.2 else None

    started = time.perf_counter()
    result = collect(Fake(pause_s=1e-3, stuck_at=500), 10**9, threads=2, stop=Impatient())
    assert 0 < result.count <= 496
    assert result.values.tobytes() == textbook(WORK, result.count).tobytes()


@pytest.mark.parametrize("threads", [0, 1, 2, 5])
def test_the_first_numbers_that_are_not_finite_are_named_for_any_threads(threads):
    class Bad(Fake):
        def simulate(self, first, count):
            values = super().simulate(first, count)
            return values * np.inf if first // 16 in (61, 63, 64, 70, 200) else values

    with pytest.raises(NonFiniteError) as caught:
        collect(Bad(), 10_000, threads=threads)
    assert caught.value.lines == ("realisations 976 to 991: the sums are not finite",)
    assert caught.value.exit_code == 5


def test_the_programs_own_mistakes_come_through():
    class Broken(Fake):
        def simulate(self, first, count):
            raise KeyError("gain")

    with pytest.raises(KeyError, match="gain"):
        collect(Broken(), 100)


def test_what_a_failed_run_left_running_is_no_part_of_the_next():
    class Late(Fake):
        def simulate(self, first, count):
            if first == 0:
                raise KeyError("at once")
            time.sleep(0.3)
            return np.full(self.size, -1.0)

    pool = Threads(2)
    with pytest.raises(KeyError):
        collect(Late(), 16 * 2, executor=pool)
    assert collect(Fake(pause_s=5e-3), 16 * 100, executor=pool).values.tobytes() == textbook(WORK, 1_600).tobytes()
    pool.close()


def test_the_default_is_all_cores():
    pool = Threads()
    pool.close()
    assert pool.workers == available_cores()


@pytest.mark.alone
def test_memory_is_flat_up_to_a_thousand_million_realisations():
    program = """if True:
        import resource
        import numpy as np
        from radarsim.engine.collect import collect

        class Light:
            identity, block, size = "ab", 4096, 500
            def simulate(self, first, count):
                return np.full(500, float(first))

        def peak_mb(realisations):
            collect(Light(), realisations, threads=2)
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

        print(peak_mb(10**6), peak_mb(10**9))
    """
    small, large = subprocess.check_output([sys.executable, "-c", program], text=True).split()
    assert float(large) - float(small) < 10


@pytest.mark.parametrize("blocks_left", [1, 64, 4096])
def test_tasks_are_as_long_as_for_one_worker_while_none_is_connected(blocks_left):
    """All of a cluster's may have died at once: they are replaced."""
    levels = []
    for workers in (0, 1):
        executor = Serial()
        executor.workers = workers
        pace = Pace(executor)
        pace.note(1, 1e-3)
        levels.append(pace.level(blocks_left))
    assert levels[0] == levels[1]
