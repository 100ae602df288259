"""A work without radar for the engine's tests, its textbook twin, and a program that runs it to be killed."""

import argparse
import hashlib
import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from radarsim.engine.collect import collect
from radarsim.engine.stop_conditions import Signals
from radarsim.engine.store import writer as store_writer
from radarsim.engine.sums import Sums
from radarsim.system.threads import ThreadLimit


@dataclass(frozen=True)
class Fake:
    """Numbers of very different size, so that any other order of addition gives other bytes."""

    identity: str = "ab12"
    block: int = 16
    size: int = 5
    pause_s: float = 0.0
    stuck_at: int = -1
    bad: int = -1

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums over realisations first … first+count-1, added one after the other."""
        if self.pause_s:
            time.sleep(60 if first <= self.stuck_at < first + count else self.pause_s)
        i = np.arange(first, first + count)[:, None] + 1.0
        numbers = np.sin(i * (1.3 + np.arange(self.size))) * 10.0 ** (i * 7 % 13)
        if first <= self.bad < first + count:
            numbers[self.bad - first, -1] = np.nan
        return np.add.reduce(numbers, axis=0)


@cache
def textbook(work: Fake, realisations: int) -> np.ndarray:
    """The total by the words of the contract: halves of a binary tree over block numbers, then the cut block."""

    def tree(blocks):
        half = len(blocks) // 2
        return tree(blocks[:half]) + tree(blocks[half:]) if half else work.simulate(blocks[0] * work.block, work.block)

    full, rest = divmod(realisations, work.block)
    parts, first = [], 0
    for digit in range(full.bit_length() - 1, -1, -1):
        if full >> digit & 1:
            parts.append(tree(range(first, first + (1 << digit))))
            first += 1 << digit
    if rest:
        parts.append(work.simulate(full * work.block, rest))
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


WORK = Fake()
N = 5_005  # 312 blocks of 16, in nodes of 256, 32, 16 and 8, and 13 realisations
NAMES = ["L03-38.sums", "L04-18.sums", "L05-8.sums", "L08-0.sums", "P312-13.sums", "T5005.sums"]


def names(directory: Path) -> list[str]:
    """File names, sorted."""
    return sorted(path.name for path in directory.iterdir())


def contents(directory: Path) -> dict[str, bytes]:
    """What the files hold."""
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def same(result: Sums, realisations: int = N) -> bool:
    """Whether a result is of so many realisations and has the bytes of the textbook."""
    return result.count == realisations and result.values.tobytes() == textbook(WORK, realisations).tobytes()


def say(*words: object) -> None:
    """A line to whoever started the process."""
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Run in a process of its own; says `running` when a tenth is done, and at the end count and digest of the sums."""
    parser = argparse.ArgumentParser()
    parser.add_argument("store")
    parser.add_argument("realisations", type=int)
    parser.add_argument("--pause", type=float, default=0.0)
    parser.add_argument("--stuck-at", type=int, default=-1)
    parser.add_argument("--period", type=float, default=store_writer.PERIOD_S)
    parser.add_argument("--linger", action="store_true")
    parser.add_argument("--threads", type=int, default=2)
    asked = parser.parse_args()
    store_writer.PERIOD_S = asked.period
    said = []

    def progress(done: int, total: int, from_store: int) -> None:
        if done >= total / 10 and not said:
            said.append(say("running"))

    with ThreadLimit(asked.threads), Signals() as signals:
        if asked.linger:
            say("running")
            time.sleep(60)
        work = Fake(pause_s=asked.pause, stuck_at=asked.stuck_at)
        result = collect(
            work, asked.realisations, store=asked.store, threads=asked.threads, progress=progress, stop=signals
        )
        say(result.count, hashlib.sha256(result.values.tobytes()).hexdigest(), *result.warnings)
        sys.exit(128 + signals.received_signal if signals.received_signal else 0)


if __name__ == "__main__":
    main()
