"""What Python gives to `run` is refused as the command refuses its options: a ConfigError with a line for each."""

import math
from pathlib import Path

import numpy as np
import pytest

import radarsim
from radarsim.engine.executors import Threads

COUNT, NONE_TOO, ABOVE = (
    "must be a whole number from 1 to 1024, got",
    "must be a whole number from 0 to 1024, got",
    "must be > 0",
)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"threads": -1}, f"threads: {NONE_TOO} -1"),
        ({"threads": "2"}, f"threads: {NONE_TOO} '2'"),
        ({"threads": 1.5}, f"threads: {NONE_TOO} 1.5"),
        ({"threads": True}, f"threads: {NONE_TOO} True"),
        ({"workers": 0}, f"workers: {COUNT} 0"),
        ({"workers": "a"}, f"workers: {COUNT} 'a'"),
        ({"time_limit": math.nan}, f"time_limit: {ABOVE}, got nan"),
        ({"time_limit": 0}, f"time_limit: {ABOVE}, got 0"),
        ({"time_limit": -1}, f"time_limit: {ABOVE}, got -1"),
        ({"time_limit": "1"}, f"time_limit: {ABOVE}, got '1'"),
        ({"precision": "a"}, f"precision: {ABOVE} and ≤ 100 %, got 'a'"),
        ({"precision": 101}, f"precision: {ABOVE} and ≤ 100 %, got 101"),
        ({"executor": 5}, "executor: must be an executor of radarsim.engine, got 5"),
        ({"out": ""}, "out: must name a directory, got ''"),
        ({"out": 5}, "out: must name a directory, got 5"),
        ({"out": b"x"}, "out: must name a directory, got b'x'"),
        ({"figures": "gif"}, "figures: must be True, False or of svg, png, pdf, got 'gif'"),
        ({"figures": 7}, "figures: must be True"),
        ({"overrides": None}, "overrides: must be a mapping such as"),
        ({"overrides": "scans=4"}, "overrides: must be a mapping such as"),
        ({"precision": np.array([1.0])}, f"precision: {ABOVE}"),
        ({"threads": np.array([1])}, "threads: must be a whole number"),
    ],
)
def test_an_argument_that_is_none(arguments, line):
    with pytest.raises(radarsim.ConfigError) as caught:
        radarsim.run("rls2", realisations=10, **arguments)
    (said,) = caught.value.lines
    assert said.startswith(line)


def test_all_of_them_at_once():
    with pytest.raises(radarsim.ConfigError) as caught:
        radarsim.run("rls2", threads=-1, workers=0, out="")
    assert [line.split(":")[0] for line in caught.value.lines] == ["threads", "workers", "out"]


def test_numbers_of_numpy_paths_and_executors_are_taken(tmp_path):
    ran = {"realisations": np.int64(10), "threads": np.int64(1), "time_limit": np.float64(60), "figures": False}
    assert radarsim.run("rls2", out=Path(tmp_path), **ran).written
    with_pool = Threads(1)
    try:
        assert len(radarsim.run("rls2", realisations=10, executor=with_pool).curves)
    finally:
        with_pool.close()


@pytest.mark.parametrize("config", [None, 5, [], [1], math.nan])
def test_a_config_that_is_none(config):
    with pytest.raises(radarsim.ConfigError) as caught:
        radarsim.run(config)
    (line,) = caught.value.lines
    assert line.startswith("config: must be a path, a name or a mapping, got ")
    assert repr(config) in line


def test_a_key_that_is_no_text_is_named():
    with pytest.raises(radarsim.ConfigError) as caught:
        radarsim.run({"study": "range_doppler", 1: 2})
    assert any(line.startswith("config: 1: unknown key") for line in caught.value.lines)


def test_no_directory_without_a_name():
    with pytest.raises(radarsim.ConfigError, match="out: must name a directory"):
        radarsim.load("rls2", out="")


SOLVED = {"key": "radar.sigma_velocity_mps", "gain": "r", "filter": "r+Vr", "at_s": 60, "equals": 30}


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: radarsim.run("rls2", realisations=10, width_mm="85"), "width_mm: must be > 0 and ≤ 1000, got '85'"),
        (lambda: radarsim.run("rls2", realisations=10, width_mm=1e6), "width_mm: must be > 0 and ≤ 1000"),
        (lambda: radarsim.solve("rls2", **(SOLVED | {"equals": "30"})), "equals: must be a number, got '30'"),
        (lambda: radarsim.solve("rls2", **(SOLVED | {"at_s": "60"})), "at_s: must be a number, got '60'"),
        (lambda: radarsim.solve("rls2", **(SOLVED | {"key": 5})), "key: must be text, got 5"),
        (lambda: radarsim.solve("rls2", **SOLVED, between=(1,)), "between: must be two rising numbers, got (1,)"),
        (lambda: radarsim.solve("rls2", **SOLVED, realisations="x"), "realisations: must be a whole number, got 'x'"),
        (lambda: radarsim.solve("rls2", **SOLVED, threads=-1), f"threads: {NONE_TOO} -1"),
        (lambda: radarsim.sensitivity("rls2", at_k="2"), "at_k: must be a number, got '2'"),
        (lambda: radarsim.sensitivity("rls2", realisations=0), "realisations: must be >= 1, got 0"),
        (lambda: radarsim.interpretations("P1.4", time_limit=-1), f"time_limit: {ABOVE}, got -1"),
        (lambda: radarsim.interpretations(5), "5: must be text"),
        (lambda: radarsim.claims(["P1"]), "['P1']: must be text"),
        (lambda: radarsim.claims(out=5), "out: must name a directory, got 5"),
        (lambda: radarsim.check("rls2", share=(0, 0)), "share: must be two whole numbers i, n with 1 ≤ i ≤ n"),
        (lambda: radarsim.check("rls2", share="2/3"), "share: must be two whole numbers"),
        (lambda: radarsim.compare("rls2", None), "compare: must be a result, a config or the folder of a result"),
        (lambda: radarsim.chart(overrides={"radar.sigma_range_m": 5}), "overrides: without a config there is nothing"),
    ],
)
def test_other_functions_refuse_as_run_does(call, line):
    with pytest.raises(radarsim.ConfigError) as caught:
        call()
    (said,) = caught.value.lines
    assert said.startswith(line)
