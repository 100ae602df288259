"""Quantities that only a study of an installed package declares: asked for by every command that asks for one."""

import json
import re
from types import SimpleNamespace

import click
import pandas as pd
import pytest

from radarsim.api.design.solve import TARGET_TOLERANCE, solve
from radarsim.cli import design
from radarsim.cli.command_group import main
from radarsim.errors import ConfigError
from radarsim.report import quantities
from radarsim.report.quantities import Quantity
from radarsim.studies import registry
from tests.studies import example_packages
from tests.tolerances import assert_rounded, rounding

PRECISION = 10 * TARGET_TOLERANCE  # of a root, where the quantity changes by a tenth of what the key does
STUDY = '''
from radarsim.report.quantities import Quantity
from radarsim.report.quantities import COMMON
from radarsim.studies.range_doppler import RangeDoppler

QUANTITIES = (
    Quantity("area", "mean square error", "areas", "area", per="component", unit="m2"),
    Quantity("worst_case", "largest error", "worst", "worst|most", unit="m"),
    Quantity("inside", "share within 100 m", "worst", "inside", kind="share", more_is_better=True),
    Quantity("limit", "smallest error", "limits", "limit", unit="m"),
)


class Areas(RangeDoppler):
    """Range and Doppler again, with tables of its own: squares of sigma, and its largest one without scans."""

    name, about = "areas", "Range and Doppler, by areas."
    filters = {"observes: [range]": "Kalman filter on range"}

    def quantities(self, spec=None):
        return (*COMMON, *QUANTITIES)

    def paper_key(self):
        return ""

    def claims(self):
        return None

    def readings(self):
        return None

    def floor(self, spec, axes):
        return None

    def tables(self, results):
        curves = self.curves(results)
        names = {"sigma": "area", "sigma_lo": "area_lo", "sigma_hi": "area_hi", "exact_sigma": "exact_area"}
        areas = curves[["case", "filter", "component", "k", "t_s"]].assign(
            **{new: curves[old] ** 2 for old, new in names.items()}
        )
        rows = curves[(curves["component"] == "r") & (curves["k"] >= 5)]
        worst = rows.loc[rows.groupby(["case", "filter"], sort=False)["sigma"].idxmax()]
        worst = worst.rename(columns={"sigma": "worst", "sigma_lo": "most_lo", "sigma_hi": "most_hi"})
        worst = worst[["case", "filter", "worst", "most_lo", "most_hi"]]
        share = {f"inside{end}": 100 / worst[of] for end, of in (("", "worst"), ("_lo", "most_hi"), ("_hi", "most_lo"))}
        least = rows.groupby(["case", "filter"], sort=False)["exact_sigma"].min().rename("limit").reset_index()
        least["limit"] = least["limit"].where(least["filter"] != "r")
        return {"areas": areas, "worst": worst.assign(**share), "limits": least}

    def answer(self, results, made):
        return ["Areas."]


STUDY = Areas()
'''
CONFIG = """
study: areas
radar: {wavelength_m: 0.15, sigma_range_m: 250, sigma_velocity_mps: 15, scan_period_s: 10}
target: {kind: polynomial, coefficients: [100e3, -250, 4]}
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: r+Vr, observes: [range, velocity], manoeuvre_variance: 1e-3}
scans: 9
realisations: 8000
"""
KEY = "radar.sigma_velocity_mps"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with two configs, a.yaml and b.yaml, of the study of a package in its folder `site`."""
    folder = tmp_path_factory.mktemp("quantities")
    (folder / "site/areas_of").mkdir(parents=True)
    (folder / "site/areas_of/__init__.py").write_text(STUDY)
    example_packages.metadata(folder / "site", "areas-of", "1.0", {"areas": "areas_of:STUDY"})
    (folder / "a.yaml").write_text(CONFIG)
    (folder / "b.yaml").write_text(CONFIG.replace("sigma_velocity_mps: 15", "sigma_velocity_mps: 5"))
    return folder


@pytest.fixture(scope="module")
def radarsim(place, warm):
    """The real command, beside the installed package."""
    return example_packages.beside(warm, place / "site", place)


def solved(radarsim, *words):
    return json.loads(radarsim("solve", "a.yaml", KEY, *words, "--json").stdout)


def test_help_lists_them_with_their_units(radarsim):
    said = " ".join(radarsim("solve", "--help").stdout.split())
    assert "--area COMPONENT Mean square error, m2 (areas)." in said
    assert "--worst-case NAME Largest error, m (areas)." in said
    assert "--inside NAME Share within 100 m, % (areas)." in said


@pytest.mark.slow
def test_solve_finds_the_root_of_an_exact_one(radarsim):
    """The square of σ is 10⁴ m² where σ is 100 m; the latter by the shipped study."""
    found = solved(radarsim, "--area", "r", "--filter", "r+Vr", "--at-k", 9, "--equals", 1e4)
    known = solve("rls2", KEY, sigma="r", filter="r+Vr", at_k=9, equals=100.0, overrides=["scans=9"])
    assert found["exact"]
    assert found["value"] == pytest.approx(known.value, rel=PRECISION)
    assert (found["quantity"], found["quantity_unit"]) == ("mean square error of r+Vr in r at k = 9", "m²")


@pytest.mark.slow
def test_solve_takes_one_from_a_table_of_exact_values_alone(radarsim):
    """A limit over all scans: no interval, and no scan to be asked at."""
    least = solved(radarsim, "--limit", "r+Vr", "--equals", 100)
    known = solve("rls2", KEY, sigma="r", filter="r+Vr", equals=100.0, overrides=["scans=9"])
    assert least["exact"]
    assert least["value"] == pytest.approx(known.value, rel=PRECISION)
    for option, value in (("--at", 3), ("--at-k", 2)):
        words = ("solve", "a.yaml", KEY, "--limit", "r+Vr", "--equals", 100, option, value)
        refused = f"{option}: the smallest error has one value, not one a scan: leave the time out\n"
        assert radarsim(*words, code=2).stderr == refused


@pytest.mark.slow
def test_one_that_is_exact_is_so_where_a_filter_has_no_value(radarsim, tmp_path):
    """`r` has no limit: nothing is simulated for it, and no change of the other's has an interval."""
    said = radarsim("solve", "a.yaml", KEY, "--limit", "r", "--equals", 100, code=2).stderr
    assert said == f"smallest error of r: there is no estimate there, whatever {KEY} is\n"
    made = radarsim("sensitivity", "a.yaml", "--of", "limit", "--out", tmp_path, "--no-figures").stdout
    assert made.startswith("a: change of smallest error for +10 %")
    assert "[" not in made


