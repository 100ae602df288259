"""Includes, sweeps and overrides: which cases they make, how these are called, and what is refused."""

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.config.experiment import matches_pattern
from radarsim.config.overrides import override_texts
from radarsim.errors import ConfigError

RADAR = "radar: {wavelength_m: 0.15, sigma_range_m: 250, sigma_velocity_mps: 15, scan_period_s: 10}\n"
REST = """
target: {kind: polynomial, coefficients: [1e5]}
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: r+Vr, observes: [range, velocity], manoeuvre_variance: 1e-3}
scans: 15
"""
CONFIG = f"study: range_doppler\n{RADAR}{REST}realisations: 1e3\nseed: 7\n"


def names(experiment):
    return [case.name for case in experiment.cases]


@pytest.fixture
def folder(house):
    """configs/a.yaml and b.yaml, alike."""
    house("configs/a.yaml", CONFIG)
    house("configs/b.yaml", CONFIG)
    return house


def test_sweep_makes_every_combination_the_last_key_fastest(house):
    house("own.yaml", CONFIG + "sweep: {manoeuvre_variance: [1e-4, 1e-5], scans: [15, 2e1]}\n")
    experiment = load("own.yaml")
    assert names(experiment) == [
        "own manoeuvre_variance=0.0001 scans=15",
        "own manoeuvre_variance=0.0001 scans=20",
        "own manoeuvre_variance=1e-5 scans=15",
        "own manoeuvre_variance=1e-5 scans=20",
    ]
    last = experiment.cases[-1]
    assert last.swept_values == (("manoeuvre_variance", 1e-5), ("scans", 20.0))
    assert [f.manoeuvre_variance for f in last.spec.filters] == [1e-5, 1e-5]
    assert last.spec.scans == 20
    assert (last.stem, last.realisations, last.seed) == ("own", 1000, 7)


@pytest.mark.parametrize(
    ("sweep", "name"),
    [
        ("radar.sigma_range_m: [300]", "own radar.sigma_range_m=300"),
        ("filters.0.observes: [[range, velocity]]", "own filters.0.observes=[range,velocity]"),
        ("filters.1.manoeuvre_variance: [2.5e-3]", "own filters.1.manoeuvre_variance=0.0025"),
        ("baseline: [r+Vr]", "own baseline=r+Vr"),
        ("target: [polynomial]", "own target=polynomial"),
        ("target.coefficients.0: [1e7]", "own target.coefficients.0=1e7"),
        ("target: [{kind: polynomial, coefficients: [1]}]", "own target={kind:polynomial,coefficients:[1]}"),
        ("initial_scans: [4]", "own initial_scans=4"),
    ],
)
def test_names_of_swept_cases(house, sweep, name):
    house("own.yaml", CONFIG + f"sweep: {{{sweep}}}\n")
    assert names(load("own.yaml")) == [name]


def test_only_the_filter_that_is_named_changes(house):
    house("own.yaml", CONFIG + "sweep: {filters.1.manoeuvre_variance: [5]}\n")
    assert [f.manoeuvre_variance for f in load("own.yaml").cases[0].spec.filters] == [1e-3, 5.0]


def test_include_keeps_stems_and_outer_common_keys_win(folder):
    folder("configs/both.yaml", "include: [a, b]\nseed: 9\n")
    experiment = load("both")
    assert names(experiment) == ["a", "b"]
    assert [(case.stem, case.realisations, case.seed) for case in experiment.cases] == [("a", 1000, 9), ("b", 1000, 9)]
    assert (experiment.stem, experiment.study, experiment.path) == ("both", "range_doppler", "configs/both.yaml")
    folder("configs/more.yaml", "include: [both, a]\nrealisations: 5e3\n")
    with pytest.raises(Exception, match="makes the case 'a' twice"):
        load("more")


def test_include_of_sweeps_under_a_sweep(folder):
    folder("configs/inner.yaml", "include: [a]\nsweep: {manoeuvre_variance: [1, 2]}\nrealisations: 50\n")
    folder("configs/outer.yaml", "include: [b, inner]\nsweep: {scans: [10, 11]}\n")
    experiment = load("outer")
    assert names(experiment) == [
        "b scans=10",
        "b scans=11",
        "a manoeuvre_variance=1 scans=10",
        "a manoeuvre_variance=1 scans=11",
        "a manoeuvre_variance=2 scans=10",
        "a manoeuvre_variance=2 scans=11",
    ]
    assert [case.realisations for case in experiment.cases] == [1000, 1000, 50, 50, 50, 50]
    assert experiment.realisations == 1000
    assert load("outer", ["realisations=70"]).realisations == 70
    assert {case.realisations for case in load("outer", ["realisations=70"]).cases} == {70}


