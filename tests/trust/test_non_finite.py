"""Numbers of a filter that are not finite are counted by scan and filter and end in exit 5; nothing is dropped."""

from importlib import import_module

import numpy as np
import pytest
from click.testing import CliRunner

from radarsim.cli.command_group import main
from radarsim.studies import registry

MANOEUVRE = ("scans=12", "uses.at_s=[35]")
SMALL = {
    "range_doppler": ("range_doppler", "rls2", ["scans=6"]),
    "multimodel": ("multimodel", "multimodel", ["scans=8", "report_every=2"]),
    "sonar": ("sonar", "sonar_smoothing", ["scans=6"]),
    "sonar_manoeuvre": (
        "sonar",
        "sonar_manoeuvre",
        ["scans=12", "uses.at_s=[35]", "sweep.target.acceleration_mps2=[0]"],
    ),
    "sonar_clutter": ("sonar", "sonar_clutter", ["scans=6", "sweep.sensor.false_plots_per_km2=[1]"]),
    "discriminator": ("discriminator", "discriminator_pair", ["burst.pulses=3000"]),
}
BAD, FILTER = 37, 1  # which realisation, and which filter, is spoiled


def run(tmp_path, config, overrides, *more):
    options = [word for override in overrides for word in ("--set", override)]
    return CliRunner().invoke(
        main, ["run", config, "-n", "100", "--no-figures", "--quiet", "--out", str(tmp_path), *options, *more]
    )


def spoil(monkeypatch, name, number):
    """From now on the study's filter 1 gives `number` in realisation 37 at its second scan."""
    declared = registry.study(name)
    simulate = declared.simulate

    def spoiled(plan, first, count):
        values = np.array(simulate(plan, first, count))
        if first <= BAD < first + count:
            plan.layout.unpack(values)["error"][FILTER, 1, 0, 1] = number
        return values

    monkeypatch.setitem(vars(declared), "simulate", spoiled)  # frozen as it is


@pytest.mark.slow_cases("sonar_manoeuvre*")
@pytest.mark.parametrize("number", [np.nan, np.inf])
@pytest.mark.parametrize("name", SMALL)
def test_counted_and_told(name, number, monkeypatch, tmp_path):
    study, config, overrides = SMALL[name]
    spoil(monkeypatch, study, number)
    done = run(tmp_path, config, overrides)
    assert done.exit_code == 5, done.output
    assert "not finite" in done.stderr.splitlines()[0]
    (told,) = [line for line in done.stderr.splitlines() if "filter" in line]
    assert f"1 of {min(100, import_module(f'radarsim.studies.{study}.study').BLOCK)} realisations not finite" in told
    assert "scan " in told
    assert not list(tmp_path.glob("*/curves.csv"))


def test_blocks_that_are_finite_stay_stored(monkeypatch, tmp_path):
    """The run ends, and what was right is not computed again once the fault is mended."""
    spoil(monkeypatch, "sonar", np.nan)
    assert run(tmp_path, "sonar_smoothing", ["scans=4"], "-n", "20000", "--threads", "1").exit_code == 5
    monkeypatch.undo()
    done = run(tmp_path, "sonar_smoothing", ["scans=4"], "-n", "20000")
    assert done.exit_code == 0, done.output
