"""How every kernel is compiled, and where its machine code is kept.

Numba's cache on disk looks at the file of the compiled function alone: an edit of a function that it calls, in another
file, goes unnoticed and gives silently wrong results. So the cache directory is named after a hash of all kernel
sources.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numba
from numba import config, njit
from numba.core.codegen import get_host_cpu_features

# No `reassoc` (part of fastmath=True): it folds rounding tricks such as (x + M) - M and changes the order of sums.
FLAGS = frozenset({"contract", "arcp", "nsz", "nnan", "ninf"})


# LLVM prefers 256-bit vectors on Intel machines that have 512-bit ones. Measured on a Cascade Lake: 0.58 of the hand-written
# AVX-512 C with its preference, 1.00 without. A machine without AVX-512, or a user's own setting, is left as it is.
if config.CPU_FEATURES is None and "+avx512f" in get_host_cpu_features():
    config.CPU_FEATURES = get_host_cpu_features() + ",-prefer-256-bit"


def sources_hash() -> str:
    """SHA-256 over the names and contents of all kernel sources, and Numba's version."""
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def cache_root() -> Path:
    """The first writable of $RADARSIM_CACHE_DIR, $XDG_CACHE_HOME/radarsim, ~/.cache/radarsim, the temporary directory."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    candidates = [os.environ.get("RADARSIM_CACHE_DIR"), os.path.join(home, "radarsim")]
    for candidate in filter(None, candidates):
        try:
            Path(candidate).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=candidate):
                return Path(candidate)
        except OSError:
            continue
    return Path(tempfile.gettempdir()) / f"radarsim-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"


CACHE_DIRECTORY = cache_root() / f"kernels-{sources_hash()[:16]}"


def compiler(**options) -> Callable:
    """A decorator that compiles with `options`, cached in CACHE_DIRECTORY; other users of Numba keep their own."""

    def decorate(function):
        before = config.CACHE_DIR
        config.CACHE_DIR = str(CACHE_DIRECTORY)
        try:
            return njit(error_model="numpy", cache=True, **options)(function)
        finally:
            config.CACHE_DIR = before

    return decorate


inline = njit(fastmath=set(FLAGS), error_model="numpy", forceinline=True)
kernel = compiler(fastmath=set(FLAGS), nogil=True)
# Reassociation is allowed only where it lets independent sums run in vector registers; the code fixes their order.
summing = compiler(fastmath=set(FLAGS | {"reassoc"}), nogil=True)
