"""A filter of an installed package is one of the study's: every command, the same noise, an identity of its own.

The package is examples/frozen, so this proves the example too. One that cannot be used harms nothing else.
"""

import json
import shutil
from pathlib import Path

import pytest

from tests.studies import example_packages

ROOT = Path(__file__).parents[2]
N = 9000  # two whole blocks and a partial one
BASE = "import numpy as np\nfrom typing import Literal; from radarsim.config.key_types import key\n"
BASE += "from radarsim.studies.range_doppler.package_filters import GivenGains\n"
CLASS = (
    BASE
    + """
class Own(GivenGains):
    kind: Literal["{kind}"] = key("kind", "one of my own")
    def gains(self, scans):
        {body}
"""
)
PACKAGES = {  # kind: source of its module, why it cannot be used
    "mine": ("import no_such_thing", "which cannot be loaded: ModuleNotFoundError: No module named 'no_such_thing'"),
    "leaving": ("raise SystemExit('no licence')", "which cannot be loaded: SystemExit: no licence ("),
    "seven": ("Own = 7", "for the study None, which takes no filters of packages: range_doppler does"),
    "deep": (CLASS.format(kind="deep", body="pass") + "    study = 'sonar'\n", "for the study sonar, which takes no "),
    "loose": (
        "class Own:\n    study = 'range_doppler'\n",
        "which must be a class derived from radarsim.studies.range_",
    ),
    "vague": (
        BASE + "class Own(GivenGains):\n    pass\n",
        "which must be a class derived from radarsim.studies.range_",
    ),
    "other": (CLASS.format(kind="another", body="pass"), "whose key kind must be Literal['other']"),
    "kalman": (CLASS.format(kind="kalman", body="pass"), "which range_doppler has itself: that of the package is not "),
}
NOISE = "return np.zeros((15, 3, 2))\n    def noise(self, dt_s):\n        return {}"
COVARIANCE = "must give a covariance, finite, symmetric and not negative, got [["
FAILING = {  # kind: what its gains do, what is said; its place is the module's line
    "fails": ("return scans.no_such", 8, "Own.gains: AttributeError: 'Scans' object has no attribute 'no_such'"),
    "numpys": ("return np.stack([np.eye(2), np.eye(3)])", 8, "Own.gains: ValueError: all input arrays must have the"),
    "leaves": ("raise SystemExit", 8, "Own.gains: SystemExit"),
    "short": ("return scans.t_s", 7, "Own.gains: must give numbers (15, 3, 2), got (15,)"),
    "words": ("return 'large'", 7, "Own.gains: must give numbers (15, 3, 2), got 'large'"),
    "endless": ("return scans.kalman(self.noise) / 0", 7, "Own.gains: must make finite gains, those of scan 3 are [["),
    "flat": (NOISE.format("[[1]]"), 9, "Own.noise: must give numbers (3, 3), got (1, 1)"),
    "negative": (NOISE.format("np.diag([1e6, 1, -1e-4])"), 9, f"Own.noise: {COVARIANCE}"),
    "skew": (NOISE.format("np.triu(np.ones((3, 3)))"), 9, f"Own.noise: {COVARIANCE}"),
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the example, installed in its folder `site`."""
    folder = tmp_path_factory.mktemp("filters")
    (folder / "site").mkdir()
    shutil.copytree(ROOT / "examples/frozen", folder / "frozen")
    shutil.copy(folder / "frozen/frozen.yaml", folder)
    example_packages.installed(folder / "frozen", folder / "site")
    return folder


@pytest.fixture(scope="module")
def radarsim(place, warm):
    """The real command beside the installed package."""
    return example_packages.beside(warm, place / "site", place)


@pytest.fixture(scope="module")
def ran(place, radarsim):
    """The folder of results of a finished run."""
    radarsim("run", "frozen.yaml", "-n", N, "--threads", 1, "--no-figures", "--out", "results")
    return place / "results/frozen"


def rows(folder, table, name):
    return [line for line in (folder / f"{table}.csv").read_text().splitlines() if line.split(",")[1] == name]


@pytest.mark.slow
def test_its_own_tests_pass(place, radarsim):
    assert "7 passed" in radarsim("-q", "-p", "no:cacheprovider", cwd=place / "frozen", module="pytest").stdout


def test_it_is_in_list_and_schema_and_checked(radarsim):
    listed = json.loads(radarsim("list", "--json").stdout)["filters"]
    words = "a Kalman filter whose gains are frozen from a scan on"
    assert {"study": "range_doppler", "keys": "kind: frozen", "what it is": words} in listed
    schema = json.loads(radarsim("schema").stdout)["$defs"]
    choice = schema["range_doppler"]["properties"]["filters"]
    assert {"$ref": "#/$defs/Frozen"} in choice["items"]["oneOf"]
    assert (choice["minItems"], choice["maxItems"]) == (1, 16)
    assert {"kind", "freeze_after"} <= set(schema["Frozen"]["required"])


def test_its_keys_are_checked(place, radarsim, tmp_path):
    text = (place / "frozen.yaml").read_text()
    wrong = {
        ("kind: frozen", "kind: frosen"): "filters.2.kind: must be one of kalman, frozen, got 'frosen'",
        ("kind: frozen", "kind: 7"): "filters.2.kind: must be one of kalman, frozen, got 7",
        ("freeze_after: 4", "freeze_after: 0"): "filters.2.freeze_after: must be >= 1, got 0",
        ("freeze_after: 4", "freeze: 4"): "filters.2.freeze: unknown key; did you mean freeze_after?",
        ("observes: [range], ", "observes: [range], freeze_after: 3, "): "filters.0.freeze_after: unknown key",
        (
            "scan_period_s: 10",
            "scan_period_s: 10, detection_probability: 0.9",
        ): "must be 1 with filter frozen: gains of ",
    }
    for i, (old, new) in enumerate(wrong):
        assert old in text
        (tmp_path / f"{i}.yaml").write_text(text.replace(old, new))
    assert "frozen.yaml: valid" in radarsim("check", "frozen.yaml").stdout
    faults = radarsim("check", *(f"{i}.yaml" for i in range(len(wrong))), cwd=tmp_path, code=2).stderr
    for i, said in enumerate(wrong.values()):
        assert any(line.startswith(f"{i}.yaml:") and said in line for line in faults.splitlines()), said


def test_the_others_noise_and_errors_are_what_they_are_without_it(ran, radarsim, tmp_path):
    own = (ran.parent.parent / "frozen.yaml").read_text().splitlines()
    (tmp_path / "frozen.yaml").write_text("\n".join(line for line in own if "kind: frozen" not in line))
    radarsim("run", "frozen.yaml", "-n", N, "--no-figures", "--out", ".", cwd=tmp_path)
    for name in ("r", "r+Vr"):
        for table in ("curves", "gains", "consistency", "steady"):
            assert rows(ran, table, name) == rows(tmp_path / "frozen", table, name)
    assert rows(ran, "gains", "frozen")
    assert {line.split(",")[2] for line in rows(ran, "gains", "frozen")} == {"r"}  # paired, against the first


@pytest.mark.slow
def test_it_is_solved_and_followed(ran, radarsim, tmp_path):
    asked = ("solve", ran.parents[1] / "frozen.yaml", "radar.sigma_velocity_mps", "--sigma", "r", "--filter", "frozen")
    answer = json.loads(radarsim(*asked, "--equals", 150, "--json", cwd=tmp_path).stdout)
    assert answer["exact"]
    assert answer["value"] == pytest.approx(13.0126, abs=5e-5)  # as printed
    radarsim("simulate", "frozen.yaml", "-o", tmp_path / "plots.csv")
    followed = ("track", "frozen.yaml", tmp_path / "plots.csv", "-o", tmp_path / "track.csv")
    assert "\nfrozen  r " in radarsim(*followed).stdout  # a row of the errors against the truth
    said = radarsim("fit", "frozen.yaml", tmp_path / "plots.csv", "--filter", "frozen", code=2).stderr
    assert said.startswith("filter: frozen does not say how likely plots are")


@pytest.mark.slow
def test_an_edit_of_the_package_begins_anew_its_own_cases_alone(ran, place, radarsim, tmp_path):
    program = "import sys\nfrom radarsim.api.configs import load\nfrom radarsim.studies.identity import identity\n"
    program += "import pickle\nfor config in sys.argv[1:]:\n    (case,) = load(config).cases\n"
    program += "    assert pickle.loads(pickle.dumps(case)) == case  # as it travels to workers\n"
    program += "    print(identity(case))\n"
    (tmp_path / "named.py").write_text(program)

    def identities():
        return radarsim(place / "frozen.yaml", "rls2", module="named", cwd=tmp_path).stdout.split()

    source = place / "frozen/src/frozen_gains/__init__.py"
    text, before = source.read_text(), identities()
    try:
        source.write_text(text.replace("return gains", "return gains * (1 + 1e-12)"))
        after = identities()
        assert (after[0] == before[0], after[1] == before[1]) == (False, True)
        radarsim("run", "frozen.yaml", "-n", N, "--no-figures", "--out", "results")
        assert json.loads((ran / "run.json").read_text())["realisations_computed"] == N
    finally:
        source.write_text(text)


@pytest.fixture(scope="module")
def beside_broken(tmp_path_factory, warm):
    """The command beside packages that cannot be used, two of one kind, and some whose gains fail; and where."""
    folder = tmp_path_factory.mktemp("broken")
    site = folder / "site"
    sources = {kind: source for kind, (source, _) in PACKAGES.items()}
    sources |= {kind: CLASS.format(kind=kind, body=body) for kind, (body, *_) in FAILING.items()}
    for kind, source in sources.items():
        example_packages.metadata(site, f"pack-{kind}", "2.0", {kind: f"module_of_{kind}:Own"}, "radarsim.filters")
        (site / f"module_of_{kind}.py").write_text(source)
    for number in (1, 2):
        offers = {"twice": "module_of_twice:Own"}
        example_packages.metadata(site, f"pack-twice{number}", "2.0", offers, "radarsim.filters")
    (site / "module_of_twice.py").write_text(CLASS.format(kind="twice", body="pass"))
    return example_packages.beside(warm, site, folder), site


def test_what_cannot_be_used_is_named_where_it_is_asked_for_and_listed(beside_broken, tmp_path):
    radarsim, _ = beside_broken
    both = "filter twice of range_doppler: offered by the packages pack-twice1 and pack-twice2: uninstall all but one"
    listed = json.loads(radarsim("list", "--json").stdout)["filters"]
    told = {one["keys"]: one["what it is"] for one in listed if "cannot be used" in one["what it is"]}
    words = {
        kind: f"the package pack-{kind} 2.0 offers the filter {kind}, {why}" for kind, (_, why) in PACKAGES.items()
    }
    words["twice"] = both
    assert told.keys() == {f"kind: {kind}" for kind in words}
    assert all(told[f"kind: {kind}"].startswith(f"cannot be used: {why}") for kind, why in words.items())
    del words["kalman"]
    shipped = (ROOT / "configs/rls2.yaml").read_text()
    for kind in words:
        (tmp_path / f"{kind}.yaml").write_text(shipped.replace("{name: r,", f"{{name: r, kind: {kind},"))
    faults = radarsim("check", *(f"{kind}.yaml" for kind in words), cwd=tmp_path, code=2).stderr.splitlines()
    for (kind, why), fault in zip(words.items(), faults, strict=True):
        assert fault.startswith(
            f"{kind}.yaml:12:21: filters.0.kind: must be one of kalman, {', '.join(sorted(FAILING))}; {why}"
        )


def test_others_take_no_harm(beside_broken):
    radarsim, _ = beside_broken
    assert radarsim("check", "rls2", "sonar_smoothing").stdout.count("valid") == 2
    filters = json.loads(radarsim("schema").stdout)["$defs"]["range_doppler"]["properties"]["filters"]
    assert len(filters["items"]["oneOf"]) == 1 + len(FAILING) + 1  # its own, and code of the user's


@pytest.mark.slow_cases_except("flat", "fails")
@pytest.mark.parametrize("kind", FAILING)
def test_gains_that_fail_end_in_one_line(beside_broken, tmp_path, kind):
    radarsim, site = beside_broken
    own = f"filters=[{{name: a, kind: {kind}, observes: [range, velocity]}}]"
    fault = radarsim("run", "rls2", "-n", 10, "--set", own, "--out", tmp_path, code=2).stderr
    _, line, said = FAILING[kind]
    assert fault.splitlines()[-1].startswith(f"{site}/module_of_{kind}.py:{line}: filter a: kind {kind}: {said}")
