"""A claim is judged in the paper's experiment alone: every other key of every study, changed one at a time."""

from dataclasses import replace

import pytest

import radarsim
from radarsim.api import configs, result_content
from radarsim.config.find_files import SHIPPED
from radarsim.config.marks import DisplayMark
from radarsim.config.model import Model
from radarsim.config.validate import models_in
from radarsim.papers.claims_table import NOT_JUDGED
from radarsim.papers.paper_cases import case_keys, paper_members
from radarsim.papers.result_claims import unjudged_claims
from radarsim.papers.study_claims import claims_of, paper_claims
from radarsim.studies import registry

CONFIGS = sorted({claim.config for of in paper_claims() for claim in of.claims})
MAY_GROW = {
    "range_doppler": (),
    "multimodel": ("filters",),
    "sonar": ("filters",),
    "discriminator": ("estimators",),
    "ambiguous_doppler": (),
    "pulses_to_tracks": (),
}
# The only keys that may have another value than in the paper's experiment: names that are displayed.
MAY_DIFFER = {
    "range_doppler": {"radar.name", "radar.band", "filters.name", "scans"},
    "ambiguous_doppler": {"radar.name", "radar.band", "filters.name"},
    "pulses_to_tracks": {"radar.name", "radar.band", "filters.name"},
    "multimodel": {"sensor.name", "filters.name"},
    "sonar": {"sensor.name", "filters.name", "detectors.name"},
    "discriminator": {"estimators.name"},
}


def variants(value):
    """(path, changed value) for every leaf of a checked config; lists also shorter, options also set."""
    if isinstance(value, Model):
        for name in type(value).model_fields:
            for path, changed in variants(getattr(value, name)):
                yield (name, *path), value.model_copy(update={name: changed})
    elif isinstance(value, tuple | list):
        if value:
            yield (), value[:-1]
        for i, item in enumerate(value):
            for path, changed in variants(item):
                yield path, (*value[:i], changed, *value[i + 1 :])
    elif isinstance(value, bool):
        yield (), not value
    elif isinstance(value, int | float):
        yield (), value * (1 + 1e-9) + (value == 0) if isinstance(value, float) else value + 1
    else:
        yield (), 1.0 if value is None else f"{value}x"


def swept(spec):
    """Names of keys that name others, such as `baseline`, must name a member: they are changed to another one."""
    for path, changed in variants(spec):
        if path == ("baseline",):
            if len(spec.filters) < 2:
                continue
            changed = spec.model_copy(update={"baseline": spec.filters[-1].name})
        yield ".".join(path), changed


@pytest.mark.parametrize("config", CONFIGS)
def test_every_key_but_the_declared_ones_makes_another_experiment(config):
    study, cases = configs.load(config).study, configs.shipped(config)
    may_grow = claims_of(registry.study(study)).may_grow
    may_shorten = claims_of(registry.study(study)).may_shorten
    assert may_grow == MAY_GROW[study]
    for case in cases[:6]:
        spec, papers = case.spec, [case_keys(case, may_grow, may_shorten)]
        changes = {path: replace(case, spec=changed) for path, changed in swept(spec)}
        mine = {path: case_keys(changed, may_grow, may_shorten) for path, changed in changes.items()}
        still = {path for path, own in mine.items() if paper_members(own, papers, may_grow) is not None}
        assert still == {path for path, _ in swept(spec)} & MAY_DIFFER[study]


@pytest.mark.parametrize("study", MAY_GROW)
def test_only_the_declared_keys_are_for_display(study):
    def marked(model, path=()):
        for name, info in model.model_fields.items():
            if any(isinstance(mark, DisplayMark) for mark in info.metadata):
                yield ".".join((*path, name))
            for inner in models_in(info.annotation):
                yield from marked(inner, (*path, name))

    assert set(marked(registry.keys(study))) == MAY_DIFFER[study] - {"scans"}


