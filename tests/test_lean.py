"""What needs no kernel loads no compiler, which is half of what such a command would take; and a command loads the
parts of radarsim that it uses."""

import ast
import json
import os
import subprocess
import sys

import pytest

from tests.test_layers import MODULES, ROOT, imported, ours, text_of

HEAVY = ("numba", "llvmlite", "scipy", "dask", "matplotlib", "pandas")
SHOWS = ("list",), ("schema",), ("--help",)  # what is written down, without a number of its own
COMMAND = f"""
import json, sys
from radarsim.cli.command_group import main
main(sys.argv[1:], standalone_mode=False)
print(json.dumps([name for name in {(*HEAVY, "numpy")} if name in sys.modules]), file=sys.stderr)
"""
SOLVE = ("solve", "rls2", "radar.sigma_velocity_mps", "--gain", "r", "--filter", "r+Vr", "--at", "60", "--equals", "30")


@pytest.mark.slow_cases("check", "schema")
@pytest.mark.parametrize("words", [("check", "rls2"), SOLVE, *SHOWS], ids=lambda words: words[0])
def test_what_needs_no_kernel_loads_none(words):
    ended = subprocess.run([sys.executable, "-c", COMMAND, *words], capture_output=True, text=True, check=True)
    assert len(ended.stdout.splitlines()) > 3
    # A steady state tells when a filter has settled, and whether a run is too short for that.
    assert json.loads(ended.stderr) == ([] if words in SHOWS else ["scipy", "numpy"])


@pytest.mark.slow
def test_a_check_of_what_is_long_loads_the_compiler():
    """So that the test above sees what it looks for."""
    words = "check", "rls2", "-n", "1e7"
    ended = subprocess.run([sys.executable, "-c", COMMAND, *words], capture_output=True, text=True, check=True)
    assert "numba" in json.loads(ended.stderr)


def at_once(text):
    """What a source imports when it is imported, not when one of its functions is called or by a type checker."""
    body = [node for node in ast.parse(text).body if not isinstance(node, ast.FunctionDef | ast.If)]
    for node in body:
        if isinstance(node, ast.ClassDef):
            node.body = [one for one in node.body if not isinstance(one, ast.FunctionDef)]
    return imported(body)


def loaded_with(module):
    """The modules of ours, and the foreign libraries, that importing a module loads."""
    found, waiting = set(), [module]
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            waiting += (
                [ours(name) or name.partition(".")[0] for name in at_once(text_of(one))] if one in MODULES else []
            )
    return found


WITHOUT = "cli", "api.cost_estimate", "api.design.solve", "studies.range_doppler.study", "studies.authoring"


@pytest.mark.parametrize("module", WITHOUT)
def test_no_kernel_is_imported_above_the_functions_that_run_it(module):
    assert not [name for name in loaded_with(module) - NO_CODE if name in HEAVY or "kernels." in name]


NO_CODE = {
    "kernels.kalman_algebra",
    "kernels.small_matrices",
    "kernels.formula_functions",
    "kernels.lane_loops",
    "kernels.tracing",
}  # plain Python until a kernel calls them


def test_a_planted_import_is_seen():
    assert {"numba", "kernels.second_order"} <= loaded_with("studies.range_doppler.kernels.missed_block")


MAX_LINES = {"run": 31_500, "sums": 13_500}  # a little above what they were when this was written: 30,600 and 13,300
MAX_IDLE_LINES = {"run": 2_100, "sums": 2_400}  # in modules of which no function ran: 1,900 and 2,300
WAYS = {"run": ("run", "rls2", "-n", "2000", "--quiet", "--out", "results"), "sums": ("--sums", "rls2")}
PARTS = (  # which `radarsim run rls2` has no use for
    *("api.design", "api.maintenance", "recordings.commands", "report.comparison", "report.user_filters.answer"),
    *("studies.onefile", "studies.user_filters.sources", "studies.sonar", "papers.range_doppler.interpretations"),
    *("papers.judge_interpretations", "cli.design", "cli.results", "language.gettext_catalogue"),
    *("api.precision_target", "api.long_experiment"),
)


@pytest.mark.slow_cases("run")
@pytest.mark.parametrize("way", WAYS)
def test_a_command_imports_little_that_it_has_no_use_for(way, tmp_path):
    """From config to sums under 13,500 lines, the whole of `radarsim run rls2` under 31,500.

    15,000 were once meant for the whole. That is the way from config to sums; a run also writes tables with intervals,
    judges 30 claims by the paper's measures, says what the answer is and what would help a filter that loses, and draws
    and writes a page: 17,000 lines more. So the lines that do nothing in it have a bound of their own, which does not
    rise with what a run says (`python -m tests.loaded_lines run rls2`)."""
    command = [sys.executable, "-m", "tests.loaded_lines", *WAYS[way]]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (ROOT, os.environ.get("PYTHONPATH", ""))))}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    loaded = json.loads(ended.stderr.splitlines()[-1])
    modules = {name.removeprefix("radarsim."): lines for name, lines, _ in loaded}
    assert sum(modules.values()) < MAX_LINES[way]
    assert sum(lines for _, lines, has_run in loaded if not has_run) < MAX_IDLE_LINES[way]
    assert [name for name in modules if any(f"{name}.".startswith(f"{part}.") for part in PARTS)] == []
    assert len(modules) > 90
