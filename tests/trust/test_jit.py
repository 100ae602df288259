"""Compiled kernels against plain Python, kernel by kernel; this processor's machine code against the common one."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.trust import plain

AGREED = 1e-12
# Runs that multiply rounding more. Covariances of each realisation's own, from a start of κ near 10⁴, so κε = 2·10⁻¹²;
# weights of hypotheses are exponentials of up to −50, which multiplies a relative error by 50. A likelihood begins
# with variances of 10⁹ beside plots of 1 … 10⁴.
MISSING = "linear with misses", "linear, drawn flight"
SOLVED = (*MISSING, "folds", "folds missed", "orders", "folds and orders", "tracks", "patterns")
# eᵀP⁻¹e of a parabola extrapolated over the scans that all miss: κ of P is 6·10⁴ with every plot before them and grows
# as more are missed at random, so κε is some 10⁻¹¹ of the value and twice that of its square.
OWN = dict.fromkeys((*SOLVED, "sonar missed/joint"), 1e-10)
ROOT = Path(__file__).parents[2]
MOMENTS = ("error", "error_all", "ahead")  # Σe, Σe², Σe³, Σe⁴ in the last axis


def elsewhere(path, **environment):
    """The arrays of `tests.trust.plain` from an interpreter of its own."""
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.trust.plain", str(path)],
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
        size = np.maximum(size, 1.0) if name.startswith("discriminator") else size  # errors over potential σ
    else:
        size = np.abs(other).max(axis=(0, 1) if other.ndim > 2 else None, keepdims=True)
    return float((np.abs(one - other) / np.where(size > 0, size, 1)).max())


LOST = "discriminator on block sums/error_all"  # sums over bursts of which some do not lock


def assert_agree(one, other):
    """All sums to 10⁻¹²; but where a search without lock ends, rounding has its say, and bursts are taken one by one.

    A search from beyond the main lobe passes slopes on which the last bits grow from step to step. Of 48 ends, 4 were
    further apart than 10⁻¹² (by at most 9·10⁻⁶ of the error), the same ones in plain Python and for the common
    processor. So: five of six to 10⁻¹², and none elsewhere by a thousandth of a potential spread, or of its error.
    """
    wide = {name: apart(name, one[name], array) for name, array in other.items() if name not in (LOST, "bursts/each")}
    allowed = {name: OWN.get(name, OWN.get(name.partition("/")[0], AGREED)) for name in wide}
    assert {name: size for name, size in wide.items() if not size <= allowed[name]} == {}
    found, expected = one["bursts/each"], other["bursts/each"]
    off = (np.abs(found - expected) / np.maximum(np.abs(expected), 1.0)).max(axis=-1)
    assert np.mean(off <= AGREED) >= 5 / 6
    assert off.max() < 1e-3


def test_every_kernel_in_plain_python(tmp_path):
    """Without compiler, registers replaced by plain floats: the same numbers but for fused multiply-adds."""
    found = elsewhere(tmp_path / "plain.npz", NUMBA_DISABLE_JIT="1")
    never = set(found.pop("there")) - set(found.pop("ran"))
    assert never == set()
    assert_agree(found, plain.numbers())


@pytest.mark.slow
def test_every_kernel_for_the_common_processor(tmp_path):
    """Compiled without this processor's wide registers and fused multiply-adds, in a cache of its own."""
    generic = {"NUMBA_CPU_NAME": "generic", "RADARSIM_CACHE_DIR": str(tmp_path / "cache")}
    found = elsewhere(tmp_path / "generic.npz", **generic)
    assert_agree({name: array for name, array in found.items() if name not in ("ran", "there")}, plain.numbers())
    assert any(path.is_file() for path in (tmp_path / "cache").glob("kernels-*/**/*"))