@pytest.mark.slow_cases_except("discriminator_paper-prior.scale=2")
@pytest.mark.parametrize(
    ("config", "override"),
    [
        ("multimodel", "transition_interval_s=10"),
        ("multimodel", "start_acceleration_mps2=500"),
        ("multimodel", "sensor.antenna_elevation_deg=0"),
        ("discriminator_paper", "prior.scale=2"),
        ("sonar_smoothing", "scans=60"),
        ("range_doppler", "target={kind: polynomial, coefficients: [1e5, -250, 4, 0.1]}"),
    ],
)
def test_a_changed_experiment_judges_nothing(config, override):
    table = radarsim.run(config, overrides=[override], realisations=50).tables["claims"]
    assert len(table)
    assert table["class"].eq(NOT_JUDGED).all()
    assert table["reason"].str.contains("not the paper's experiment: ").all()
    assert table[["measured", "miss", "old_verdict"]].replace("", float("nan")).isna().all(axis=None)


@pytest.mark.slow
def test_realisations_seed_names_and_further_filters_may_differ():
    further = {"name": "mine", "kind": "window", "degree": 1, "plots": 7}
    source = dict(configs.load("sonar_smoothing").resolved["cases"][0])
    source = {key: value for key, value in source.items() if key not in ("case", "swept")}
    source |= {"study": "sonar", "seed": 99, "realisations": 70, "filters": [*source["filters"], further]}
    source["filters"][0]["name"] = "another name"
    plain = radarsim.run("sonar_smoothing", realisations=70).tables["claims"]
    found = radarsim.run(source).tables["claims"]
    assert set(found["claim"]) == set(plain["claim"])


@pytest.mark.slow
def test_a_file_of_the_users_is_no_measure_of_the_paper(tmp_path, monkeypatch):
    """A config of a shipped one's name in the working directory changes neither what is judged nor how."""
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "polynomial.yaml").write_text("kind: polynomial\ncoefficients: [5e4, -100]\n")
    text = (SHIPPED / "configs" / "rls1.yaml").read_text()
    (tmp_path / "rls1.yaml").write_text(text.replace("sigma_range_m: 25", "sigma_range_m: 30"))
    monkeypatch.chdir(tmp_path)
    configs.shipped.cache_clear()
    assert radarsim.run("rls1.yaml", realisations=50).tables["claims"].empty
    found = radarsim.claims("rls1.yaml").table
    assert found["class"].eq(NOT_JUDGED).all()
    why = "not the paper's experiment: rls1: radar.sigma_range_m is 30, the paper's 25"
    assert found["reason"].str.startswith(why).all()
    unchanged = radarsim.run(SHIPPED / "configs" / "rls1.yaml", realisations=50).cases
    assert not result_content.case_tables(unchanged)["claims"].empty


HELD_TOO = {stem: ids for of in paper_claims() for stem, ids in of.held_too.items()}
QUICK = ("rls1", "rls2", "rls3", "manoeuvre_variance", "discriminator_as_printed", "sonar_fluctuating")


@pytest.mark.slow_cases("sonar_fluctuating")
@pytest.mark.parametrize(
    "config",
    [
        pytest.param(path.stem, marks=() if path.stem in QUICK else pytest.mark.slow)
        for path in sorted((SHIPPED / "configs").glob("*.yaml"))
    ],
)
def test_a_config_holds_the_claims_that_it_is_said_to_hold(config):
    """Unchanged it judges its own and those of `held_too`, and no other; that these are lost can then be said."""
    own = {claim.id for of in paper_claims() for claim in of.claims if claim.config == config}
    table = radarsim.run(config, realisations=20).tables["claims"]
    assert set(table["claim"]) == own | set(HELD_TOO.get(config, ()))
    assert not table["class"].eq(NOT_JUDGED).any()


@pytest.mark.parametrize(
    ("config", "override"),
    [("rls1", "radar.sigma_range_m=30"), ("rls2", "target.coefficients=[1e5]"), ("rls2", "scans=12")],
)
def test_claims_of_another_config_are_not_lost_in_silence(config, override):
    found = radarsim.run(config, overrides=[override], realisations=50)
    table = found.tables["claims"]
    assert set(table["claim"]) == set(HELD_TOO[config])
    lost = table["verdict"].eq(NOT_JUDGED)
    assert lost.any()
    assert table.loc[lost, "reason"].ne("").all()
    assert {claim for names in unjudged_claims(found).values() for claim in names} == set(table.loc[lost, "claim"])
