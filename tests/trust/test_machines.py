"""The same numbers on other processors: as other BLAS kernels, NumPy loops and compiler targets give them.

`radarsim doctor` compares a small case of every study with its known answer, each number to what its conditioning
allows. The noise is part of that: another sample would differ by a σ.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from radarsim.api.maintenance.self_test import TOLERANCES
from radarsim.bursts.kernels.signal import triangular_root
from radarsim.engine.machine import _processor_flags
from tests.tolerances import assert_rounded
from tests.trust.processors import FEATURES, PROCESSORS

NARROW = " ".join(FEATURES)
CORES = ("Haswell", "SkylakeX", "Zen", "Prescott")
TARGETS = ("generic", "haswell", "skylake-avx512")


def can_run(name):
    """Whether this processor has the instructions that a BLAS kernel or a compiler target asks for."""
    flags = set(_processor_flags())
    return {"SkylakeX": "avx512f" in flags, "skylake-avx512": "avx512f" in flags}.get(name, "avx2" in flags)


def doctor(**environment):
    """The self-test in a process of its own, under other settings."""
    command = [sys.executable, "-W", "error::UserWarning", "-m", "radarsim", "doctor"]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, timeout=600)


def passes(**environment):
    done = doctor(**environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("the known") == len(TOLERANCES)


@pytest.mark.machines
@pytest.mark.parametrize("name", PROCESSORS)
def test_two_other_processors_give_the_same_answers(name):
    passes(**PROCESSORS[name].environment())


@pytest.mark.slow
@pytest.mark.parametrize("core", list(filter(can_run, CORES)))
@pytest.mark.parametrize("target", [*filter(can_run, TARGETS), "host"])
@pytest.mark.parametrize("without", ["", NARROW], ids=["all features", "without AVX"])
def test_other_processors_give_the_same_answers(core, target, without):
    passes(
        OPENBLAS_CORETYPE=core,
        NPY_DISABLE_CPU_FEATURES=without,
        **({} if target == "host" else {"NUMBA_CPU_NAME": target}),
    )


def test_the_root_of_the_noise_is_unique():
    """What a processor may choose (signs, the order of eigenvalues, directions where they are equal) is not in it."""
    draw = np.random.default_rng(7)
    for rank in (4, 3, 2, 1):
        for _ in range(50):
            L = np.tril(draw.uniform(-1, 1, (4, 4)))
            L[np.diag_indices(4)] = draw.uniform(0.3, 1, 4)
            L[:, rank:] = 0.0
            L *= 10.0 ** draw.uniform(-6, 6, (4, 1))  # rows in units of their own
            size = np.linalg.norm(L, axis=1, keepdims=True)  # of a row: its elements may be small beside it
            singular = np.linalg.svd(L / size, compute_uv=False)[:rank]
            condition = (singular[0] / singular[-1]) ** 2  # κ of L Lᵀ in units of its rows
            assert_rounded(triangular_root(L @ L.T), L, np.broadcast_to(size, L.shape), condition, operations=8)
    equal, L = np.zeros((4, 4)), np.zeros((4, 4))
    equal[:2, :2], L[:2, 0] = 4.0, 2.0
    np.testing.assert_array_equal(triangular_root(equal), L)
