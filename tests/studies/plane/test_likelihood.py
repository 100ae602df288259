"""The likelihood of recorded plots of the plane: against its steps in plain Python, each law of errors by itself."""

import math

import numpy as np
import pytest

from radarsim.recordings.fit import advice, fit
from radarsim.studies.error_law import MANOEUVRES, OUTLIERS, ErrorLaw, OutlierLaw
from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.registry import study
from radarsim.studies.step_checks import record
from radarsim.studies.step_likelihood import StepLikelihood
from tests.studies.plane.cases import STRAIGHT, case_of, member

NAMES = ("range_m", "bearing_rad", "velocity_mps")
FILTERS = (
    member("extended"),
    member("imm", "turn"),
    member("imm", doppler=False),
    member("extended", "acceleration", doppler=False),
    member("unscented"),
    member("converted"),
)


def recording(case, realisation):
    """The plots of a realisation, without the truth."""
    columns = study("plane").recording_interface().simulated(case, realisation)
    return {name: columns[name] for name in ("t_s", *NAMES)}


def tracks_of(case):
    """A track whose first rows have no complete plot, with a gap, and a second one."""
    first, second = recording(case, 0), recording(case, 1)
    first["velocity_mps"][0] = first["bearing_rad"][1] = math.nan
    return [{name: np.delete(column, [5, 6, 7]) for name, column in first.items()}, second]


def numbers_of(case, keys, factors):
    """The numbers of a filter, of keys that differ from the stated ones by factors."""
    spec, names = case.spec, study("plane").fitted(keys)
    for name, factor in zip(names, factors, strict=True):
        if name.startswith("radar."):
            radar_name = name.removeprefix("radar.")
            radar = spec.radar.model_copy(update={radar_name: factor * getattr(spec.radar, radar_name)})
            spec = spec.model_copy(update={"radar": radar})
        else:
            keys = keys.model_copy(update={name: factor * getattr(keys, name)})
    return record(study("plane").kinds[keys.kind].design, spec, keys)


def plain_densities(case, keys, track, c):
    """The log-densities of all plots but the first of a track, by the steps in plain Python: of the first number, of
    the first two, and so on."""
    steps, s, last, total = study("plane").kinds[keys.kind], None, math.nan, 0.0
    used = len(study("plane").columns(case.spec, keys))
    for t, *z in zip(*(track[name].tolist() for name in ("t_s", *NAMES)), strict=True):
        if s is not None:
            for time in (*missed_scan_times(last, t, case.spec.radar.scan_period_s), t):
                s, last = steps.predict(s, time - last, (), c), time
        if np.isfinite(z[:used]).all():
            if s is not None:
                total += np.array(steps.log_densities(s, z, (), c), dtype=float)
                s = steps.update(s, z, (), c)
            else:
                s, last = steps.start(z, (), c), t
    return total


@pytest.mark.slow_cases_except("*extended velocity Vr", "None-imm velocity r")
@pytest.mark.parametrize("filter_keys", FILTERS, ids=lambda keys: keys["name"])
@pytest.mark.parametrize("rate_hz", [None, 4000.0])
def test_the_compiled_likelihood_is_that_of_the_steps(filter_keys, rate_hz):
    case = case_of([filter_keys], STRAIGHT, 20, **({"repetition_rate_hz": rate_hz} if rate_hz else {}))
    (keys,), tracks = case.spec.filters, tracks_of(case)
    likelihood = StepLikelihood(study("plane"), case.spec, keys, tracks)
    rng = np.random.default_rng(3)
    for factors in np.exp(rng.normal(0.0, 0.7, (3, len(likelihood.keys)))):
        c = numbers_of(case, keys, factors)
        densities = sum(plain_densities(case, keys, track, c) for track in tracks)
        values = factors * likelihood.stated
        assert likelihood(values) == pytest.approx(densities[-1], rel=1e-9)
        by_number = list(likelihood.by_number(values).values())
        np.testing.assert_allclose(np.cumsum(by_number), densities, rtol=1e-9)


LAWS = (  # of outliers, by number
    OutlierLaw(near=0.05, far=0.02, offset=4.0, spread=2.0),
    OutlierLaw(near=0.1, far=0.01, offset=3.0, spread=0.0),
    OutlierLaw(near=0.02, far=0.05, offset=0.0, spread=4.0),
)
HARD, FAR = 0.1, (10.0, 6)  # share of hard manoeuvres, ten times as large; least width of far outliers, widths


