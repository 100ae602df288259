"""What a kernel is compiled from: whatever changes its numbers changes its hash, in which its machine code is kept."""

import sys
from enum import Enum
from typing import NamedTuple

import numba
import numpy as np
import pytest

from radarsim.kernels.call_graph import source_hash, value_text
from radarsim.kernels.compiler import kernel


class Mode(Enum):
    ON = 1
    OFF = 2


class Gains(NamedTuple):
    first: float


def multiplication(factor):
    def multiply(x):
        return x * factor

    return multiply


@pytest.mark.parametrize(
    ("value", "other"),
    [
        (np.int64(3), np.int64(4)),
        (np.uint8(3), np.int16(3)),
        (np.float32(0.5), np.float32(0.25)),
        (np.bool_(True), np.bool_(False)),
        (np.complex64(1j), np.complex64(2j)),
        (Gains(np.float32(1)), Gains(np.float32(2))),
        (Mode.ON, Mode.OFF),
        (np.float32, np.float64),
        (np.dtype("f4"), np.dtype("f8")),
        (numba.float32, numba.float64),
        (None, 0),
    ],
)
def test_what_a_function_takes_from_the_one_that_made_it_counts(value, other):
    assert source_hash(multiplication(value)) != source_hash(multiplication(other))
    assert source_hash(multiplication(value)) == source_hash(multiplication(value))


def test_kernels_that_differ_in_a_number_of_numpys_have_machine_code_of_their_own():
    assert [kernel(multiplication(np.int64(factor)))(1.0) for factor in (3, 4)] == [3.0, 4.0]


def test_values_that_no_source_shows_count():
    """As they are computed at import, of a file or a variable of the environment."""
    first, second = (Enum("Mode", {"ON": number}) for number in (1, 2))
    assert value_text([("Mode", first)]) != value_text([("Mode", second)])
    assert value_text([("INTEGER", np.int64(1))]) != value_text([("INTEGER", np.int64(2))])


@pytest.fixture
def write_module(tmp_path, monkeypatch):
    """Writes a module of the user's: imported afresh."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        sys.modules.pop(name, None)
        sys.path_importer_cache.pop(str(tmp_path), None)
        return __import__(name)

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield write
    for path in tmp_path.glob("*.py"):
        sys.modules.pop(path.stem, None)


def test_a_module_of_the_users_beside_that_of_the_kernel_counts_and_an_edit_in_one_process_too(write_module):
    hashes = []
    for factor in (2, 3, 2):
        write_module("tools_of_kernel", f"def twice(x):\n    return {factor} * x\n")
        text = "import tools_of_kernel\ndef f(x):\n    return tools_of_kernel.twice(x)\n"
        kernels = write_module("module_of_kernel", text)
        hashes.append(source_hash(kernels.f))
    assert hashes[0] == hashes[2] != hashes[1]
