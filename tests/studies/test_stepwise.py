"""A study by the steps of one realisation: against what is known exactly; what an author gets wrong, a line each."""

import inspect
import math
import random
from collections import namedtuple
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest
from scipy.stats import norm

from radarsim.config.key_types import Positive, Probability, key
from radarsim.config.model import Model
from radarsim.config.study_keys import Member
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.kernels.formula_functions import log
from radarsim.kernels.small_matrices import eliminate, update
from radarsim.kernels.tracing import sqrt, where
from radarsim.papers import one_file_measures
from radarsim.recordings.report import tables
from radarsim.recordings.tracking_result import START_ESTIMATES, TrackingResult
from radarsim.report.quantities import Component
from radarsim.studies import step_blocks
from radarsim.studies.error_law import ErrorLaw
from radarsim.studies.onefile import MeasuredColumn
from radarsim.studies.stepwise import Steps, StepStudy
from tests.tolerances import assert_rounded, column_sizes, mean_error, sigma_error

STEP, SIGMA, SCANS = 0.5, 1.0, 12


class Sensor(Model):
    """A gauge."""

    sigma_x_m: Positive = key("σ", "of a plot, m", default=SIGMA)
    detection_probability: Probability = key("detection", "of a plot, no unit", default=1.0)
    scan_period_s: Positive = key("period", "s", default=2.0)


class Gain(Member):
    """A filter of a walk."""

    kind: Literal["kalman", "halves"] = key("kind", "its gain", default="kalman")


World = namedtuple("World", "sigma step unit")


class Kalman(Steps):
    """The Kalman filter of a random walk; dt is in the noise."""

    def design(spec, one):
        return World(spec.sensor.sigma_x_m, STEP, "m")

    def start(z, u, c):
        return z[0], c.sigma**2

    def predict(s, dt, u, c):
        return s[0], s[1] + c.step**2 * dt / 2

    def update(s, z, u, c):
        K = s[1] / (s[1] + c.sigma**2)
        return s[0] + K * (z[0] - s[0]), where(c.unit == "m", s[1] - K * s[1], 0)

    def estimate(s, u, c):
        return (s[0],)

    def covariance(s, u, c):
        return (s[1],)


class Halves(Kalman):
    """Half of every innovation, whose covariance it does not tell."""

    covariance = None

    def update(s, z, u, c):
        return 0.5 * (s[0] + z[0]), s[1]


class Walk(StepStudy):
    name, about, asks = "walk", "A walk.", "How?"
    filters = {"kind": "kalman"}  # noqa: RUF012
    components = (Component("x", "m"),)
    parts, Filter = {"sensor": Sensor}, Gain
    scan_period = "sensor.scan_period_s"
    measured = (MeasuredColumn("x_m", "m", ("sensor.sigma_x_m",)),)
    kinds, normals = {"kalman": Kalman, "halves": Halves}, (1, 1, 1)
    known_columns = ("drift_m",)

    def world(self, spec):
        return World(spec.sensor.sigma_x_m, STEP, "m")

    def detection(self, spec):
        return spec.sensor.detection_probability

    def known_quantities(self, spec, t_s):
        return (0 * t_s + 7,)

    def begin(self, c, w):
        return (10 * w[0],)

    def move(self, x, dt, c, w):
        return (x[0] + c.step * w[0],)

    def plot(self, x, u, c, w):
        return (x[0] + c.sigma * w[0] + 0 * u[0],)


def case_of(study, names=("kalman", "halves"), **sensor):
    spec = study.keys().model_validate(
        {"sensor": sensor, "filters": [{"name": n, "kind": n} for n in names], "scans": SCANS}
    )
    return SimpleNamespace(spec=spec, seed=5, study="walk", noise_keys=None)


def added(study, case, count, step=512):
    plan = study.prepare(case)
    values = sum(study.simulate(plan, i, min(step, count - i)) for i in range(0, count, step))
    return plan, plan.layout.unpack(values)


SUMMED = 512 + 40 + 5 * SCANS  # operations: of a block, of blocks, of the number that is the same in each


