"""Which variables of the environment tests keep, and which they clear before anything runs."""

# They change what commands and interpreters answer; a test that needs one sets it.
CLEARED = (
    *("RADARSIM_LANGUAGE", "RADARSIM_NO_CODE", "_RADARSIM_COMPLETE"),
    *("COLUMNS", "LINES", "TERM", "NO_COLOR", "FORCE_COLOR"),
    *("PYTHONIOENCODING", "PYTHONOPTIMIZE", "PYTHONUNBUFFERED", "PYTHONWARNINGS"),
)
KEPT = {  # and why no answer depends on it
    "HOME": "where the cache of kernels lies",
    "XDG_CACHE_HOME": "where the cache of kernels lies",
    "RADARSIM_CACHE_DIR": "where the cache of kernels lies",
    "TMPDIR": "where temporary files lie",
    "PATH": "where programs lie",
    "PYTHONPATH": "where modules lie",
    "PYTHONDONTWRITEBYTECODE": "whether compiled modules stay",
    "NUMBA_CPU_NAME": "the processor that CI compiles for",
    "NPY_DISABLE_CPU_FEATURES": "the processor that CI compiles for",
    "NUMBA_DISABLE_JIT": "set by tests/trust/test_jit.py for processes of its own",
    "OPENBLAS_NUM_THREADS": "set by tests/conftest.py to what the command sets",
    "RADARSIM_FAULT": "set by tests/trust/faults.py for processes of its own",
}
