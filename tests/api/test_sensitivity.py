"""What a tenth more of each key changes: against the textbook, sampled against exact, order, files, faults."""

import json

import numpy as np
import pandas as pd
import pytest

from radarsim.api.configs import load
from radarsim.api.design import jackknife, tornado
from radarsim.api.design import sensitivity as design_sensitivity
from radarsim.api.design.sensitivity import sensitivity
from radarsim.errors import ConfigError
from radarsim.report.quantities import COMMON
from radarsim.studies import registry
from tests.program import command
from tests.studies.range_doppler import impulse
from tests.tolerances import assert_rounded, recursion_rounding

RLS2 = {"variance": 1e-3, "sigma": (250.0, 15.0), "dt": 10.0}


@pytest.fixture(scope="module")
def exact():
    """RLS 2 at 60 s."""
    return sensitivity("rls2", at_s=60.0)


def row(found, key, name="r+Vr", component="r"):
    """The one row of a key, a filter and a component."""
    (one,) = [r for r in found.rows if (r["key"], r["filter"], r["component"]) == (key, name, component)]
    return one


@pytest.mark.parametrize(
    ("key", "changed"),
    [
        ("radar.sigma_range_m", {"sigma": (275.0, 15.0)}),
        ("radar.sigma_velocity_mps", {"sigma": (250.0, 16.5)}),
        ("filters.1.manoeuvre_variance", {"variance": 1.1e-3}),
    ],
)
def test_changes_are_those_of_the_textbook(exact, key, changed):
    before, after = impulse.sigmas(2, 7, **RLS2), impulse.sigmas(2, 7, **(RLS2 | changed))
    base = impulse.sigmas(1, 7, **RLS2)
    raised = impulse.sigmas(1, 7, **(RLS2 | ({} if "filters" in key else changed)))
    for i, component in enumerate(("r", "Vr", "ar")):
        one = row(exact, key, component=component)
        assert one["exact"]
        allowed = 100 * recursion_rounding(7)  # of a σ, in per cent
        assert one["sigma"] == pytest.approx(before[i], rel=recursion_rounding(7))
        assert one["sigma_change_percent"] == pytest.approx(100 * (after[i] / before[i] - 1), rel=0, abs=2 * allowed)
        assert one["sigma_change_lo"] == one["sigma_change_hi"] == one["sigma_change_percent"]
        points = 100 * (before[i] / base[i] - after[i] / raised[i])
        assert one["gain_change_points"] == pytest.approx(points, rel=0, abs=4 * allowed)


def test_the_largest_effect_on_the_leading_component_comes_first(exact):
    keys = list(dict.fromkeys(r["key"] for r in exact.rows))
    effect = [max(abs(row(exact, key, name)["sigma_change_percent"]) for name in ("r", "r+Vr")) for key in keys]
    assert effect == sorted(effect, reverse=True)
    assert keys[:2] == ["radar.detection_probability", "radar.sigma_range_m"]
    assert "radar.wavelength_m" in exact.without_effect
    assert not set(exact.without_effect) & set(keys)
    assert not exact.left_out


def test_a_key_that_cannot_grow_is_lowered_and_marked(exact, tmp_path):
    """The change is that of a run with the lower value, with its sign."""
    one = row(exact, "radar.detection_probability")
    assert (one["value"], one["changed_value"], exact.lowered) == (1, 0.9, ("radar.detection_probability",))
    lower = row(sensitivity("rls2", at_s=60.0, overrides=["radar.detection_probability=0.9"]), "radar.sigma_range_m")
    assert_rounded(one["sigma_change_percent"], 100 * (lower["sigma"] / one["sigma"] - 1), size=100, operations=3)
    assert one["sigma_change_percent"] > 0
    marked = "radar.detection_probability, −10 %"
    lines = command("sensitivity", "rls2", "--at", "60", "--out", tmp_path, "--no-figures").stdout.splitlines()
    assert [line.startswith(marked) for line in lines[2:5]] == [True, False, False]
    assert marked in str(exact)
    assert "Keys with −10 % cannot grow and fall instead." in tornado.tornado(exact).caption