def exact_variances(gains):
    """Of the errors of a filter with these gains, from the first plot on."""
    P = [SIGMA**2]
    for K in gains:
        P.append((1 - K) ** 2 * (P[-1] + STEP**2) + K**2 * SIGMA**2)
    return np.array(P)


def kalman_gains():
    gains, P = [], SIGMA**2
    for _ in range(SCANS - 1):
        K = (P + STEP**2) / (P + STEP**2 + SIGMA**2)
        gains.append(K)
        P = K * SIGMA**2
    return gains


def test_errors_are_the_exact_ones():
    n = 20_480
    _, sums = added(Walk(), case_of(Walk()), n)
    for f, gains in enumerate((kalman_gains(), [0.5] * (SCANS - 1))):
        wanted = exact_variances(gains)
        assert np.all(np.abs(sums["error"][f, :, 0, 1] / n / wanted - 1) < mean_error(n, np.sqrt(2)))
        assert np.all(np.abs(sums["error"][f, :, 0, 0] / n) < mean_error(n) * np.sqrt(wanted))
    assert_rounded(sums["believed"][0, :, 0] / n, exact_variances(kalman_gains()), operations=SUMMED)
    assert np.all(np.abs(sums["nees"][0, :, 0] / n - 1) < mean_error(n, np.sqrt(2)))
    assert not sums["believed"][1].any()
    assert_rounded(sums["paired"][0], sums["error"][0, ..., 3], operations=SUMMED)


def test_a_move_takes_the_time_of_its_scan():
    class Driven(Walk):
        def begin(self, c, w):
            return (0 * w[0],)

        def move(self, x, dt, c, w, t):
            return (x[0] + 0 * w[0] + t * t,)

    study = Driven()
    plots = study.recording_interface().drawing(case_of(study))(3, 9)
    np.testing.assert_allclose(plots.truth[..., 0], np.tile(np.cumsum(plots.t_s**2), (9, 1)), rtol=1e-14)


def test_a_realisation_is_itself_in_any_block(monkeypatch):
    study = Walk()
    case = case_of(study, detection_probability=0.7)
    monkeypatch.setattr(step_blocks, "MAX_ROWS", 130)  # two eights at once
    _, together = added(study, case, 40, step=40)
    _, apart = added(study, case, 40, step=3)
    for name, sums in together.items():
        assert_rounded(sums, apart[name], size=column_sizes(sums, 40), operations=40)


def test_the_baseline_is_whichever_is_named():
    study = Walk()
    case = case_of(study)
    _, first = added(study, case, 100)
    case.spec = case.spec.model_copy(update={"baseline": "halves"})
    _, other = added(study, case, 100)
    np.testing.assert_array_equal(first["error"], other["error"])
    assert_rounded(other["paired"][0], first["paired"][1], operations=100)
    assert np.all(first["paired"][1] > 0)


def test_what_the_study_knows_exactly_and_what_its_filters_believe_stands_in_tables():
    class Known(Walk):
        def exact_sigma(self, spec):
            return np.sqrt([exact_variances(kalman_gains()), exact_variances([0.5] * (SCANS - 1))])[..., None]

    study, n = Known(), 4096
    case = case_of(study)
    plan, sums = added(study, case, n)
    assert_rounded(plan.axes.exact_sigma[0, :, 0], np.sqrt(sums["believed"][0, :, 0] / n), operations=SUMMED)
    result = CaseResult("walk", "walk", case.spec, (), n, sums, plan.axes)
    made = study.tables([result])
    assert set(made["curves"].dropna(subset="believed_sigma")["filter"]) == {"kalman"}
    assert set(made["consistency"]["filter"]) == {"kalman"}
    assert set(made["consistency"]["nees_verdict"]) == {"consistent"}
    seen = one_file_measures.Evidence([result], made, {})
    for at, place in ((None, -1), (3, 2)):
        found = one_file_measures.bias(seen, "walk", "halves", "x", at)
        assert found.value == sums["error"][1, place, 0, 0] / n
        half = 1.96 * plan.axes.exact_sigma[1, place, 0] / np.sqrt(n)
        assert found.hi - found.value == pytest.approx(half, rel=sigma_error(n))
        ratio = np.sqrt(sums["error"][0, place, 0, 1] / sums["believed"][0, place, 0])
        assert_rounded(one_file_measures.over_believed(seen, "walk", "kalman", "x", at).value, ratio, operations=5)


