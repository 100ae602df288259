"""Whatever a file, a mapping or an override holds: an experiment, or a ConfigError of printable lines."""

import copy

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from radarsim.api.configs import load
from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError

SHORT = {
    "study": "range_doppler",
    "radar": {"wavelength_m": 1, "sigma_range_m": 1, "sigma_velocity_mps": 1, "scan_period_s": 1},
    "target": "turn",
    "filters": [{"name": "r", "observes": ["range"], "manoeuvre_variance": 1}],
    "scans": 5,
    "realisations": 5,
}
RESOLVED = load(SHORT).cases[0].resolved()
TREE = SHORT | {key: value for key, value in RESOLVED.items() if key not in ("case", "swept")}
SCRAPS = [*"{}[]:\n\t#|>'\"%\x00\x85\ufeffé~", "- ", "  ", "&a ", "*a", "!x ", "---", "...", "? ", "<<: "]
SCRAPS += [".nan", "1e999", "null", "true", "1e5", "include: [rls2]\n", "sweep: {scans: [9, 9]}\n"]
WORDS = st.sampled_from(["rls2", "polynomial", "turn", "..", "r"])
NUMBERS = st.integers() | st.floats() | st.just(10**400)
LEAVES = st.none() | st.booleans() | NUMBERS | st.text(max_size=8) | WORDS | st.binary(max_size=3)
VALUES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)
WORDED = """
study include sweep realisations seed figures radar radar.name radar.band radar.sigma_range_m target target.kind
target.aspect_deg target.aspect_rad target.range_m target.start_s filters filters.0 filters.0.name
filters.0.observes filters.0.initial_scans manoeuvre_variance baseline scans sweep.scans figures.a include.0
"""
KEYS = st.sampled_from(WORDED.split())
quick = settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])


def outcome(source, overrides=()):
    """Load, and see that nothing comes out but what may."""
    try:
        experiment = load(source, overrides)
    except ConfigError as error:
        lines = error.lines
    else:
        assert isinstance(experiment, Experiment)
        return
    assert lines
    assert all(line.isprintable() and len(line) < 2000 for line in lines), lines


@quick
@given(st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=3))
def test_a_mapping_with_wrong_values(changes):
    tree = copy.deepcopy(TREE)
    for key, value in changes:
        *outer, last = (int(step) if step.isdigit() else step for step in key.split("."))
        holder = tree
        try:
            for step in outer:
                holder = holder[step]
            holder[last] = value
        except (KeyError, IndexError, TypeError):
            tree[key] = value
    outcome(tree)


@quick
@given(VALUES)
def test_any_mapping(value):
    outcome({"study": value, "radar": value, "include": [value]} if not isinstance(value, dict) else value)


@quick
@given(st.lists(st.tuples(KEYS, st.text(max_size=12) | st.sampled_from(SCRAPS)), min_size=1, max_size=3))
def test_any_overrides(pairs):
    outcome("rls2", [f"{key}={value}" for key, value in pairs])


@quick
@given(st.text(max_size=30))
def test_any_name_and_any_override(text):
    outcome(text)
    outcome("rls2", [text])


@pytest.mark.slow
@settings(max_examples=5000)
@given(st.lists(st.tuples(KEYS, VALUES), max_size=3), st.lists(st.tuples(KEYS, st.text(max_size=12)), max_size=3))
def test_long(changes, pairs):
    outcome({"study": "range_doppler", **dict(changes)}, [f"{key}={value}" for key, value in pairs])