def test_whole_numbers_grow_by_one(exact):
    one = row(exact, "filters.0.initial_scans", "r")
    assert (one["value"], one["changed_value"]) == (3, 4)


def test_the_last_scans_time_is_kept_when_the_period_grows():
    found = sensitivity("rls2", overrides=["scans=7"])
    assert found.at == "at 60 s"
    ends = [impulse.sigmas(2, n, 1e-3, (250.0, 15.0), 11.0)[0] for n in (6, 7)]
    at = ends[0] + (60 / 11 - 5) * (ends[1] - ends[0])
    one = row(found, "radar.scan_period_s")
    change = 100 * (at / one["sigma"] - 1)
    assert one["sigma_change_percent"] == pytest.approx(change, rel=0, abs=200 * recursion_rounding(7))


@pytest.mark.slow
def test_sampled_changes_are_paired_and_near_the_exact_ones(exact):
    """Sampled though known: within four standard errors, and far narrower than two runs of their own."""
    found = sensitivity("rls2", at_s=60.0, realisations=4000, sampled=True)
    for key in ("radar.sigma_range_m", "radar.sigma_velocity_mps"):
        one, known = row(found, key), row(exact, key)
        assert not one["exact"]
        assert one["sigma_change_lo"] < one["sigma_change_percent"] < one["sigma_change_hi"]
        half = (one["sigma_change_hi"] - one["sigma_change_lo"]) / 2
        assert abs(one["sigma_change_percent"] - known["sigma_change_percent"]) < 2 * half
        assert half < 100 * 1.96 * np.sqrt(2) / np.sqrt(2 * 4000) / 2
        assert abs(one["gain_change_points"] - known["gain_change_points"]) < (
            one["gain_change_hi"] - one["gain_change_lo"]
        )
    assert {*exact.without_effect} <= {*found.without_effect}


def test_the_command_writes_table_and_figure(tmp_path):
    ended = command("sensitivity", "rls2", "--at", "60", "--out", tmp_path, "--format", "svg")
    folder = tmp_path / "sensitivity" / "rls2"
    assert sorted(path.name for path in folder.iterdir()) == ["sensitivity.csv", "tornado.svg"]
    rows = pd.read_csv(folder / "sensitivity.csv")
    assert tuple(rows.columns) == design_sensitivity.columns(COMMON)
    assert rows["exact"].all()
    lines = ended.stdout.splitlines()
    assert lines[0] == "rls2: change of r at 60 s for +10 %"
    assert lines[3].startswith("radar.sigma_range_m  ")
    assert lines[3].endswith("  250 → 275 m")
    assert any(line.startswith("slight ") and "filters.1.manoeuvre_variance" in line for line in lines)


def test_the_command_gives_one_json_document(tmp_path):
    words = ("sensitivity", "rls2", "--component", "Vr", "--no-figures", "--out", tmp_path, "--json")
    document = json.loads(command(*words).stdout)
    assert document["leading"] == "Vr"
    assert {"key", "filter", "sigma_change_percent", "gain_change_points"} <= set(document["rows"][0])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"component": "q"}, "no component 'q'"),
        ({"at_s": 1e4}, "must be from 0 to 140 s"),
        ({"at_k": 99}, "must be from 1 to 15"),
        ({"case": "rls3"}, "no case 'rls3'"),
    ],
)
def test_faults(given, words):
    with pytest.raises(ConfigError, match=words):
        sensitivity("rls2", **given)


def test_with_missed_plots_gains_are_those_of_the_run():
    """Of the realisations in which both filters have an estimate, exactly and sampled."""
    import radarsim

    missed = ["radar.detection_probability=0.8", "scans=8"]
    result = radarsim.run("rls2", overrides=missed, realisations=1000)
    known = result.gains.query("component == 'r' and k == 3").iloc[0]["exact_percent"]
    found = sensitivity("rls2", overrides=missed, at_k=3)
    one = row(found, "radar.sigma_velocity_mps")
    assert one["gain_percent"] == known  # of the same means
    assert one["exact"]