def test_overrides(folder):
    spec = (
        load("a", ["radar.sigma_range_m=300", "manoeuvre_variance=0.5", "filters.0.initial_scans=4", "scans=2e1"])
        .cases[0]
        .spec
    )
    assert spec.radar.sigma_range_m == 300.0
    assert [f.manoeuvre_variance for f in spec.filters] == [0.5, 0.5]
    assert [f.initial_scans for f in spec.filters] == [4, 2]
    assert spec.scans == 20


def test_of_two_overrides_the_later_wins(folder):
    assert load("a", ["scans=20", "scans=30"]).cases[0].spec.scans == 30


def test_overrides_reach_every_included_config(folder):
    folder("configs/both.yaml", "include: [a, b]\n")
    experiment = load("both", ["radar.sigma_range_m=300", "realisations=1e4", "seed=3"])
    assert [(c.spec.radar.sigma_range_m, c.realisations, c.seed) for c in experiment.cases] == [(300.0, 10_000, 3)] * 2


def test_an_override_makes_a_sweep_and_a_target(folder):
    assert names(load("a", ["sweep.radar.sigma_range_m=[1, 2]"])) == [
        "a radar.sigma_range_m=1",
        "a radar.sigma_range_m=2",
    ]
    target = load("a", ["target={kind: polynomial, coefficients: [5]}"]).cases[0].spec.target
    assert target.coefficients == (5.0,)


def test_an_override_reaches_into_a_scenario(folder):
    folder("configs/a.yaml", CONFIG.replace("{kind: polynomial, coefficients: [1e5]}", "own"))
    folder("scenarios/own.yaml", "kind: polynomial\ncoefficients: [1, 2]\n")
    assert load("a", ["target.coefficients.1=7"]).cases[0].spec.target.coefficients == (1.0, 7.0)
    assert load("a", ["target=polynomial", "target.coefficients=[3]"]).cases[0].spec.target.coefficients == (3.0,)


OVERRIDES = [
    ("radar.sigma_range_m=-3", "--set radar.sigma_range_m: must be > 0, got -3"),
    ("radar.sigma_range_m=.nan", "--set radar.sigma_range_m: must be a finite number, got '.nan'"),
    ("radar.sigma_range_m=", "--set radar.sigma_range_m: is empty"),
    ("radar.sigma_range_m", "--set radar.sigma_range_m: must be KEY=VALUE, with a dotted KEY"),
    ("=3", "--set =3: must be KEY=VALUE, with a dotted KEY"),
    ("a..b=3", "--set a..b=3: must be KEY=VALUE, with a dotted KEY"),
    ("manoeuvre_variance=0", "--set manoeuvre_variance: must be > 0, got 0"),
    ("realisations=0", "--realisations: must be >= 1, got 0"),
    ("seed=-1", "--seed: must be >= 0, got -1"),
    ("scans={", "--set scans: not valid YAML: while parsing a flow node did not find expected node content"),
    ("scans=1\n---\n2", "--set scans: there must be one YAML document, here begins another"),
    ("scans=!!int 3", "--set scans: tags (tag:yaml.org,2002:int) are not read"),
    ("filters.2.name=x", "--set filters.2.name: filters is a list: its items are 0 to 1"),
    ("filters.q.name=x", "--set filters.q.name: filters is a list: its items are 0 to 1"),
    (
        "filters.manoeuvre_variance=1",
        "--set filters.manoeuvre_variance: filters is a list: its items are 0 to 1; the key alone, manoeuvre_variance, "
        "means it in each",
    ),
    ("radr.x=3", "--set radr.x: radr: unknown key; did you mean radar? allowed: "),
    ("scans.x=3", "--set scans.x: scans has no keys of its own"),
    ("filters.0.name.x=3", "--set filters.0.name.x: filters.0.name has no keys of its own"),
    ("radar={}", "--set radar: radar.scan_period_s: required key is missing"),
    ("study=sonr", "--set study: must be one of "),
    (
        "target.kind=trun",
        "--set target.kind: must be one of polynomial, acceleration_start, jerk_pulse, turn, fly_by, recorded, "
        "got 'trun'",
    ),
    ("seed.x=3", "--set seed.x: seed has no keys of its own"),
    (
        "radar.sigma_rnge_m=3",
        "--set radar.sigma_rnge_m: unknown key; did you mean sigma_range_m? allowed: name, band, ",
    ),
    (
        "manoeuver_variance=3",
        "--set manoeuver_variance: unknown key; did you mean manoeuvre_variance? allowed: radar, target, ",
    ),
    ("x\x1b[2J\n=3", r"--set x\x1b[2J: unknown key; allowed: radar, "),
]