def laws_of(sigma, spans):
    """All laws of the errors of a plot: probability, σ and shift of each number, which are outliers, factor on the
    process noise."""
    m = len(spans)
    least, count = FAR
    far = [
        [least * s * max(r / (least * s), 1) ** (i / (count - 1)) for i in range(count)]
        for s, r in zip(sigma, spans, strict=False)
    ]
    none, rest, numbers = (0.0,) * 3, sigma[m:], LAWS[:m]
    near = tuple(math.hypot(law.offset, law.spread, 1) * s for law, s in zip(numbers, sigma, strict=False))
    laws = [(math.prod(1 - law.share for law in numbers), sigma, none, set())]
    if m > 1:
        laws.append((math.prod(law.near for law in numbers), (*near, *rest), none, set(range(m))))
        all_far = math.prod(law.far for law in numbers) / count
        laws += [(all_far, (*widths, *rest), none, set(range(m))) for widths in zip(*far, strict=True)]
    for j, law in enumerate(numbers):
        unit, others = np.eye(3)[j], math.prod(1 - other.share for other in numbers if other is not law)
        wide = math.hypot(law.spread, 1) * sigma[j]
        widened = [(law.near / 2, wide, side * law.offset * sigma[j]) for side in (1, -1)]
        widened += [(law.far / count, width, 0.0) for width in far[j]]
        laws += [
            (others * p, tuple(np.where(unit, width, sigma).tolist()), tuple((shift * unit).tolist()), {j})
            for p, width, shift in widened
        ]
    total = sum(law[0] for law in laws)
    return [((1 - HARD) * p / total, *law, 1.0) for p, *law in laws] + [(HARD, sigma, none, set(), 10.0)]


def merged(states, weights):
    """States (x, P), or of two models with the probability of the first, merged by moments."""
    if len(states[0]) == 3:
        shares = np.array([state[2] for state in states])
        probability = float(weights @ shares)
        first = merged([state[0] for state in states], weights * shares / probability)
        second = merged([state[1] for state in states], weights * (1 - shares) / (1 - probability))
        return first, second, probability
    means = np.array([state[0] for state in states])
    x, upper = weights @ means, np.triu_indices(means.shape[1])
    spread = np.array([np.outer(mean - x, mean - x)[upper] for mean in means])
    P = weights @ (np.array([state[1] for state in states]) + spread)
    return tuple(x.tolist()), tuple(P.tolist())


def enumerated(case, keys, track, spans, c):
    """The log-density of all plots but the first of a track, and the soundness of each row, by all laws."""
    steps, s, last, total = study("plane").kinds[keys.kind], None, math.nan, 0.0
    m, laws, soundness = len(spans), laws_of(c.sigma, spans), []
    sizes = [law.near * (law.offset**2 + law.spread**2) + law.far * (FAR[0] ** 2 - 1) for law in LAWS[:m]]
    start_sigma = tuple(math.sqrt(1 + size) * a for size, a in zip(sizes, c.sigma, strict=False)) + c.sigma[m:]
    for t, *z in zip(*(track[name].tolist() for name in ("t_s", *NAMES)), strict=True):
        soundness.append(np.where(np.isfinite(z[:m]), 1.0, np.nan))
        if s is None:
            if np.isfinite(z[:m]).all():
                s, last = steps.start(z, (), c._replace(sigma=start_sigma)), t
            continue
        missed = missed_scan_times(last, t, case.spec.radar.scan_period_s)
        for time in missed:
            s, last = steps.predict(s, time - last, (), c), time
        dt, last = t - last, t
        if not np.isfinite(z[:m]).all():
            s = steps.predict(s, dt, (), c)
            continue
        logs, states = [], []
        for p, sigma, shift, _, hard in laws:
            before = steps.predict(s, dt, (), c._replace(noise=tuple(hard * a for a in c.noise)))
            law, plot = c._replace(sigma=sigma), tuple(a - b for a, b in zip(z, shift, strict=True))
            logs.append(math.log(p) + steps.log_densities(before, plot, (), law)[-1])
            states.append(steps.update(before, plot, (), law))
        log_density = np.logaddexp.reduce(logs)
        weights = np.exp(np.array(logs) - log_density)
        soundness[-1] = [1 - sum(w for w, law in zip(weights, laws, strict=True) if j in law[3]) for j in range(m)]
        total, s = total + log_density, (merged([state[0] for state in states], weights), s[1])
    return total, np.array(soundness)


@pytest.mark.slow_cases_except("extended velocity Vr")
@pytest.mark.parametrize("filter_keys", FILTERS, ids=lambda keys: keys["name"])
def test_the_laws_of_errors_are_weighed_and_merged_as_one_by_one(filter_keys):
    case = case_of([filter_keys], STRAIGHT, 15)
    (keys,), tracks = case.spec.filters, tracks_of(case)
    tracks[1]["range_m"][4] += 300.0
    tracks[1]["bearing_rad"][8] += 1.0
    likelihood = StepLikelihood(study("plane"), case.spec, keys, tracks)
    columns = study("plane").columns(case.spec, keys)
    law = ErrorLaw(outlier_laws=LAWS[: len(columns)], manoeuvres=HARD)
    spans = [
        np.ptp(column[np.isfinite(column)])
        for name in columns
        for column in [np.concatenate([t[name] for t in tracks])]
    ]
    c = numbers_of(case, keys, np.ones(len(likelihood.keys)))
    expected = [enumerated(case, keys, track, spans, c) for track in tracks]
    assert likelihood(likelihood.stated, law) == pytest.approx(sum(total for total, _ in expected), rel=1e-9)
    for (_, wanted), given in zip(expected, likelihood.soundness(likelihood.stated, law), strict=True):
        np.testing.assert_allclose(np.transpose([given[name] for name in columns]), wanted, atol=1e-9)


