"""The machine and the libraries that decide the last bits of sums, and their versions."""

import functools
import os
import platform as system
import sys
from importlib import metadata

# Those that change which fused or vector instructions a compiler chooses, from the widest.
_DECIDING_FLAGS = ("avx512f", "avx2", "fma", "avx", "sse4_2", "asimd")


@functools.cache
def instruction_set() -> str:
    """The instruction set, like `x86_64 avx512f avx2 fma`; with equal ones sums are equal to the last bit. If the
    compiler targets another processor (NUMBA_CPU_NAME), that is named, since it decides instead; so are features
    disabled for NumPy (NPY_DISABLE_CPU_FEATURES)."""
    target, disabled = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NPY_DISABLE_CPU_FEATURES")
    flags = set(_processor_flags())
    parts = [system.machine(), *(flag for flag in _DECIDING_FLAGS if flag in flags)]
    parts += [f"aiming at {target}"] if target else []
    return " ".join([*parts, f"NumPy without {disabled}"] if disabled else parts)


def _cpuinfo() -> list[str]:
    """The lines in which Linux describes the first processor; empty elsewhere."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            return file.read(8192).splitlines()
    except OSError:
        return []


def _processor_flags() -> list[str]:
    """Features of the first processor, as Linux lists them; empty elsewhere."""
    return next((line.split() for line in _cpuinfo() if line.startswith(("flags", "Features"))), [])


@functools.cache
def processor() -> str:
    """The processor's name; empty where the system does not say."""
    names = [line.partition(":")[2].strip() for line in _cpuinfo() if "model name" in line]
    return names[0] if names else system.processor()


def available_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@functools.cache
def machine_facts() -> dict[str, object]:
    """The machine for a reader: system, processor, cores."""
    return {
        "system": system.platform(),
        "processor": processor(),
        "architecture": system.machine(),
        "cores": available_cores(),
        "byteorder": sys.byteorder,
    }


@functools.cache
def linear_algebra() -> str:
    """The BLAS library that NumPy has loaded, and the processor of its kernels, like `openblas SkylakeX`. The
    processor, or OPENBLAS_CORETYPE, selects the kernels; the order of sums differs between them."""
    from threadpoolctl import threadpool_info

    libraries = {
        f"{library['internal_api']} {library.get('architecture', '')}".strip()
        for library in threadpool_info()
        if library["user_api"] == "blas"
    }
    return ", ".join(sorted(libraries))


LIBRARIES = ("numba", "llvmlite", "numpy", "scipy")  # that compile and compute


@functools.cache
def platform() -> dict[str, str]:
    """All that decides the last bits: processor, instruction set, BLAS, and the versions of compiler and libraries."""
    hardware = {"processor": processor(), "instruction_set": instruction_set(), "linear_algebra": linear_algebra()}
    return hardware | {name: metadata.version(name) for name in LIBRARIES}


@functools.cache
def platform_name() -> str:
    """The platform in one line, as in the header of stored sums: equal lines, equal bytes."""
    libraries = ", ".join(f"{name} {platform()[name]}" for name in LIBRARIES)
    return f"{processor() or 'unknown processor'}: {instruction_set()}; {linear_algebra()}; {libraries}"


def versions() -> dict[str, str]:
    """Versions of Python and of the loaded libraries that compute."""
    libraries = {name: sys.modules[name].__version__ for name in ("numpy", "numba") if name in sys.modules}
    return {"python": system.python_version()} | libraries
