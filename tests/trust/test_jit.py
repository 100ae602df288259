"""Compiled kernels against plain Python, kernel by kernel; this processor's machine code against the common one."""

import inspect
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from radarsim.kernels import compiler, lane_programs, lanes
from tests.tolerances import rounding
from tests.trust import plain_lanes
from tests.trust import sums_without_compiler as plain

OPERATIONS = 100  # between a number that is drawn and one that is compared: steps of a filter, a sum over realisations
AGREED = rounding(50, OPERATIONS)  # κ of a plot's covariance, see `plain.EVEN`, and of designed filters: 1.1·10⁻¹²
# Runs that multiply rounding more. Covariances of each realisation's own, from a start of κ near 10⁴ (in the plane:
# of the first velocity, which is measured along the line of sight alone); weights of
# hypotheses are exponentials of up to −50, which multiplies a relative error by 50. A likelihood begins with variances
# of 10⁹ beside plots of 1 … 10⁴. eᵀP⁻¹e of a parabola extrapolated over the scans that all miss: κ of P is 6·10⁴ with
# every plot before them and grows as more are missed at random.
MISSING = "linear with misses", "linear, drawn flight"
SOLVED = (*MISSING, "folds", "folds missed", "orders", "folds and orders", "tracks", "likelihoods", "patterns", "plane")
OWN = dict.fromkeys((*SOLVED, "sonar missed/joint"), rounding(5e3, OPERATIONS))
ROOT = Path(__file__).parents[2]
MOMENTS = ("error", "error_all", "ahead")  # Σe, Σe², Σe³, Σe⁴ in the last axis
BURSTS = [name for name in plain.RUNS if name.startswith("discriminator")]
SAMPLES = 128  # of a window: each is a product and a term of a sum
LOCK = 5.0  # potential σ that a locked component is within
LEAST = 1e-6  # of a p-value


def elsewhere(path, **environment):
    """The arrays of `tests.trust.sums_without_compiler` from an interpreter of its own."""
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.trust.sums_without_compiler", str(path)],
        env=os.environ | {"PYTHONPATH": paths} | environment,
        cwd=ROOT,
        check=True,
    )
    with np.load(path) as arrays:
        return dict(arrays)


def apart(name, one, other):
    """Largest difference of two arrays, in sizes of what is summed: a power's relative error is the error's, times it.

    Sums over realisations of (F, K, …): the size is the largest over filters and scans, by component.
    """
    if name.endswith(MOMENTS):
        power = np.arange(1, 5)
        size = power * np.abs(other[..., 3:]).max(axis=(0, 1), keepdims=True) ** (power / 4)
    else:
        size = np.abs(other).max(axis=(0, 1) if other.ndim > 2 else None, keepdims=True)
    return float((np.abs(one - other) / np.where(size > 0, size, 1)).max())


def assert_same_bursts(one, other):
    """What arithmetic defines of bursts: which lock, and where those end that have locked at every window.

    A search from beyond the main lobe passes slopes on which the last bits grow from step to step, so that where one
    without lock ends is not defined; only how large such ends are, as their law has it.
    """
    lost = []
    for run in BURSTS:
        found, expected = one[f"{run}/bursts"], other[f"{run}/bursts"]
        allowed = rounding(other[f"{run}/condition"], 2 * SAMPLES)
        sizes = np.abs(found).max(axis=-1), np.abs(expected).max(axis=-1)
        locks = [size < LOCK for size in sizes]
        near = np.abs(sizes[1] - LOCK) <= allowed.max(axis=-1)
        np.testing.assert_array_equal(locks[0] | near, locks[1] | near, run)
        settled = np.logical_and.accumulate(locks[0] & locks[1], axis=2)
        off = np.abs(found - expected) / np.where(allowed > 0, allowed, 1)
        assert off[settled].max(initial=0) <= 1, run
        always = settled.all(axis=2)
        np.testing.assert_array_equal(one[f"{run}/passes"][always], other[f"{run}/passes"][always], run)
        lost.append([size[~(locks[0] | locks[1])] for size in sizes])
    assert stats.ks_2samp(*map(np.concatenate, zip(*lost, strict=True))).pvalue > LEAST


def assert_agree(one, other):
    """All sums to their rounding; bursts as `assert_same_bursts` has it."""
    own = {f"{run}/{name}" for run in BURSTS for name in ("bursts", "passes", "condition")}
    wide = {name: apart(name, one[name], array) for name, array in other.items() if name not in own}
    allowed = {name: OWN.get(name, OWN.get(name.partition("/")[0], AGREED)) for name in wide}
    assert {name: size for name, size in wide.items() if not size <= allowed[name]} == {}
    assert_same_bursts(one, other)


def functions_of(module):
    """The public functions that a module defines."""
    return {
        name: function
        for name, function in vars(module).items()
        if inspect.isfunction(function) and function.__module__ == module.__name__ and not name.startswith("_")
    }


def test_all_that_only_a_compiler_understands_has_its_replacement():
    """And each replacement is of a name that is there: the long test below is seldom run."""
    assert {name for name, value in vars(lanes).items() if isinstance(value, type(lanes.get))} == set(plain_lanes.LANES)
    assert set(functions_of(lane_programs)) == set(plain_lanes.LANE_PROGRAMS)
    decorators = functions_of(compiler).items()
    assert {name for name, function in decorators if [*inspect.signature(function).parameters] == ["function"]} == set(
        plain.DECORATORS
    )


@pytest.mark.slow
def test_every_kernel_in_plain_python(tmp_path):
    """Without compiler, registers replaced by plain floats: the same numbers but for fused multiply-adds."""
    arrays = elsewhere(tmp_path / "plain.npz", NUMBA_DISABLE_JIT="1")
    assert plain.kernels_of_source() - set(arrays.pop("kernels_that_ran")) == set()
    assert_agree(arrays, plain.numbers())


@pytest.mark.slow
def test_every_kernel_for_the_common_processor(tmp_path):
    """Compiled without this processor's wide registers and fused multiply-adds, in a cache of its own."""
    generic = {"NUMBA_CPU_NAME": "generic", "RADARSIM_CACHE_DIR": str(tmp_path / "cache")}
    found = elsewhere(tmp_path / "generic.npz", **generic)
    assert_agree({name: array for name, array in found.items() if name != "kernels_that_ran"}, plain.numbers())
    assert any(path.is_file() for path in (tmp_path / "cache").glob("kernels-*/**/*"))