def with_outlier(error=6e4, row=30, scans=60, name="range_m"):
    """The likelihood of a flight on one course, whose plot in a row is off, and that of the sound flight."""
    case = case_of([member("extended")], STRAIGHT, scans, detection_probability=1.0)
    sound = recording(case, 1)
    spoiled = sound | {name: sound[name] + error * (np.arange(scans) == row)}
    plots = study("plane").recording_interface()
    return plots.likelihood(case, None, [spoiled]), plots.likelihood(case, None, [sound]), float(sound["t_s"][row])


def test_an_outlier_is_named_and_leaves_sigma_alone():
    """Of one range 60 km off in 60 rows."""
    spoiled, sound, t_s = with_outlier()
    found, wanted = fit.fit_likelihood(spoiled), fit.fit_likelihood(sound)
    assert [(row.t_s, row.column) for row in found.outlier_rows] == [(t_s, "range_m")]
    assert wanted.outlier_rows == ()
    assert wanted.plain is None
    for key, sound_key in zip(found.keys[:3], wanted.keys[:3], strict=True):
        assert key.lo < key.stated < key.hi
        assert key.value == pytest.approx(sound_key.value, rel=0.05)


@pytest.mark.slow
def test_one_outlier_of_a_thousand_is_named():
    spoiled, _, t_s = with_outlier(row=500, scans=1000)
    found = fit.fit_keys(spoiled, (OUTLIERS,))
    assert [(row.t_s, row.column) for row in found.outlier_rows] == [(t_s, "range_m")]
    assert all(key.lo < key.stated < key.hi for key in found.keys[:3])


@pytest.mark.parametrize("row", [0, 1, 20, 39])
@pytest.mark.parametrize(("name", "error"), [("range_m", 6e4), ("range_m", 6e6), ("bearing_rad", 1.0)])
def test_an_outlier_is_found_in_any_row(name, error, row):
    likelihood, _, t_s = with_outlier(error, row, 40, name)
    rows = fit.find_outlier_rows(likelihood, likelihood.stated, ErrorLaw(outliers=0.01))
    assert [(found.t_s, found.column) for found in rows] == [(t_s, name)]


def test_a_turn_is_no_outlier():
    """Where a filter of constant velocity meets a turn of 2 g, a hard manoeuvre explains the plots, not outliers."""
    case = case_of([member("extended", doppler=False)], scans=60)
    likelihood = study("plane").recording_interface().likelihood(case, None, [recording(case, 2)])
    assert likelihood.explains == (OUTLIERS, MANOEUVRES)
    found = fit.fit_likelihood(likelihood)
    assert found.outlier_rows == ()


def test_the_likeliest_of_the_filters_that_take_most_of_a_plot_is_fitted():
    turning = member("imm", "turn")
    case = case_of([member("extended", doppler=False), member("extended"), turning], scans=40)
    columns = recording(case, 0)
    columns["range_m"][30] += 1e5
    plots = study("plane").recording_interface()
    assert plots.likelihood(case, None, [columns]).filter == turning["name"]
    extended = plots.likelihood(case, "extended velocity Vr", [columns])
    assert extended.filter == "extended velocity Vr"
    likelihoods = [extended, plots.likelihood(case, turning["name"], [columns])]
    assert advice.compare_filters(likelihoods).most_columns == turning["name"]


@pytest.mark.slow
def test_advice_names_an_outlier_before_a_sigma():
    likelihood, _, t_s = with_outlier()
    findings = advice.find_errors(likelihood)
    assert findings[0].name == OUTLIERS
    assert [(row.t_s, row.column) for row in findings[0].rows] == [(t_s, "range_m")]


@pytest.mark.parametrize("filter_keys", [FILTERS[0], FILTERS[2]], ids=lambda keys: keys["name"])
def test_a_plot_far_off_costs_a_plain_likelihood_by_its_size(filter_keys):
    case = case_of([filter_keys], STRAIGHT, 20, detection_probability=1.0)
    sound, plots = recording(case, 1), study("plane").recording_interface()
    values = []
    for error in (1e6, 2e6):
        columns = sound | {"range_m": sound["range_m"] + error * (np.arange(20) == 19)}
        likelihood = plots.likelihood(case, None, [columns])
        values.append(likelihood(likelihood.stated))
    assert -values[0] > 1e6
    assert values[1] / values[0] == pytest.approx(4.0, rel=0.2)
