"""The frame of studies in one file: what follows from the class, and what is said of one that lacks something."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from radarsim.config.experiment import Case, Experiment
from radarsim.config.key_types import NonNegative, Positive, key
from radarsim.config.model import Model
from radarsim.config.study_keys import Member
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.papers import one_file_measures
from radarsim.papers.claims_table import claims_table, failed_measures
from radarsim.papers.evidence import MissingEvidence, UnknownName
from radarsim.papers.measure_call import MeasureCall
from radarsim.papers.study_claims import check_declarations, claim_faults, claims_of, interpretations_of
from radarsim.report import tables
from radarsim.report.quantities import Component
from radarsim.studies.interface import Paper
from radarsim.studies.noise import noise_key
from radarsim.studies.onefile import MeasuredColumn, OneFile
from radarsim.studies.plot_arrays import true_column
from tests.answers import answer_texts
from tests.tolerances import assert_rounded

N = 4000


class Sensor(Model):
    """A gauge."""

    sigma_x_m: Positive = key("σ of the measured x", "standard deviation of a plot, m", symbol="σ_x")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="T")


class Target(Model):
    """What is gauged."""

    sigma_step_m: NonNegative = key("σ of a step", "standard deviation of a step, m", symbol="σ_w")


class Smoothing(Member):
    """Exponential smoothing."""

    gain: Positive = key("gain", "share of the innovation, no unit")


class Plan(NamedTuple):
    layout: object
    axes: object
    key: np.ndarray
    spec: object
    block: int = 1000
    gaussian: bool = True


class Walk(OneFile):
    """A random walk followed with fixed gains."""

    name, about, filters = "walk", "A random walk.", {"gain": "fixed"}
    asks = "How well is a random walk followed?"
    components = (Component("x", "m", "$x$", "position"),)
    parts = {"sensor": Sensor, "target": Target}  # noqa: RUF012
    Filter = Smoothing
    scan_period = "sensor.scan_period_s"
    measured = (MeasuredColumn("x_m", "m", ("sensor.sigma_x_m",)),)
    paper = Paper("Kalman 1960", may_grow=("filters",))
    claims_yaml = """
paper: walk
config: walk
claims:
- id: 1
  place: section 1
  statement: The quick filter is the better one where steps are long
  parts:
  - {of: [{target.sigma_step_m: 2}], what: gain, unit: "%", measure: {gain: {filter: quick, component: x}},
     expected: {above: 0}}
choices:
- key: noise
  asks: what sigma is
  original: nothing
  alternatives:
  - {name: of a plot, kind: U, reason: the usual}
  - {name: a half of it, kind: U, reason: as usual, sets: {sensor.sigma_x_m: 0.5, gain: 0.3}}
"""

    def prepare(self, case):
        spec, sigma = case.spec, np.empty((len(case.spec.filters), case.spec.scans, 1))
        for f, one in enumerate(spec.filters):
            S = 0.0
            for k in range(spec.scans):
                S = (1 - one.gain) ** 2 * (S + spec.target.sigma_step_m**2) + one.gain**2 * spec.sensor.sigma_x_m**2
                sigma[f, k] = np.sqrt(S)
        return Plan(self.sums(spec), self.axes(spec, sigma, 0 * sigma), noise_key(case, "plots"), spec)

    def simulate(self, plan, first, count):
        spec, random = plan.spec, np.random.default_rng(first)
        x, estimate = np.zeros(count), np.zeros((len(spec.filters), count))
        gains = np.array([[one.gain] for one in spec.filters])
        sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
        for k in range(spec.scans):
            x = x + spec.target.sigma_step_m * random.standard_normal(count)
            estimate += gains * (x + spec.sensor.sigma_x_m * random.standard_normal(count) - estimate)
            e = estimate - x
            sums["error"][:, k, 0] = np.stack([(e**p).sum(axis=1) for p in (1, 2, 3, 4)], axis=1)
            sums["paired"][:, k, 0] = (e**2 * e[plan.axes.baseline] ** 2).sum(axis=1)
        return plan.layout.pack(**sums)

    def limits(self, spec):
        q, R = spec.target.sigma_step_m**2, spec.sensor.sigma_x_m**2
        kept = np.array([[(1 - one.gain) ** 2, one.gain**2] for one in spec.filters])
        return np.sqrt((kept[:, :1] * q + kept[:, 1:] * R) / (1 - kept[:, :1]))


FILTERS = ({"name": "slow", "gain": 0.2}, {"name": "quick", "gain": 0.6})


def case_of(study, step=2.0):
    given = {"sensor": {"sigma_x_m": 1.0, "scan_period_s": 2.0}, "target": {"sigma_step_m": step}, "filters": FILTERS}
    spec = study.keys().model_validate({**given, "scans": 40})
    return Case(f"walk step={step}", "walk", "walk", spec, (("target.sigma_step_m", step),), N, 1)


@pytest.fixture(scope="module")
def made():
    """The study, its cases' results and their tables."""
    study, results = Walk(), []
    for case in (case_of(study, 0.1), case_of(study)):
        plan = study.prepare(case)
        sums = plan.layout.unpack(study.simulate(plan, 0, N))
        results.append(CaseResult(case.name, "walk", case.spec, case.swept_values, N, sums, plan.axes))
    every = study.tables(results) | {"curves": tables.curves(results), "gains": tables.gains(results)}
    return study, results, every


