"""The tests of computed numbers as other processors compute them: `python -m tests.trust.processors [all] [-n 2 …]`.

BLAS kernels, NumPy's loops and the compiler's target are those of an older processor, one after another, each in a
process of its own, with kernels of its own. With `all` every test that compares numbers is run, else a selection that
every change has time for; other words go to pytest.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
# What this NumPy has further loops for, and this processor runs; it knows no other names.
FEATURES = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
WIDE = tuple(name for name in FEATURES if name.startswith(("AVX512", "X86_V4")))


class Processor(NamedTuple):
    """An older processor: the compiler's target, OpenBLAS's kernels, and what NumPy does without."""

    target: str
    core: str
    disabled: tuple[str, ...]

    def environment(self) -> dict[str, str]:
        """The variables that a process reads when it starts."""
        names = {"NUMBA_CPU_NAME": self.target, "OPENBLAS_CORETYPE": self.core}
        return names | {"NPY_DISABLE_CPU_FEATURES": " ".join(self.disabled)}


PROCESSORS = {
    "usual": Processor("x86-64-v3", "Haswell", WIDE),  # AVX2 and fused multiply-adds
    "old": Processor("generic", "Prescott", tuple(FEATURES)),  # SSE2: no fused multiply-add
}
# Folders of tests that compare computed numbers: the others are of texts, files and processes.
NUMERICAL = ("api", "kernels", "physics", "recordings", "report", "studies", "trust")
# Of them, what reaches most formulas in least time, 100 s of a processor: primitives, designs, exact values, and
# bursts, in whose searches roundings grow.
PRIMITIVES = ("test_algebra.py", "test_lanes.py", "test_linear.py", "test_random.py", "test_tracing.py")
DESIGNS = ("test_exact.py", "test_filters.py", "test_closed_form.py", "test_recursion.py")
BURSTS = ("discriminator/test_kernels.py", "pulses_to_tracks/test_kernels.py")


def selection() -> list[Path]:
    """The files that run after every change."""
    kernels, studies = ROOT / "tests/kernels", ROOT / "tests/studies"
    designs = [path for path in sorted(studies.rglob("test_*.py")) if path.name in DESIGNS]
    return [
        *(kernels / name for name in PRIMITIVES),
        ROOT / "tests/physics",
        *designs,
        *(studies / name for name in BURSTS),
    ]


def run_tests(name: str, words: list[str]) -> int:
    """Pytest's exit code as this processor computes it."""
    folders = [ROOT / "tests" / part for part in NUMERICAL] if "all" in words else selection()
    processor = PROCESSORS[name]
    sys.stdout.write(f"{name} processor: {processor.target}, {processor.core}\n")
    sys.stdout.flush()
    command = [sys.executable, "-m", "pytest", *(word for word in words if word != "all"), *map(str, folders)]
    return subprocess.run(command, env=os.environ | processor.environment(), cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(max(run_tests(name, sys.argv[1:]) for name in PROCESSORS))
