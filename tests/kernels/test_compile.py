"""The compiler's settings: cache by the hash of all sources, wide registers, the same numbers in plain Python."""

import operator
import os
import subprocess
import sys
import textwrap
import types
import weakref
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core.registry import cpu_target
from numba.core.typing import Context

from radarsim.kernels import cache, call_graph, compiler, kalman_algebra, numba_internals, numba_options
from radarsim.kernels.numba_internals import remembering_context

SOURCES = Path(compiler.__file__).parent
MACHINERY = tuple(
    f"{module.__name__.rpartition('.')[2]}.py"
    for module in (kalman_algebra, cache, call_graph, compiler, numba_internals, numba_options)
)


def python(code, **environment):
    """Standard output of a fresh interpreter."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"} | environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def house(tmp_path):
    """A package with copies of what compiles, a helper file, a kernel that uses it, and a cache."""
    kernels = tmp_path / "copied" / "kernels"
    kernels.mkdir(parents=True)
    for name in MACHINERY:
        (kernels / name).write_text((SOURCES / name).read_text().replace("radarsim.kernels", "copied.kernels"))
    begin = "from copied.kernels"
    (kernels / "helper.py").write_text(f"{begin}.compiler import inline\n@inline\ndef grown(x):\n    return x + 1.0\n")
    (kernels / "user.py").write_text(
        f"{begin}.compiler import kernel\n{begin}.helper import grown\n@kernel\ndef use(x):\n    return grown(x)\n"
    )
    return tmp_path


USE = """
    from copied.kernels.user import use
    print(use(1.0), sum(use.stats.cache_hits.values()), use._cache.cache_path)
"""


def used(house):
    """What the kernel returns, whether its machine code came from the cache, and the cache's directory."""
    out = python(USE, PYTHONPATH=str(house), RADARSIM_CACHE_DIR=str(house / "cache"))
    value, hits, directory = out.split()
    return float(value), int(hits), directory


@pytest.mark.slow
def test_an_edited_helper_is_noticed_and_a_file_beside_is_not(house):
    """Numba itself would return 2 again: the file of `use` has not changed."""
    first = used(house)
    assert first[:2] == (2.0, 0)
    (house / "copied" / "kernels" / "further.py").write_text("")
    assert used(house) == (2.0, 1, first[2])
    helper = house / "copied" / "kernels" / "helper.py"
    helper.write_text(helper.read_text().replace("1.0", "5.0"))
    edited = used(house)
    assert edited[:2] == (6.0, 0)
    assert edited[2] != first[2]
    assert Path(edited[2]).parent == house / "cache"


def test_other_users_of_numba_keep_their_cache():
    before = numba.config.CACHE_DIR

    @compiler.kernel
    def twice(x):
        return 2 * x

    assert before == numba.config.CACHE_DIR
    assert twice(4) == 8


@pytest.mark.skipif(
    "+avx512f" not in cpu_target.target_context.codegen()._tm_features, reason="no registers of 512 bits"
)
def test_loops_use_wide_registers():
    def scaled(x):
        for i in range(x.size):
            x[i] = 1.5 * x[i]

    options = {"fastmath": set(compiler.FAST_MATH_FLAGS), **numba_internals.COMMON}
    function = numba.njit(**options)(scaled)
    function(np.ones(8))
    (assembly,) = function.inspect_asm().values()
    assert "zmm" in assembly


def test_functions_without_an_entry_refuse_python():
    """They stay untranslated until a kernel needs them; Python gets an error, no crash; a formula it calls as it is."""

    @compiler.kernel_part
    def halved(x):
        return x / 2

    @compiler.inline
    def grown(x):
        return halved(x) + 1

    @compiler.inline
    def doubled(x):
        return 2 * x

    @compiler.inline
    def squared(x):
        return doubled(x) * x / 2

    for function in (halved, grown):
        with pytest.raises(TypeError, match="not callable"):
            function(4.0)
    assert compiler.kernel(lambda x: grown(x))(4.0) == 3.0
    assert compiler.kernel(lambda x: squared(x))(4.0) == squared(4.0) == 16.0
    assert (squared(np.array([1.0, 2.0])) == [1.0, 4.0]).all()