@pytest.mark.parametrize("sensor", [{}, {"detection_probability": 0.6}], ids=["all plots", "missed plots"])
def test_the_plots_of_a_realisation_followed_in_plain_python_are_what_the_run_made(sensor):
    study = Walk()
    case, i = case_of(study, **sensor), 1029
    plots = study.recording_interface().simulated(case, i)
    assert list(plots) == ["t_s", "x_m", "drift_m", "true_x_m"]
    missed = np.isnan(plots["x_m"])
    assert not missed[0]
    assert missed.any() == bool(sensor)
    track = study.tracker(case).feed(plots)
    plan = study.prepare(case)
    sums = plan.layout.unpack(study.simulate(plan, i, 1))
    error = track.estimate[..., 0] - plots["true_x_m"]
    rounded = {"size": np.abs(plots["true_x_m"]).max() + SIGMA, "operations": 5 * SCANS}
    assert_rounded(error, sums["error"][..., 0, 0], **rounded)
    assert_rounded(error, study.errors(plan, i - 20, 23)[:, 20, :, 0], **rounded)
    assert_rounded(track.sigma[0, :, 0] ** 2, sums["believed"][0, :, 0], operations=5 * SCANS)
    assert np.isnan(track.sigma[1]).all()


def test_a_filter_without_a_covariance_is_told_of_beside_recorded_plots():
    """Its errors, and that it is not tested."""
    study = Walk()
    case = case_of(study)
    columns = dict(study.recording_interface().simulated(case, 1))
    track, found = study.tracker(case).feed(columns), TrackingResult(case)
    truth = {name: columns.pop(name) for name in list(columns) if name.startswith("true_")}
    found.add(columns, track)
    found.add_errors(track, columns["t_s"], truth)
    for f, own in enumerate(tables.error_table(found)):
        error = (track.estimate[f, :, 0] - truth["true_x_m"])[START_ESTIMATES:]
        assert_rounded(own["RMS error"], np.sqrt(np.mean(error**2)), operations=SCANS)
        assert np.isnan(own["of own σ"]) == (f == 1)
    assert found.filters_without_test == ["kalman", "halves"]


def test_missed_plots_are_missed_as_often_as_stated():
    study = Walk()
    case = case_of(study, detection_probability=0.6)
    missed = [np.isnan(study.recording_interface().simulated(case, i)["x_m"][1:]).mean() for i in range(0, 400, 4)]
    assert abs(np.mean(missed) - 0.4) < 4.5 * np.sqrt(0.24 / (100 * (SCANS - 1)))


# ---- what an author gets wrong -------------------------------------------------------------------------------------
def branching(s, z, u, c):
    e = z[0] - s[0]
    if e > 3.0:
        e = 3.0
    return s[0] + 0.5 * e, s[1]


def of_another_shape(s, dt, u, c):
    return (*s, 0.0)


def misspelt(s, z, u, c):
    return z[0] * c.sgima, s[1]


def too_many(s, u, c):
    return s


def of_no_number(s, z, u, c):
    return float("nan") + z[0], s[1]


def nothing_over_nothing(s, z, u, c):
    x = z[0] - s[0]
    return 0 * x / (0.0 * x), s[1]


def divided_by_nothing(s, z, u, c):
    return z[0] + 1 / (s[1] - s[1]), s[1]


def root_of_minus_one(s, z, u, c):
    return z[0] + sqrt(0 * s[1] - 1), s[1]


def a_constant(s, u, c):
    return (float("inf"),)


def compared_with_itself(s, z, u, c):
    return where(z[0] != z[0], s[0], z[0]), s[1]


