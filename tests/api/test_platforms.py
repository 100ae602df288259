"""Stores of another platform: reported once, compared as conditioning allows."""

import json

import pytest

import radarsim
from radarsim.api.maintenance import doctor
from radarsim.engine import executors
from radarsim.engine.machine import LIBRARIES, linear_algebra, platform_name, processor
from radarsim.engine.store.block_file import decode
from tests.engine.test_damage import reforged

BLOCK = 4096
ELSEWHERE = "Analytical Engine: brass; numba 0.1"


@pytest.fixture
def out(tmp_path):
    """A folder of results with rls2 in it."""
    ran(tmp_path)
    return tmp_path


def ran(out, config="rls2", n=2 * BLOCK, **more):
    return radarsim.run(config, realisations=n, out=out, figures=False, threads=1, **more)


def blocks(out):
    (identity,) = json.loads((out / "rls2" / "run.json").read_text())["identities"].values()
    return sorted((out / ".blocks" / identity).glob("*.sums"))


def moved_elsewhere(out, change=None):
    """The stored blocks as another platform might have made them."""
    for path in blocks(out):
        _, values = decode(path.read_bytes())
        reforged(path, platforms=[ELSEWHERE], values=values if change is None else change(values.copy()))


def test_a_header_names_what_decides_the_last_bits(out):
    header, _ = decode(blocks(out)[0].read_bytes())
    (named,) = header["platforms"]
    assert all(word in named for word in (processor(), linear_algebra(), *LIBRARIES))


@pytest.mark.parametrize("library", ["numpy", "numba"])
def test_another_version_is_another_platform(monkeypatch, library):
    from radarsim.engine import machine

    here = platform_name()
    monkeypatch.setattr(machine, "platform", lambda: {name: "9.9" if name == library else "1" for name in LIBRARIES})
    assert platform_name.__wrapped__() != here
    assert f"{library} 9.9" in platform_name.__wrapped__()


def test_a_run_says_once_that_its_store_was_begun_elsewhere(out):
    moved_elsewhere(out)
    more = [warning for warning in ran(out, n=4 * BLOCK).warnings if "platforms" in warning]
    assert len(more) == 1
    assert ELSEWHERE in more[0]
    assert platform_name() in more[0]
    (note,) = (note for note in doctor.inspect_result(out / "rls2").notes if "2 platforms" in note)
    assert ELSEWHERE in note


@pytest.mark.slow
def test_cases_that_were_all_begun_elsewhere_are_reported_in_one_line(tmp_path, monkeypatch):
    config = "rls2_manoeuvre_variance"
    with monkeypatch.context() as patch:
        patch.setattr(executors, "platform_name", lambda: ELSEWHERE)
        ran(tmp_path, config, BLOCK)
    warnings = ran(tmp_path, config, 2 * BLOCK).warnings
    assert len([warning for warning in warnings if "platforms" in warning]) == 1


@pytest.mark.parametrize(
    ("change", "sound"),
    [
        (None, True),
        (lambda values: values * (1 + 1e-14), True),
        (lambda values: values * (1 + 1e-8), False),
        (lambda values: -values, False),
    ],
)
def test_a_store_of_another_platform_is_compared_as_conditioning_allows(out, change, sound):
    moved_elsewhere(out, change)
    found = doctor.inspect_result(out / "rls2", recompute=1)
    assert bool(found.faults) != sound
    assert any(ELSEWHERE in note for note in found.notes)


def test_a_store_of_this_platform_is_compared_to_the_last_bit(out):
    assert not doctor.inspect_result(out / "rls2", recompute=1).faults
    for path in blocks(out):
        _, values = decode(path.read_bytes())
        reforged(path, values=values * (1 + 1e-15))
    assert doctor.inspect_result(out / "rls2", recompute=1).faults
