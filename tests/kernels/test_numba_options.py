"""A break of Numba's private half: kernels are compiled by public options, to the same numbers but for rounding."""

import json
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from radarsim.kernels import cache, compiler, numba_options
from radarsim.kernels.second_order import scan_value
from tests.kernels import hidden_numba
from tests.kernels.test_lanes import calculate, exponentials

ROOT = Path(__file__).parents[2]
EACH_NAME = """
import json, sys
from tests.kernels import hidden_numba
names = hidden_numba.private_names()
choices = {}
for name in sorted(names):
    for module in [module for module in sys.modules if module.partition(".")[0] == "radarsim"]:
        del sys.modules[module]
    hidden_numba.hide({name})
    from radarsim.kernels import cache, compiler
    choices[" ".join(name)] = [compiler.COMPILER.__name__, *cache.troubles.values()]
hidden_numba.hide(names)
from tests.kernels import test_numba_options
print(json.dumps([choices, test_numba_options.numbers()]))
"""


@compiler.kernel
def follow(x, z, gain):
    for _ in range(3):
        scan_value(x, z, 0.5, gain)


def numbers():
    """What kernels of lanes, of formulas and of parts give."""
    rng = np.random.default_rng(1)
    results, powers, states = np.zeros(56), np.zeros(8), rng.normal(size=(3, 40))
    calculate(rng.normal(size=8), rng.normal(size=8), results)
    exponentials(rng.normal(size=8), powers)
    follow(states, rng.normal(size=40), rng.normal(size=(3, 2)))
    return [*results.tolist(), *powers.tolist(), *states.ravel().tolist()]


def test_only_one_file_leans_on_what_numba_does_not_document():
    assert {path.name for path in hidden_numba.KERNELS.glob("*.py") if hidden_numba.private_names(path)} == {
        "numba_internals.py"
    }


def test_without_any_private_name_kernels_give_the_same_numbers(libraries):
    """Each name is hidden alone, to see that it is survived in one line; then all are, and kernels run."""
    done = libraries.run(code=EACH_NAME)
    assert done.returncode == 0, done.stderr
    choices, values = json.loads(done.stdout)
    assert len(choices) > 12
    for name, (chosen, *lines) in choices.items():
        assert chosen == numba_options.__name__
        (line,) = lines
        assert f"cannot import name {name.split()[-1]!r}" in line
    assert values == pytest.approx(numbers(), rel=1e-14, abs=1e-14)


def without_lowering(monkeypatch):
    monkeypatch.setattr(compiler.COMPILER.WideLowering, "lowering_class", None)


def without_reduction(monkeypatch):
    monkeypatch.delattr(compiler.COMPILER.CompileResult, "_reduce")


def with_a_wrong_number(monkeypatch):
    monkeypatch.setattr(compiler.COMPILER, "compile_inline", lambda function, flags: numba.njit(lambda x: x))


@pytest.mark.parametrize("harm", [None, without_lowering, without_reduction, with_a_wrong_number])
def test_an_unknown_release_compiles_a_small_kernel_first(monkeypatch, tmp_path, harm):
    monkeypatch.setattr(numba, "__version__", "0.99.0rc1")
    monkeypatch.setattr(cache, "ROOT", tmp_path)
    monkeypatch.setattr(cache, "troubles", {})
    if harm is None:
        assert compiler.choose_compiler() is compiler.COMPILER
        assert cache.troubles == {}
        return
    harm(monkeypatch)
    assert compiler.choose_compiler() is numba_options
    assert cache.troubles["compiler"].startswith("Numba 0.99.0rc1 differs inside")


def test_a_known_release_costs_nothing(monkeypatch):
    monkeypatch.setattr(numba, "__version__", "0.68.1")
    monkeypatch.setattr(compiler, "check_compiler", lambda compiler: pytest.fail("it compiles"))
    assert compiler.choose_compiler() is compiler.COMPILER


@pytest.mark.slow
def test_the_self_tests_pass_by_public_options():
    """The numbers of every study, in one process without Numba's private half; and a line that says what it costs."""
    program = [sys.executable, "-m", "tests.kernels.hidden_numba", "doctor"]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"warning: Numba {numba.__version__} differs inside")