@pytest.mark.parametrize(("override", "line"), OVERRIDES)
def test_bad_override(command_line, folder, said, override, line):
    assert any(found.startswith(line) for found in said("a", override)), said("a", override)


@pytest.mark.parametrize("override", [{"radar": {"sigma_range_m": -3}}, ["radar.sigma_range_m=-3"]])
def test_a_bad_override_from_python_names_no_option(folder, override):
    with pytest.raises(ConfigError) as refused:
        load("a", override)
    assert refused.value.lines == ("overrides['radar.sigma_range_m']: must be > 0, got -3",)


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ({"radar": {"sigma_rnge_m": 3}}, "overrides['radar.sigma_rnge_m']: unknown key; did you mean sigma_range_m?"),
        ({"filters": {5: {"name": "x"}}}, "overrides['filters.5.name']: filters is a list: its items are 0 to 1"),
        ({"scans": float("nan")}, "overrides['scans']: must be a finite number, got nan"),
        ({"target": None}, "overrides['target']: has no value"),
        ({"realisations": 0}, "realisations: must be >= 1, got 0"),
        ({"target": {"kind": "polynomial"}}, "overrides['target']: target.coefficients: required key is missing"),
    ],
)
def test_bad_override_of_a_mapping(folder, override, line):
    with pytest.raises(ConfigError) as refused:
        load("a", override)
    assert refused.value.lines[0].startswith(line)


def test_a_mapping_of_overrides_is_what_its_texts_say(folder):
    values = {
        "radar": {"sigma_range_m": np.float64(300), "name": 'no: "Ω", #'},
        "filters": {0: {"manoeuvre_variance": {"minimise": "sigma_r", "over": "worst"}, "name": "1e3"}},
        "filters.1.manoeuvre_variance": 1e-7,
        "target": {"kind": "polynomial", "coefficients": np.array([1e5, -250.0])},
        "baseline": ["1e3", "r+Vr"],
        "seed": 3,
    }
    found = load("a", values)
    assert found == load("a", override_texts(values))
    (case,) = found.cases
    assert (case.spec.radar.sigma_range_m, case.spec.radar.name, case.seed) == (300, 'no: "Ω", #', 3)
    assert case.spec.radar.sigma_velocity_mps == 15  # what a nested mapping does not name stays
    assert case.spec.filters[0].manoeuvre_variance.over == "worst"
    assert case.spec.filters[1].manoeuvre_variance == 1e-7
    assert case.spec.target.coefficients == (1e5, -250)
    assert (case.spec.baseline, case.further_baselines) == ("1e3", ("r+Vr",))


def test_an_override_of_a_swept_key_would_be_lost(command_line, folder, said):
    folder("configs/swept.yaml", CONFIG + "sweep: {filters.0.manoeuvre_variance: [1, 2]}\n")
    cure = "the config sweeps it: set sweep.filters.0.manoeuvre_variance=[...] instead"
    assert said("swept", "manoeuvre_variance=3") == [f"--set manoeuvre_variance: {cure}"]
    assert said("swept", "filters.1.manoeuvre_variance=3") == []
    assert said("swept", "sweep={scans: [9]}", "manoeuvre_variance=3") == []