def by_numpy(s, z, u, c):
    return np.sqrt(z[0]), s[1]


def drawn_by_python(s, z, u, c):
    return z[0] + random.gauss(0, 1), s[1]


def of_negative_variance(s, z, u, c):
    x, P = update((s[0],), (s[1],), (1.0,), z[0] - s[0], -(c.sigma**2))
    return x[0], P[0]


def a_list(s, z, u, c):
    return [z[0], s[1]]


def nothing(s, z, u, c):
    return None


def a_comparison(s, z, u, c):
    return z[0] > s[0], s[1]


FAULTS = [
    ("update", branching, 2, r"branching: .* has no one value: write where\(condition, yes, no\)"),
    ("predict", of_another_shape, 0, r"gives a state of the shape \(·, ·, ·\), the one before has \(·, ·\)"),
    ("update", misspelt, 1, "misspelt: AttributeError: .*sgima"),
    ("estimate", too_many, 0, r"must give a tuple of 1 numbers \(components\), got \(·, ·\)"),
    ("update", of_no_number, 1, "of_no_number: nan is not finite, and no number to calculate with"),
    ("update", nothing_over_nothing, 2, "nothing_over_nothing: gives nan in every realisation"),
    ("update", divided_by_nothing, 1, "divided_by_nothing: gives nan in every realisation"),
    ("update", root_of_minus_one, 1, "root_of_minus_one: gives nan in every realisation"),
    ("estimate", a_constant, 0, "a_constant: gives inf, which is no number to calculate with"),
    ("update", compared_with_itself, 1, r"a test for NaN cannot be made; test what would make it, e\.g\. where"),
    ("update", by_numpy, 1, r"by_numpy: .* radarsim\.kernels\.formula_functions has exp"),
    ("update", drawn_by_python, 0, "gives another formula each time: draw by normals"),
    ("update", a_list, 0, "a_list: must give a tuple of numbers, got a list"),
    ("update", nothing, 0, "nothing: must give a tuple of numbers, got nothing"),
    ("update", a_comparison, 0, "a_comparison: gives a comparison in place of a number"),
    ("update", of_negative_variance, 1, "R, the variance of the error of a number, must be positive, got -1"),
]


@pytest.mark.parametrize(("step", "function", "line", "words"), FAULTS, ids=[one[1].__name__ for one in FAULTS])
def test_a_fault_is_one_line_with_its_place(step, function, line, words):
    study = Walk()
    study.kinds = {"kalman": type("Wrong", (Kalman,), {step: function})}
    place = f"{__file__}:{inspect.getsourcelines(function)[1] + line}: "
    with pytest.raises(ConfigError, match=words) as caught:
        study.prepare(case_of(study, names=["kalman"]))
    assert len(caught.value.lines) == 1
    assert caught.value.lines[0].startswith(place)


@pytest.mark.parametrize("given", [1.5, "detection_probability", float("nan")])
def test_a_detection_is_a_probability(given):
    study = Walk()
    study.detection = lambda spec: given
    with pytest.raises(ConfigError, match="must give a probability, from 0 to 1, got"):
        study.prepare(case_of(study))


@pytest.mark.parametrize("by", ["sigma", "step"])
def test_an_error_that_only_the_compiler_takes_for_a_number_is_no_result(by):
    """a·b - b·a is zero to the compiler alone, which then makes anything of what is divided by it."""
    error = lambda s, z, c: z[0] + getattr(c, by) / (z[0] * s[0] - s[0] * z[0])  # noqa: E731
    study = Walk()
    study.kinds = {"kalman": type("Wrong", (Kalman,), {"update": lambda s, z, u, c: (error(s, z, c), s[1])})}
    _, sums = added(study, case_of(study, names=["kalman"]), 16)
    assert not np.isfinite(sums["error"]).all()