def test_keys_are_the_parts_and_what_every_study_has():
    keys = Walk().keys()
    assert list(keys.model_fields) == ["sensor", "target", "filters", "baseline", "scans"]
    assert keys.figure_names == ("sigma_x", "gain_x", "dynamic_x")
    with pytest.raises(ValueError, match="names must differ"):
        keys.model_validate({**case_of(Walk()).spec.model_dump(), "filters": (FILTERS[0], FILTERS[0])})
    one, other = (noise_key(case_of(Walk(), step), "plots") for step in (1.0, 2.0))
    assert one.tolist() != other.tolist()


def test_the_table_of_the_last_scan_holds_what_was_measured_and_what_is_exact(made):
    _, results, every = made
    last = every["last"]
    assert list(last["filter"]) == ["slow", "quick"] * 2
    off = abs(last["last_sigma"] - last["exact_last_sigma"])
    assert (off < 2.5 * (last["last_sigma_hi"] - last["last_sigma_lo"]) / 2).all()
    start_left = 0.8 ** (2 * 39)  # of the variance, by the slow filter, after forty scans
    assert last["steady_sigma"].to_numpy() == pytest.approx(last["exact_last_sigma"].to_numpy(), rel=start_left)
    assert list(last["exact_last_sigma"]) == [one for r in results for one in r.axes.exact_sigma[:, -1, 0]]


def test_the_limit_is_a_quantity_of_a_study_that_knows_it():
    (*_, limit), bare = Walk().quantities(), type("Bare", (Walk,), {"limits": OneFile.limits, "__module__": __name__})
    assert (limit.option, limit.table, limit.value) == ("--limit", "last", "steady_sigma")
    assert [one.name for one in bare().quantities()] == ["sigma", "gain"]


def test_question_answer_and_figures(made):
    study, results, every = made
    experiment = Experiment("walk", "walk", None, (case_of(study, 0.1), case_of(study)), N, 1)
    assert study.question(experiment) == "How well is a random walk followed? Filters: “slow” and “quick”."
    answer = answer_texts(study, results, every)
    slow, quick = (f"{value:.4g} m" for value in results[1].axes.exact_sigma[:, -1, 0])
    assert answer[2] == f"σ_w = 2 m, RMS error of the position after 78 s: “slow” {slow} and “quick” {quick}."
    assert answer[3].startswith("σ_w = 2 m, gain over “slow” at 78 s: “quick” ")
    other = [replace(one, name=name, swept_values=()) for one, name in zip(results, ("walk", "stroll"), strict=True)]
    tables_of = {name: table.replace({one.name: own.name for one, own in zip(results, other, strict=True)})
                 for name, table in every.items()}  # fmt: skip
    heads = [sentence.partition(": ")[0] for sentence in answer_texts(study, other, tables_of)]
    assert heads == ["walk", "walk", "stroll", "stroll"]
    drawn = study.figures(results, every, experiment)
    assert set(drawn) == {"sigma_x", "gain_x"}
    assert "position" in drawn["sigma_x"].title


def test_claims_find_a_case_by_its_keys_and_interpretations_set_keys(made):
    study, results, every = made
    papers = claims_of(study)
    (claim,) = papers.claims
    places = {result.name: {"filters": {0, 1}} for result in results}
    seen = papers.evidence(results, every, places)
    found, exact = claim.parts[0].measure(seen), claim.parts[0].measure(seen.exactly())
    ratio = results[1].axes.exact_sigma[1, -1, 0] / results[1].axes.exact_sigma[0, -1, 0]
    assert_rounded(exact.value, 100 * (1 - ratio), size=100, operations=5)
    assert found.lo < exact.value < found.hi
    assert seen.case({"scans": 40}) is results[0]
    with pytest.raises(ConfigError, match=r"target\.step: there is no such key"):
        seen.case({"target.step": 2})
    interpretations = interpretations_of(study)
    assert [interpretations.name(one) for one in interpretations.for_claim("walk.1")] == [
        "as shipped",
        "noise: a half of it",
    ]
    changed = interpretations.changed_case(
        claim, case_of(study), interpretations.interpretation(noise="a half of it")
    ).spec
    assert (changed.sensor.sigma_x_m, [one.gain for one in changed.filters]) == (0.5, [0.3, 0.3])
    assert changed.target == case_of(study).spec.target