def test_a_figure_names_keys_as_people_do(exact):
    (panel, _) = tornado.tornado(exact).panels
    names = [text for _, text in panel.y.ticks]
    assert names[-1].endswith(", −10 %")
    assert names[-2] == "\u03c3 of the measured range $\u03c3_r$, m"
    assert len(names) == 4  # those whose bars are seen
    assert not any("_mps" in name or "filters" in name for name in names)
    told = tornado.tornado(exact).caption
    assert "Too small to be drawn: r: plots in the initialisation, r: manoeuvre variance, r+Vr: plots" in told


@pytest.mark.slow
def test_where_some_filters_have_no_exact_values_all_are_sampled():
    """Else the others would be said to change nothing."""
    found = sensitivity("ambiguous_rls2", overrides=["scans=4"], realisations=40)
    filters = {r["filter"] for r in found.rows}
    assert len(filters) == 6
    assert not any(r["exact"] for r in found.rows)
    assert "radar.repetition_rate_hz" not in found.without_effect
    lines = [mark for mark in tornado.tornado(found).panels[0].marks if getattr(mark, "name", "").endswith("95 %")]
    assert lines


@pytest.mark.slow
def test_items_of_a_list_are_raised_though_the_config_gives_degrees():
    found = sensitivity("sonar_smoothing", overrides=["scans=12"], realisations=40)
    assert not [key for key in found.left_out if "bearing" in key]
    given = {r["key"]: (r["value"], r["changed_value"]) for r in found.rows} | dict.fromkeys(found.without_effect)
    assert {"target.bearing_rad.0", "target.bearing_rad.1"} <= set(given)
    changes = [abs(r["sigma_change_percent"]) for r in found.rows]
    assert all(change == 0 or change > jackknife.ROUNDING_PERCENT for change in changes)


@pytest.mark.slow
def test_a_changed_period_is_not_paired_and_has_more_realisations():
    """Sampled though known: its interval holds the exact change, and the others stay paired."""
    known = sensitivity("rls2", overrides=["scans=7"])
    found = sensitivity("rls2", overrides=["scans=7"], realisations=2000, sampled=True)
    assert found.not_paired == ("radar.scan_period_s",)
    one, exactly = (row(of, "radar.scan_period_s")["sigma_change_percent"] for of in (found, known))
    whole = row(found, "radar.scan_period_s")
    half = (whole["sigma_change_hi"] - whole["sigma_change_lo"]) / 2
    assert abs(one - exactly) < 2 * half
    assert half < 2 * 100 * 1.96 / np.sqrt(2 * 2000)
    assert known.not_paired == ()


def test_what_is_the_targets_own_says_so():
    """A duration and a range are other keys' too."""
    turn = "kind: turn, range_m: 1e5, speed_mps: 280, aspect_rad: 3, start_s: 50, acceleration_g: 3, duration_s: 9"
    keys = load("rls2", [f"target={{{turn}}}"])
    spec = keys.cases[0].spec
    assert design_sensitivity.key_name(spec, "target.duration_s") == ("target: duration", "", "s")
    assert design_sensitivity.key_name(spec, "target.start_s").text == "target: start time"
    assert design_sensitivity.key_name(spec, "radar.sigma_range_m").text == "σ of the measured range"


def test_a_quantity_is_found_in_the_spelling_of_its_option():
    (case,) = load("ambiguous_rls2").cases
    assert {registry.quantity(name, case).name for name in ("above-oracle", "--above-oracle", "above_oracle")} == {
        "above_oracle"
    }


def test_what_changes_an_included_config_has_the_name_of_its_own_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text("include: [rls2]\nscans: 9\n")
    assert sensitivity("mine", at_s=20).stem == "mine"
    assert sensitivity("range_doppler", case="rls3", at_s=20).stem == "rls3"