def test_errors_that_are_zero_indeed_are_a_result():
    class Known(Walk):
        def plot(self, x, u, c, w):
            return (x[0] + 0 * w[0],)

    study = Known()
    steps = {"start": lambda z, u, c: (z[0], 1.0), "update": lambda s, z, u, c: (z[0], s[1]), "covariance": None}
    study.kinds = {"kalman": type("Taken", (Kalman,), steps)}
    _, sums = added(study, case_of(study, names=["kalman"]), 16)
    assert not sums["error"].any()


def less_than_nothing(s, u, c):
    return (s[1] - 0.5,)


def of_two(s, u, c):
    return s[0], s[1], s[0]


def root_of_a_negative(s, z, u, c):
    return sqrt(z[0] - 1e6), s[1]


def test_a_covariance_that_is_not_positive_is_no_result():
    """From the scan on at which the variance falls below 0.5."""
    study = Walk()
    study.kinds = {"kalman": type("Wrong", (Kalman,), {"covariance": less_than_nothing})}
    case = case_of(study, names=["kalman"])
    _, sums = added(study, case, 16)
    wanted = exact_variances(kalman_gains()) < 0.5
    assert 0 < wanted.sum() < SCANS
    assert np.isnan(sums["believed"][0, :, 0]).tolist() == wanted.tolist()
    assert np.isnan(sums["nees"][0]).any(axis=1).tolist() == wanted.tolist()
    assert np.isfinite(sums["error"]).all()


def test_a_matrix_that_is_not_positive_has_positive_variances_too():
    P, e = (1.0, 2.0, 1.0), (0.5, 0.25)
    assert eliminate(P, e)[1] < 0 < eliminate((1.0, 0.5, 1.0), e)[1]


ON_PLOTS = [  # what a step gives over recorded plots; the row
    ("covariance", less_than_nothing, r"less_than_nothing: gives a variance of -0\.", 2),
    ("update", root_of_a_negative, "root_of_a_negative: gives nan", 1),
    ("update", of_two, r"of_two\(\) takes 3 positional arguments", None),
    ("covariance", of_two, r"must give a tuple of 1 numbers \(elements of a packed covariance\), got", None),
    ("estimate", of_two, r"must give a tuple of 1 numbers \(components\), got", None),
    ("predict", of_another_shape, r"gives a state of the shape \(·, ·, ·\), the one before has \(·, ·\)", None),
]


@pytest.mark.parametrize(("step", "function", "words", "row"), ON_PLOTS)
def test_a_fault_over_recorded_plots_is_one_line(step, function, words, row, recwarn):
    study = Walk()
    study.kinds = {"kalman": type("Wrong", (Kalman,), {step: function})}
    plots = {"t_s": 2.0 * np.arange(8), "x_m": np.zeros(8), "drift_m": np.zeros(8)}
    with pytest.raises(ConfigError, match=rf"^{__file__}:\d+: study \w+: .*{words}") as caught:
        study.tracker(case_of(study, names=["kalman"])).feed(plots)
    assert len(caught.value.lines) == 1
    assert getattr(caught.value, "row", None) == row
    assert not recwarn.list


def not_a_record(spec, one):
    return {"sigma": 1.0}


def test_numbers_are_a_record_and_what_is_known_has_its_columns():
    study = Walk()
    study.kinds = {"kalman": type("Wrong", (Kalman,), {"design": not_a_record})}
    with pytest.raises(ConfigError, match="not_a_record: must give a tuple or a named record, got dict"):
        study.prepare(case_of(study, names=["kalman"]))
    study.kinds = Walk.kinds
    said = "must give 1 columns of 12 finite numbers, as known_columns says; got "
    for given, got in (((1, 2), "2"), ((np.ones(3),), r"\(1, 3\)"), ((np.full(12, np.nan),), "12 of them"), (7, "7")):
        study.known_quantities = lambda spec, t_s, given=given: given
        with pytest.raises(ConfigError, match=f"{said}.*{got}"):
            study.prepare(case_of(study))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (np.ones(3), r"must give σ \(2, 12, 1\), none negative, got \(3,\)"),
        ("much", "must give numbers, .* got 'much'"),
    ],
)
def test_an_exact_sigma_has_its_shape(given, words):
    study = Walk()
    study.exact_sigma = lambda spec: given
    with pytest.raises(ConfigError, match=words):
        study.prepare(case_of(study))