@pytest.mark.slow
def test_solve_samples_one_without_exact_values(radarsim):
    found = solved(radarsim, "--worst-case", "r+Vr", "--equals", 150, "-n", 300, "--between", 5, 60)
    assert not found["exact"]
    assert found["lo"] < found["value"] < found["hi"]
    share = solved(radarsim, "--inside", "r+Vr", "--equals", 100 * 100 / 150, "-n", 300, "--between", 5, 60)
    assert share["value"] == pytest.approx(found["value"], rel=0.01)  # the same function in per cent
    assert share["quantity_unit"] == "%"


@pytest.mark.slow
def test_a_run_ends_at_its_precision(radarsim, tmp_path):
    """A square is known half as well as its root: 4.4 % at 4000 realisations, 3.1 % at 8000."""
    words = ("--no-figures", "--json", "--out", tmp_path)
    for of, components, done in (("area", {"r", "Vr", "ar"}, 8000), ("worst_case", {""}, 2000), ("inside", {""}, 2000)):
        (document,) = json.loads(radarsim("run", "a.yaml", "--precision", 4, "--of", of, *words).stdout)
        assert document["cases"]["a"]["done"] == done
        widest = document["precision"]["widest"]["a"]
        assert widest["of"] == of
        assert widest["component"] in components
        assert widest["percent"] < 4
    missed = radarsim("run", "a.yaml", "--precision", 1, "--of", "area", *words, code=3).stderr
    assert ": mean square error ± 3." in missed
    need = json.loads(radarsim("check", "a.yaml", "--precision", 4, "--of", "area", "--json").stdout)
    assert need[0]["of"] == "area"
    assert need[0]["cases"][0]["need"]["realisations"] == 8000


@pytest.mark.slow
def test_sensitivity_is_of_it(radarsim, tmp_path):
    """To first order a square changes by twice as much; exactly by the square of the factor."""
    words = ("--at-k", 9, "--out", tmp_path, "--no-figures", "--json")
    area, sigma = (
        json.loads(radarsim("sensitivity", "a.yaml", *of, *words).stdout)
        for of in (("--of", "area"), ("--of", "sigma"))
    )
    assert (area["of"], area["leading"]) == (["area"], "r")
    for one, other in zip(area["rows"], sorted(sigma["rows"], key=sigma["rows"].index), strict=True):
        factor = 1 + other["sigma_change_percent"] / 100
        assert one["area_change_percent"] == pytest.approx(100 * (factor**2 - 1), abs=rounding(100, 50))
    said = radarsim(
        "sensitivity", "a.yaml", "--of", "inside", "-n", 200, "--out", tmp_path, "--format", "svg"
    ).stdout.splitlines()
    assert said[0] == "a: change of share within 100 m for +10 %"
    assert "share within 100 m of r, points" in said[1]
    rows = pd.read_csv(tmp_path / "sensitivity/a/sensitivity.csv")
    assert {"inside_percent", "inside_change_points", "inside_change_lo"} <= set(rows)
    assert set(rows["unit"]) == {"%"}
    assert (tmp_path / "sensitivity/a/tornado.svg").exists()