def test_a_ratio_is_paired_where_one_of_the_two_is_the_baseline(made):
    study, results, every = made
    seen = claims_of(study).evidence(results, every, {result.name: {"filters": {0, 1}} for result in results})
    at = {"target.sigma_step_m": 2}
    one = one_file_measures.ratio(seen, at, "quick", "slow", "x")
    other = one_file_measures.ratio(seen, at, "slow", "quick", "x")
    assert_rounded(one.value, 1 / other.value, operations=5)
    quick, slow = (one_file_measures.sigma(seen, at, name, "x").value for name in ("quick", "slow"))
    assert_rounded(quick / slow, one.value, operations=5)
    assert one.lo < one.value < one.hi
    assert other.lo < other.value < other.hi


WRONG = {
    "asks": (None, r"test_onefile\.py: Wrong\.asks must be given: the question, one sentence; got nothing"),
    "components": ((Component("x", ""),), "components: .* must be Component.*, with a unit"),
    "paper": ("Kalman", r"paper: must be Paper\(…\), got 'Kalman'"),
    "Filter": (Sensor, r"Filter must be a subclass of radarsim\.config\.study_keys\.Member, got .*Sensor"),
    "scan_period": ("sensor.period_s", r"scan_period: there is no key sensor\.period_s"),
    "scan_period ": ("gain", r"scan_period: gain must be a key of a part, PART\.KEY"),
    "measured": ((MeasuredColumn("x_m", "m", ("sensor.sigma",)),), r"x_m: there is no key sensor\.sigma"),
    "measured ": ((MeasuredColumn("x_m", "m", "sensor.sigma_x_m"),), r"x_m: sigma_keys must be a tuple, \('sensor"),
    "measured  ": (
        MeasuredColumn("x_m", "m"),
        r"MeasuredColumn\(column='x_m', .*\) must stand in a tuple, \(MeasuredColumn\(…\),\)",
    ),
    "components ": (Component("x", "m"), r"Component\(name='x', .*\) must stand in a tuple"),
    "paper ": (Paper("Kalman", may_grow="filters"), r"paper: may_grow: must be a tuple, \('filters',\)"),
    "claims_yaml": (
        Walk.claims_yaml.replace("{gain: {filter", "{gian: {filter"),
        r"test_onefile\.py:\d+:\d+: claims\.0\.parts\.0\.measure: must be one of them; did you mean gain\?",
    ),
}


def check(study):
    """What is checked of a study before its configs are read."""
    study.keys()
    check_declarations(study)


@pytest.mark.parametrize("name", WRONG)
def test_what_is_missing_is_one_line(name):
    value, said = WRONG[name]
    Wrong = type("Wrong", (Walk,), {name.strip(): value, "__module__": __name__})
    with pytest.raises(ConfigError, match=said) as caught:
        check(Wrong())
    assert len(caught.value.lines) == 1


def test_a_time_between_plots_is_a_time():
    Wrong = type("Wrong", (Walk,), {"scan_period": "sensor.about", "__module__": __name__})
    Wrong.components = {"sensor": type("Odd", (Sensor,), {"about": property(lambda self: "often")}), "target": Target}
    with pytest.raises(ConfigError, match=r"scan_period: sensor\.about must be a time > 0, s; got 'often'"):
        Wrong().scan_period_s(SimpleNamespace(sensor=SimpleNamespace(about="often")))


def test_a_key_that_no_interpretation_can_set_is_one_line():
    text = Walk.claims_yaml.replace("sensor.sigma_x_m: 0.5", "sensor.sigma: 1")
    with pytest.raises(ConfigError, match=r"choices: sets: there is no key sensor\.sigma"):
        check(type("Wrong", (Walk,), {"claims_yaml": text, "__module__": __name__})())


UNKNOWN = {  # in the text: what stands there instead, and what is said of it
    "filter: quick": ("filter: quikc", "no filter 'quikc'; there are slow, quick"),
    "component: x": ("component: y", "no component 'y'; there are x"),
    "{filter: quick, component: x}": ("{filter: slow, component: x}", "filter 'slow' is the baseline: it has no gain"),
    "component: x}": ("component: x, at: 0}", "no scan 0; there are 1 to 40"),
    "component: x}}": ("component: x, at: 41}}", "no scan 41; there are 1 to 40"),
    "target.sigma_step_m: 2": ("target.step: 2", "of: target.step: there is no such key"),
    "{target.sigma_step_m: 2}": ("{target.sigma_step_m: 7}", "of: no case has target.sigma_step_m 7"),
    "config: walk": ("config: walkk", "config: no such config 'walkk' is shipped; there are none"),
    "gain: 0.3": (
        "gain: -1",
        "choices: noise: 'a half of it' cannot be set: interpretation: filters.0.gain: must be > 0",
    ),
    "sensor.sigma_x_m: 0.5": ("filters.7.gain: 1", "'a half of it' cannot be set: filters.7.gain: there is no such"),
}


