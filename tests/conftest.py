"""How the suite is divided among processes: `make test` gives each a group of tests, `pytest` alone runs them in turn.

A group is a file, so that what its tests share is made once; the tests of a study are one group, so that its kernels
are compiled once. Groups that take long begin first, those of the studies before others: what they compile, the
others read from the cache of kernels.
"""

import fnmatch
import gc
import os
from collections import defaultdict

import pytest
from hypothesis import HealthCheck, settings

from tests.forked_programs import Start
from tests.variables import CLEARED

# Folders, in the order in which their groups begin; what is short is left for the end, where processes wait.
LONG = ("studies", "trust", "cli", "api", "engine", "docs", "report", "language", "kernels", "recordings")

for name in CLEARED:
    os.environ.pop(name, None)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does; no module of tests has loaded NumPy yet
# What Hypothesis tests are laws, which hold on a machine that is busy, too: it looks at no clock.
settings.register_profile("no clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no clock")
os.fsync = lambda descriptor: None  # what it is for no test can try: a power cut; it takes 2 ms, thousands of times
gc.set_threshold(100_000)  # as the command does; of the suite's time 7 % went into looking through objects that stay


def group_of(nodeid: str) -> str:
    """The folder of a study's tests, or the file: the beginning of a test's name."""
    folder, *rest = nodeid.partition("::")[0].removeprefix("tests/").split("/")
    return "/".join([folder, *(rest[:1] if folder == "studies" else rest)])


def rank_of(item: pytest.Item) -> tuple[int, bool]:
    """Where a group stands in the order: by its folder, in `studies` those of several files first."""
    folder, _, rest = group_of(item.nodeid).partition("/")
    return LONG.index(folder) if folder in LONG else len(LONG), rest.endswith(".py")


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the slow cases of a test; put groups in their order, in a process that is given tests by another."""
    mark_slow_cases(items, whole=not any("[" in word for word in config.args))
    if hasattr(config, "workerinput"):
        items.sort(key=rank_of)


def mark_slow_cases(items: list[pytest.Item], whole: bool) -> None:
    """Mark as slow the cases that `slow_cases` names, with * for any text, or all but those of `slow_cases_except`.

    Raises UsageError for a name that no case has, where all cases are there: a renamed one would change its side."""
    cases = defaultdict(list)
    for item in items:
        if hasattr(item, "callspec"):
            cases[item.nodeid.partition("[")[0]].append(item)
    for name, group in cases.items():
        for mark in group[0].iter_markers():
            if not mark.name.startswith("slow_cases"):
                continue
            for pattern in mark.args:
                if whole and not fnmatch.filter([item.callspec.id for item in group], pattern):
                    raise pytest.UsageError(f"{name}: no case is named {pattern}")
            for item in group:
                is_named = any(fnmatch.fnmatchcase(item.callspec.id, pattern) for pattern in mark.args)
                if is_named == (mark.name == "slow_cases"):
                    item.add_marker(pytest.mark.slow)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """Give each process whole groups, where `--dist loadscope` asks for it.

    Not by the marks of `--dist loadgroup`: pytest-xdist 3.8 writes them where pytest 9.2 no longer reads, and without a
    word each process gets a part of each group, makes what its tests share and compiles its kernels.
    """
    if config.getvalue("dist") != "loadscope":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class GroupScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

    return GroupScheduling(config, log)


def pytest_collection_finish() -> None:
    """The tests themselves stay to the end: no collection looks through them."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def command_line():
    """Faults as a command words them, which name its options."""
    from radarsim.errors import ON_COMMAND_LINE

    before = ON_COMMAND_LINE.set(True)
    yield
    ON_COMMAND_LINE.reset(before)


@pytest.fixture(scope="session")
def warm(tmp_path_factory):
    """Processes that have imported radarsim already."""
    with Start(tmp_path_factory.mktemp("printed")) as start:
        yield start


@pytest.fixture(scope="session")
def libraries(tmp_path_factory):
    """Processes that have imported only what radarsim imports."""
    with Start(tmp_path_factory.mktemp("printed"), radarsim=False) as start:
        yield start