SWEEPS = [
    (
        "manoeuver_variance: [1]",
        "own.yaml:10:9: sweep.manoeuver_variance: unknown key; did you mean manoeuvre_variance? allowed: ",
    ),
    ("manoeuvre_variance: [1, 0, -1]", "own.yaml:10:33: filters.0.manoeuvre_variance: must be > 0, got 0"),
    ("radar.sigma: [1]", "own.yaml:10:23: radar.sigma: unknown key; did you mean sigma_range_m? allowed: name, "),
    ("filters.9.name: [x]", "own.yaml:10:9: sweep.filters.9.name: filters is a list: its items are 0 to 1"),
    ("realisations: [1, 2]", "own.yaml:10:9: sweep.realisations: cannot be swept"),
    ("seed: [1, 2]", "own.yaml:10:9: sweep.seed: cannot be swept"),
    ("figures.a: [[x]]", "own.yaml:10:9: sweep.figures.a: cannot be swept"),
    ("scans: [15, 15]", "own.yaml:10:8: sweep: makes the case 'own scans=15' twice"),
    ("scans: [15, 1.5e1]", "own.yaml:10:8: sweep: makes the case 'own scans=15' twice"),
    ("target: [nowhere]", "own.yaml:10:18: target: no such scenario"),
]


@pytest.mark.parametrize(("sweep", "line"), SWEEPS)
def test_bad_sweep(house, said, sweep, line):
    house("own.yaml", CONFIG.replace("\n\n", "\n") + f"sweep: {{{sweep}}}\n")
    assert any(found.startswith(line) for found in said("own.yaml")), said("own.yaml")


INCLUDES = [
    ("include: [nowhere]", "c.yaml:1:11: include.0: no such config, got 'nowhere'"),
    ("include: [aa]", "c.yaml:1:11: include.0: no such config; did you mean a?, got 'aa'"),
    ("include: [a, ../a]", "c.yaml:1:14: include.1: must be the stem of a config, without folder"),
    ("include: [/etc/a]", "c.yaml:1:11: include.0: must be the stem of a config, without folder"),
    ("include: [c]", "c.yaml:1:11: include.0: a config cannot include itself, got 'c'"),
    ("include: [a, a]", "c.yaml:1:10: include: makes the case 'a' twice"),
    ("include: []", "c.yaml:1:10: include: must hold at least 1, got []"),
    ("include: a", "c.yaml:1:10: include: must be a list, got 'a'"),
    ("include: [3]", "c.yaml:1:11: include.0: must be text, got 3"),
    ("include: [a]\nscan: 3", "c.yaml:2:1: scan: unknown key; did you mean scans? allowed: radar, "),
    ("include: [a]\nfigures: {sigma_r: [b]}", "c.yaml:2:21: figures.sigma_r.0: no case has this name, got 'b'"),
    ("include: [loop]", "configs/loop.yaml:1:14: include.1: a config cannot include itself, got 'loop'"),
    ("include: [ring]", "configs/gnir.yaml:1:11: include.0: a config cannot include itself, got 'ring'"),
    ("include: [broken, a]", "configs/broken.yaml:3:44: radar.sigma_range_m: must be > 0, got -250"),
    ("include: [empty, a]", "configs/empty.yaml: is empty"),
    ("include: [d6]", "configs/d2.yaml:1:11: include.0: includes nested more than 5 deep, got 'd1'"),
]


@pytest.mark.parametrize(("text", "line"), INCLUDES)
def test_bad_include(folder, said, text, line):
    folder("configs/loop.yaml", "include: [a, loop]\n")
    folder("configs/ring.yaml", "include: [gnir]\n")
    folder("configs/gnir.yaml", "include: [ring]\n")
    folder("configs/empty.yaml", "")
    folder("configs/broken.yaml", "# a fault\n" + CONFIG.replace("sigma_range_m: 250", "sigma_range_m: -250"))
    folder("configs/d1.yaml", "include: [a]\n")
    for n in range(2, 7):
        folder(f"configs/d{n}.yaml", f"include: [d{n - 1}]\n")
    folder("c.yaml", text + "\n")
    found = said("c.yaml")
    assert [one for one in found if one.startswith(line)], found
    assert len(found) == 1


def test_a_study_may_be_named_beside_include_but_must_agree(folder, said):
    folder("configs/both.yaml", "include: [a, b]\nstudy: range_doppler\n")
    assert said("both") == []
    line = "configs/both.yaml:2:8: study: must be "
    for other, must in (("sonar", "that of the config, range_doppler"), ("nonsense", "one of range_doppler,")):
        folder("configs/both.yaml", f"include: [a, b]\nstudy: {other}\n")
        (fault,) = said("both")
        assert fault.startswith(line + must)
        assert fault.endswith(f"got '{other}'")
    folder("configs/both.yaml", "include: [a, b]\nstudy: {a: 1}\n")
    assert said("both") == ["configs/both.yaml:2:8: study: must be text, got {a: 1}"]