def test_a_kernel_that_another_calls_is_compiled_for_it_apart(monkeypatch):
    """Without an entry and machine code of its own, until Python calls it; it gives both the same bytes."""
    for module in (call_graph, numba_internals):  # so not from a cache
        monkeypatch.setattr(module, "module_digest", lambda name: "")

    @compiler.kernel
    def total(x):
        out = 0.0
        for i in range(x.size):
            out += x[i] * 0.1
        return out

    @compiler.kernel
    def twice(x):
        return 2.0 * total(x)

    x = np.random.default_rng(1).normal(size=37)
    outer = twice(x)
    assert not total.signatures
    assert twice.signatures
    assert outer == 2.0 * total(x)
    assert total.signatures


def test_the_type_of_an_operation_is_found_once(monkeypatch):
    """However often it stands in kernels; what Numba compiles on the way is asked for each time, as it was."""
    asked = []
    for module in (call_graph, numba_internals):  # so not from a cache
        monkeypatch.setattr(module, "module_digest", lambda name: "")
    monkeypatch.setattr(remembering_context(cpu_target.typing_context), "_signatures", {})
    numba_finds = Context.resolve_function_type

    def counted(self, func, args, kws):
        asked.append(getattr(func, "typing_key", func))
        return numba_finds(self, func, args, kws)

    monkeypatch.setattr(Context, "resolve_function_type", counted)

    def powers(x, flags):
        y = x % 3.5
        y = y % 3.5 % 3.5 % 3.5 % 3.5
        return y if np.any(flags) or np.any(flags) else x

    for _ in range(2):  # a second kernel finds what the first has found
        assert compiler.kernel(types.FunctionType(powers.__code__, globals()))(5.0, np.ones(2, bool)) == 1.5
    assert asked.count(operator.mod) == 1
    assert asked.count(np.any) > 2


def test_numba_takes_a_context_with_a_memory_for_its_own():
    """Else its caches would hold everything twice; and what is added to the one is in the other."""
    context = cpu_target.typing_context
    found = remembering_context(context)
    assert found is remembering_context(context)
    assert (found == context, context == found, hash(found)) == (True, True, hash(context))
    assert found.__dict__ is context.__dict__


class Pair(NamedTuple):
    """Arrays as kernels take them."""

    first: np.ndarray
    second: np.ndarray


def chosen(pair, more):
    kept, total = pair.first, 0.0
    for i in range(pair.first.size):
        kept = pair.second if kept[i] > 0.0 else more[0]
        total += kept[i]
    return total


def test_references_to_a_kernels_arguments_are_not_counted():
    sums = types.FunctionType(chosen.__code__, {"__name__": "nowhere"})  # of no file, so not from a cache
    second, counted = np.arange(3.0), []
    for compiled in (numba.njit(sums), compiler.kernel(sums)):
        assert compiled(Pair(np.ones(3), second), (second, 1.0)) == 3.0
        [made] = compiled.overloads.values()
        [inner] = (one for one in made.library._final_module.functions if one.name == made.fndesc.mangled_name)
        counted.append(str(inner).count("@NRT_incref"))
    assert counted[0] > 0
    assert counted[1] == 0


def test_what_a_kernel_returns_is_counted():
    passed = types.FunctionType((lambda pair, x: (pair.first[1:], x)).__code__, {"__name__": "nowhere"})
    first = np.arange(1e6)
    rest, _ = compiler.kernel(passed)(Pair(first, first), 1.0)
    held = weakref.ref(first)
    del first
    assert held() is not None
    assert rest[-1] == 999_999.0
