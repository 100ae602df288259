"""Faults of meaning: that each has its place and its test, that one is noticed, and what no other test looks at."""

import importlib

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.engine.sums import Layout
from radarsim.studies.noise import noise_key
from tests.trust import faults


@pytest.mark.parametrize("name", faults.FAULTS)
def test_every_fault_has_its_function_and_its_test(name):
    one = faults.FAULTS[name]
    module, _, function = one.place.partition(":")
    held = importlib.import_module(module)
    for part in function.split("."):
        held = getattr(held, part)
    assert callable(held)
    path, _, test = one.test.partition("::")
    assert hasattr(importlib.import_module(path.removesuffix(".py").replace("/", ".")), test or "__file__")


@pytest.mark.slow
def test_a_fault_is_noticed_and_its_absence_is_not(tmp_path):
    one = faults.FAULTS["one_degree_of_freedom_too_many"]
    assert faults.notices("one_degree_of_freedom_too_many", one.test, str(tmp_path))
    assert not faults.notices(None, one.test, str(tmp_path))


def test_seeds_and_streams_have_noise_of_their_own():
    keys = {
        noise_key(load("rls2", [f"seed={seed}"]).cases[0], what).tobytes() for seed in (1, 2) for what in ("a", "b")
    }
    assert len(keys) == 4


def test_what_is_packed_is_unpacked():
    layout = Layout(first=(2, 3), other=(6,))
    arrays = {"first": np.arange(6.0).reshape(2, 3), "other": np.arange(6.0, 12.0)}
    unpacked = layout.unpack(layout.pack(**arrays))
    assert all(np.array_equal(unpacked[name], arrays[name]) for name in arrays)