@pytest.mark.parametrize("what", UNKNOWN)
def test_what_a_claim_names_and_is_not_there_is_known_without_a_run(what):
    text, said = UNKNOWN[what]
    written = Walk.claims_yaml.replace(what, text)
    study = type("Wrong", (Walk,), {"claims_yaml": written, "__module__": __name__})()
    cases = {"walk": (case_of(Walk(), 0.1), case_of(Walk()))}
    assert not claim_faults(Walk(), cases.get)
    (line,) = set(claim_faults(study, cases.get))
    assert said in line
    number = int(re.match(r".*test_onefile\.py:(\d+):\d+: ", line)[1])
    lines = written.splitlines()  # a text that is not in the file: its own lines
    assert text in " ".join(lines[number - 1 : number + 1])


def failing(what):
    """A measure that gives this, or raises it."""

    def measure(evidence):
        if isinstance(what, BaseException):
            raise what
        return what(evidence) if callable(what) else what

    return MeasureCall("own", measure, (), {}, "file.py:7:1")


@pytest.mark.parametrize(
    ("what", "said"),
    [
        (None, "must give an Estimate or a number, got nothing"),
        ("fast", "must give an Estimate or a number, got 'fast'"),
        (ValueError("boom"), "ValueError: boom \\("),
        (SystemExit(0), "SystemExit: 0 \\("),
        (UnknownName("no filter 'quikc'; there are slow"), "no filter 'quikc'; there are slow \\("),
        (lambda evidence: evidence.curve({}, "quick", "x").at_scan(41), "no such scans; there are 1 to 40 \\("),
        (lambda evidence: evidence.gain({}, "quick", "x").since(50), "no such scans; there are 1 to 40 \\("),
    ],
)
def test_a_measure_that_fails_is_one_line_and_the_other_claims_are_judged(made, what, said):
    study, results, every = made
    papers = claims_of(study)
    (claim,) = papers.claims
    part = replace(claim.parts[0], measure=failing(what), cases=())
    both = replace(papers, claims=(replace(claim, id="walk.0", parts=(part,)), claim))
    shipped = {"walk": results}
    table = claims_table(both, results, every, shipped.get, "walk")
    assert table["class"].tolist() == ["not judged here", "confirmed"]
    (line,) = failed_measures(table)
    assert re.match(f"file\\.py:7:1: own: {said}", line)


def test_a_name_that_a_measure_of_ones_own_looks_for_in_vain_is_the_reason(made):
    study, results, every = made
    seen = claims_of(study).evidence(results, every, {result.name: {"filters": {0, 1}} for result in results})
    with pytest.raises(MissingEvidence, match="no filter 'quikc'; there are slow, quick"):
        seen.curve({}, "quikc", "x")
    with pytest.raises(MissingEvidence, match="no component 'y'; there are x"):
        seen.row("last", filter="quick", component="y")
    with pytest.raises(MissingEvidence, match="filter 'slow' is the baseline: it has no gain"):
        seen.gain({}, "slow", "x")
    with pytest.raises(ConfigError, match="filter 'quick' predicts no σ"):
        one_file_measures.over_believed(seen, {}, "quick", "x")


WRONG_NAMES = {
    "components": ((Component("a b", "m"),), "'a b' must be of letters, digits and _"),
    "twice": ((Component("x", "m"), Component("x", "m")), "components: x is there twice"),
    "measured": ((MeasuredColumn("t_s", "s"),), "measured: t_s is the time of a plot"),
    "parts": ({"sensor": Sensor, "scans": Target}, "parts: scans is added to the keys of every study"),
}


@pytest.mark.parametrize("name", WRONG_NAMES)
def test_names_that_cannot_be_are_one_line(name):
    given, said = WRONG_NAMES[name]
    Wrong = type("Wrong", (Walk,), {name.replace("twice", "components"): given, "__module__": __name__})
    assert any(said in line for line in Wrong.missing())


def test_columns_of_the_truth_have_units_of_letters():
    assert [true_column("a", unit) for unit in ("m/s²", "m/s2", "rad/s²", "m", "m²/s³")] == [
        "true_a_mps2", "true_a_mps2", "true_a_radps2", "true_a_m", "true_a_m2ps3"]  # fmt: skip