WRONG = {
    "normals": ((4, 0), r"normals: must be three whole numbers, .* got \(4, 0\)"),
    "kinds": ({"kalman": Kalman}, "kinds: no halves, which the key kind of Filter allows; there are kalman$"),
    "kinds ": ({"kalman": Kalman(), "halves": Halves}, "kinds: kalman: must be a subclass of .*Steps, got "),
    "kinds  ": ([Kalman, Halves], "kinds: must be a mapping"),
    "Filter": (Member, r"Filter: must have a key kind: Literal\['kalman', 'halves'\]"),
    "known_columns": ("drift_m", r"known_columns: must be a tuple, \('drift_m',\); got 'drift_m'"),
    "detection": (0.9, r"Wrong\.detection must be a function, got 0\.9"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_of_the_wrong_kind_is_one_line(name):
    value, words = WRONG[name]
    Wrong = type("Wrong", (Walk,), {name.strip(): value, "__module__": __name__})
    with pytest.raises(ConfigError, match=words) as caught:
        Wrong().keys()
    assert len(caught.value.lines) == 1


def test_what_a_class_lacks_is_said_at_once():
    class Bare(Walk):
        normals = None
        kinds = {"kalman": type("Half", (Steps,), {"start": Kalman.start})}  # noqa: RUF012

    del Bare.normals
    assert any("kinds: kalman: predict must be given" in line for line in Bare().missing())
    with pytest.raises(ConfigError, match="kinds: kalman: update must be given"):
        Bare().keys()


class Likely(Kalman):
    """The filter with the density of a plot; of a σ under 1 m it has no state."""

    def update(s, z, u, c):
        x, P = Kalman.update(s, z, u, c)
        return x + 0.0 * sqrt(c.sigma - 1.0), P

    def log_densities(s, z, u, c):
        S = s[1] + c.sigma**2
        return [-0.5 * (log(math.tau * S) + (z[0] - s[0]) ** 2 / S)]


class Fitted(Walk):
    known_columns = ()
    kinds = {"kalman": Likely, "halves": Halves}  # noqa: RUF012

    def known_quantities(self, spec, t_s):
        return ()

    def plot(self, x, u, c, w):
        return (x[0] + c.sigma * w[0],)

    def fitted(self, filter_keys):
        return ("sensor.sigma_x_m",)


def test_the_likelihood_is_exact_and_impossible_where_a_filter_has_no_state():
    study = Fitted()
    case = case_of(study, ("kalman",), sigma_x_m=2.0)
    columns = study.recording_interface().drawing(case)(0, 1).rows(0)
    likelihood = study.likelihood(case, None, [columns])
    x, P, total = columns["x_m"][0], 9.0, 0.0
    for z in columns["x_m"][1:]:
        S = P + STEP**2 + 9.0
        total += norm.logpdf(z, x, np.sqrt(S))
        x, P = x + (1 - 9.0 / S) * (z - x), 9.0 * (1 - 9.0 / S)
    assert likelihood(np.array([3.0])) == pytest.approx(total, rel=1e-12)
    assert likelihood(np.array([0.5])) == -math.inf


def test_a_filter_that_merges_states_says_which_of_its_numbers_are_sigma():
    class Merging(Likely):
        sigma_field = "sigma"

        def merge(s, other, p, c):
            return s

    class Mixed(Fitted):
        kinds = {"kalman": Merging, "halves": Halves}  # noqa: RUF012

    study = Mixed()
    case = case_of(study, ("kalman",), sigma_x_m=2.0)
    likelihood = study.likelihood(case, None, [study.recording_interface().drawing(case)(0, 1).rows(0)])
    assert likelihood.explains == ("outliers",)
    with pytest.raises(ConfigError, match="must give sigma, a tuple of σ of the 1 measured"):
        likelihood(likelihood.stated, ErrorLaw(outliers=0.01))