def test_one_study_a_run(folder, said):
    folder("configs/both.yaml", "include: [a, sonar_smoothing]\n")
    assert said("both") == ["configs/both.yaml:1:10: include: one study per run; these belong to range_doppler, sonar"]


@pytest.mark.slow
def test_too_many_cases_by_include_alone(folder, said):
    numbers = list(range(1, 81))
    sweep = f"include: [a]\nsweep: {{radar.sigma_range_m: {numbers}, manoeuvre_variance: {numbers}}}\n"
    folder("configs/first.yaml", sweep)
    folder("configs/second.yaml", sweep.replace("[a]", "[b]"))
    folder("configs/both.yaml", "include: [first, second]\n")
    assert said("both") == ["configs/both.yaml:1:18: include: more than 10000 cases"]


def test_an_override_below_a_scenario_that_is_not_there_is_not_told_twice(command_line, folder, said):
    lines = said("a", "target=../x", "target.kind=turn")
    assert lines == ["--set target: must be the stem of a scenario, without folder or suffix, got '../x'"]


def test_a_web_of_includes_is_read_once_each(folder, said):
    stems = [f"s{n}" for n in range(40)]
    for n, stem in enumerate(stems):
        folder(f"configs/{stem}.yaml", CONFIG if n < 30 else f"include: {stems[:30]}\nsweep: {{scans: [{n}]}}\n")
    folder("configs/all.yaml", f"include: {stems[30:]}\nsweep: {{radar.sigma_range_m: {list(range(1, 100))}}}\n")
    assert said("all") == ["configs/all.yaml:2:8: sweep: more than 10000 cases"]


def test_figures_name_their_cases(folder):
    folder("configs/swept.yaml", CONFIG + "sweep: {filters.0.observes: [[range], [range, velocity]], scans: [9, 10]}\n")
    folder("configs/f.yaml", "include: [a, swept]\nfigures: {sigma_r: [a], gain_r: ['swept * scans=?', 'a']}\n")
    experiment = load("f")
    assert experiment.figures == {"sigma_r": ("a",), "gain_r": ("swept * scans=?", "a")}
    assert [case.name for case in experiment.cases_in_figure("sigma_r")] == ["a"]
    assert [case.name for case in experiment.cases_in_figure("gain_r")] == [
        "a",
        "swept filters.0.observes=[range] scans=9",
        "swept filters.0.observes=[range,velocity] scans=9",
    ]
    assert experiment.cases_in_figure("sigma_Vr") == experiment.cases
    assert experiment.selected_figures(["gain_Vr", "gain_r", "sigma_r"]) == ["sigma_r", "gain_r"]


@pytest.mark.parametrize(
    ("named", "drawn"),
    [
        ("[gain_Vr, 'sigma_*', gain_r]", ["gain_Vr", "sigma_r", "sigma_Vr", "gain_r"]),
        ("['*r', gain_r]", ["gain_r", "gain_Vr", "sigma_r", "sigma_Vr"]),
        ("[]", ["gain_r", "gain_Vr", "sigma_r", "sigma_Vr", "claims"]),
    ],
)
def test_named_figures_are_drawn_in_their_order_with_all_cases(folder, named, drawn):
    folder("configs/f.yaml", f"include: [a]\nfigures: {named}\n")
    experiment = load("f")
    assert experiment.selected_figures(["gain_r", "gain_Vr", "sigma_r", "sigma_Vr", "claims"]) == drawn
    assert experiment.cases_in_figure("sigma_r") == experiment.cases


def test_brackets_in_patterns_are_brackets():
    assert matches_pattern("a observes=[range] scans=3", "* observes=[range] scans=?")
    assert not matches_pattern("a observes=r scans=3", "* observes=[range] scans=?")


def test_a_mapping_is_a_config_too(good):
    experiment = load(good, ["sweep.scans=[9, 10]"])
    assert names(experiment) == ["config scans=9", "config scans=10"]
    assert (experiment.stem, experiment.path) == ("config", None)
