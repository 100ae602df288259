"""Sweeps that would set one value twice, and so mislabel their cases; text that is none."""

import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("filters.0.manoeuvre_variance", "manoeuvre_variance"),
        ("manoeuvre_variance", "filters.0.manoeuvre_variance"),
        ("radar", "radar.sigma_range_m"),
        ("filters.0", "filters.0.manoeuvre_variance"),
    ],
)
def test_keys_of_one_value_are_not_swept_together(good, first, second):
    values = {"radar": [good["radar"]], "filters.0": [good["filters"][0]]}
    sweep = {first: values.get(first, [1, 2]), second: values.get(second, [1, 2])}
    with pytest.raises(ConfigError) as caught:
        load({**good, "sweep": sweep})
    assert caught.value.lines == (f"config: sweep.{second}: sweeps what {first} sweeps as well",)


def test_a_sweep_of_what_an_included_config_sweeps_is_refused():
    with pytest.raises(ConfigError, match="sweeps what manoeuvre_variance sweeps as well"):
        load({"include": ["rls2_manoeuvre_variance"], "sweep": {"manoeuvre_variance": [1, 2]}})


def test_sweeps_of_different_values_go_together(good):
    sweep = {"manoeuvre_variance": [1e-3, 1e-2], "radar.sigma_range_m": [100, 200], "filters.0.initial_scans": [3, 4]}
    assert len(load({**good, "sweep": sweep}).cases) == 8


def test_an_override_that_is_no_text(command_line):
    with pytest.raises(ConfigError) as caught:
        load("rls2", ["radar.name=\udce9"])
    assert caught.value.lines == ("--set radar.name: is not UTF-8 text",)


def test_a_range_that_drowns_its_accuracy_is_refused(good):
    far = {"kind": "polynomial", "coefficients": [1e9, -200]}
    fine = {**good["radar"], "sigma_range_m": 1e-6, "sigma_velocity_mps": 1e-7}
    load({**good, "target": far})
    with pytest.raises(ConfigError, match=r"target: must stay within .* m of the radar"):
        load({**good, "target": far, "radar": fine})