@pytest.mark.slow
def test_compare_puts_them_side_by_side(radarsim, tmp_path):
    for name in "ab":
        radarsim("run", f"{name}.yaml", "-n", 400, "--no-figures", "--out", tmp_path)
    said = radarsim("compare", "b.yaml", "a.yaml", "--no-figures", "--out", tmp_path).stdout
    made = pd.read_csv(tmp_path / "compare/comparison.csv")
    assert {"sigma", "gain_percent", "area", "worst", "inside", "limit"} == set(made["quantity"])
    areas, sigmas = (
        made[(made["quantity"] == name) & (made["component"] == "r")].reset_index() for name in ("area", "sigma")
    )
    ratio = 1 + sigmas["exact_percent"] / 100
    assert_rounded(areas["exact_percent"], 100 * (ratio**2 - 1), size=100 * ratio**2, operations=10)
    assert set(made.loc[made["quantity"] == "area", "unit"]) == {"m2"}
    assert ["largest", "error", "largest", "error", "of", "b", "change"] in map(str.split, said.splitlines())
    assert "nan" not in said


def test_what_a_study_does_not_measure_is_refused_with_what_it_does(radarsim, tmp_path):
    lacking = "study areas measures no 'lock', but sigma, gain, area, worst_case, inside, limit\n"
    for words in (
        ("solve", "a.yaml", KEY, "--lock", "r", "--equals", 1),
        ("run", "a.yaml", "--precision", 1, "--of", "lock", "--out", tmp_path),
        ("sensitivity", "a.yaml", "--of", "lock", "--out", tmp_path),
    ):
        assert radarsim(*words, code=2).stderr == f"a: {lacking}"
    named = radarsim("solve", "a.yaml", KEY, "--area", "q", "--filter", "r", "--equals", 1, code=2).stderr
    assert named == "no component 'q'; there are: r, Vr, ar\n"
    assert radarsim("solve", "rls2", KEY, "--area", "r", "--equals", 1, code=2).stderr.endswith(" lag_10, smoothed\n")


def test_a_study_that_takes_no_spec_is_one_line(monkeypatch):
    class Odd:
        def quantities(self):
            return ()

    monkeypatch.setattr(registry, "_loaded", lambda name: Odd())
    monkeypatch.setattr(registry, "package", lambda name: "odd 1.0")
    with pytest.raises(ConfigError, match=r"^study odd: the package odd 1\.0 fails: TypeError: .*quantities"):
        registry.quantities("odd", None)


def test_a_name_that_another_option_has_is_refused_where_it_is_declared():
    command = main.get_command(None, "solve")
    context = click.Context(command, parent=main.make_context("radarsim", [], resilient_parsing=True))
    params = click.Command.get_params(command, context)
    options = {name for param in params for name in param.opts if name.startswith("--")}
    assert options == quantities.RESERVED_OPTIONS
    with pytest.raises(ConfigError, match="quantity 'at_k': --at-k is another option of `radarsim solve`; rename it"):
        Quantity("at_k", "rate", "slips", "rate")
    with pytest.raises(ConfigError, match="quantity 'at first': its name must be of small letters, digits and _"):
        Quantity("at first", "rate", "slips", "rate")


def test_one_name_in_two_units_is_listed_with_both():
    depth, share = Quantity("slip", "slip", "slips", "slip", unit="m"), Quantity("slip", "slip", "s", "s", kind="share")
    option = design._option({"one": depth, "other": share, "third": depth}, in_all_studies=False)
    assert option.help == "Slip, m (one, third), % (other)."
    assert design._option({"one": depth}, in_all_studies=True).help == "Slip, m."
    ratio, error = Quantity("ratio", "ratio", "r", "r"), Quantity("error", "error", "e", "e", per="component")
    assert design._option({"one": ratio}, in_all_studies=False).help == "Ratio (one)."
    assert design._option({"one": error}, in_all_studies=False).help == "Error, in the component's unit (one)."


@pytest.mark.parametrize("given", [7, (7,), None])
def test_quantities_that_are_none_are_one_line(given, monkeypatch):
    monkeypatch.setattr(registry, "_loaded", lambda name: SimpleNamespace(name="odd", quantities=lambda spec: given))
    monkeypatch.setattr(registry, "package", lambda name: "odd 1.0")
    with pytest.raises(
        ConfigError, match=rf"^study odd: .*quantities: must give .*Quantity, got {re.escape(repr(given))}$"
    ):
        registry.quantities("odd", None)


def test_a_column_that_the_table_lacks_is_named_with_it():
    rows = pd.DataFrame({"filter": ["r"], "value": [1.0]})
    for column, value, per in (("other", "other", ""), ("model", "value", "model")):
        with pytest.raises(ConfigError, match=rf"^quantity 'a': areas\.csv has no column '{column}'$"):
            Quantity("a", "a", "areas", value, per=per).read(rows)
