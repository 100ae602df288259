"""The multimodel study: plots, sums against the textbook twin on the study's own plots, blocks, edges, faults."""

from pathlib import Path

import numpy as np
import pytest

from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.physics import frames
from radarsim.studies.multimodel import STUDY, model_bank, tables, tracking
from radarsim.studies.multimodel import study as multimodel
from tests.physics.antenna import to_biconical
from tests.studies.multimodel import naive
from tests.tolerances import mean_error, rounding

# Of estimates and probabilities, over their size: κ of a plot's covariance, 3·10⁶ of a radar whose range is exact and
# whose angles are not, and 150 roundings of an update of nine states.
PRECISION = rounding(3e6, 150)

SENSOR = {
    "sigma_range_m": 2.5,
    "sigma_elevation_deg": 0.1,
    "sigma_azimuth_deg": 0.1,
    "scan_period_s": 0.5,
    "antenna_elevation_deg": 30,
    "antenna_height_m": 12,
}
BANK = {
    "models": [
        {"motion": "uniform", "sigma_acceleration_mps2": 0.05},
        {"motion": "accelerated", "sigma_acceleration_mps2": 0.05},
        {"motion": "accelerated", "sigma_acceleration_mps2": 30},
    ],
    "transition": [[0.996, 0, 0.002], [0, 0.996, 0.002], [0.004, 0.004, 0.996]],
}
FILTERS = [
    {"name": "imm", "family": "imm", **BANK},
    {"name": "gpb2", "family": "gpb2", "merge": "moment", "output": "moment", **BANK},
    {"name": "kalman", "family": "kalman", "models": [{"motion": "accelerated", "sigma_acceleration_mps2": 20}]},
]


def configured_case(**changes):
    """A small experiment: 100 scans of the weaving flight."""
    config = {"study": "multimodel", "sensor": SENSOR, "target": "weaving", "filters": FILTERS, "scans": 100}
    return CaseWork(load({**config, "realisations": 20, **changes}).cases[0])


def unpack_covariance(packed):
    """Packed covariances (K, 6) as (K, 3, 3)."""
    matrix = np.empty((len(packed), 3, 3))
    upper = np.triu_indices(3)
    matrix[:, upper[0], upper[1]] = matrix[:, upper[1], upper[0]] = packed
    return matrix


def test_plots_have_the_stated_errors_and_covariances():
    plan = configured_case(scans=60).plan
    z, R, detected = (
        np.concatenate([multimodel.simulate_plots(plan, 8 * g)[i] for g in range(60)], axis=-1) for i in range(3)
    )
    assert detected.all()
    truth = plan.world.truth[:, 0::3]
    error = np.moveaxis(z - truth[:, :, None], 2, 0)
    mean = np.array([unpack_covariance(R[:, :, i]) for i in range(R.shape[2])])
    nis = np.einsum("nka,nkab,nkb->nk", error, np.linalg.inv(mean), error)
    assert abs(nis.mean() - 3) < mean_error(nis.size, np.sqrt(6))
    antenna = frames.to_antenna(truth, frames.rotation(0, np.radians(30)), 12)
    sigma = np.array([2.5, np.radians(0.1), np.radians(0.1)])
    exact = frames.plot_covariance(to_biconical(antenna), sigma, frames.rotation(0, np.radians(30)))
    assert np.allclose(mean.mean(axis=0), exact, rtol=1e-3, atol=1e-3 * np.abs(exact).max())


@pytest.mark.slow_cases("unbiased-sensor1")
@pytest.mark.parametrize("sensor", [{}, {"detection_probability": 0.7, "jitter_s": 0.1}])
@pytest.mark.parametrize("conversion", ["plain", "unbiased"])
def test_sums_equal_the_twin_on_the_same_plots(sensor, conversion):
    case = configured_case(sensor={**SENSOR, **sensor, "conversion": conversion})
    plan, first = case.plan, 5
    sums = plan.layout.unpack(case.simulate(first, 1))
    z, R, detected = (part[..., 0] for part in multimodel.simulate_plots(plan, first))
    t = plan.axes.t_s
    times = plan.world.times[plan.world.intervals]
    z = np.where(detected[:, None] > 0, z, np.nan)
    a, b, g = plan.world.weights.reshape(3, 3)
    x, P = np.zeros(9), np.zeros((9, 9))
    x[0::3], x[1::3] = a @ z[:3], b @ z[:3]
    covariance = unpack_covariance(R)
    for u, v in ((0, 0), (0, 1), (1, 0), (1, 1)):
        P[u::3, v::3] = np.tensordot((a, b)[u] * (a, b)[v], covariance[:3], 1)
    P += np.kron(np.eye(3), np.outer(g, g))
    for f, options in enumerate(case.case.spec.filters):
        T = np.array(options.transition)
        kinds = [(m.motion, m.sigma_acceleration_mps2) for m in options.models]

        def powers(s, T=T):
            return model_bank.transition_powers(T, np.array([s / 0.05]))[0]

        p = model_bank.stationary(T)
        merge, output = options.merge, options.output
        expected = naive.track(options.family, merge, output, kinds, powers, x, P, p, z[3:], covariance[3:], times[3:])
        error = expected[0] - plan.world.truth[3:]
        scale = np.abs(error).max(axis=0)
        tolerance = (
            PRECISION if not sensor else 2e-3
        )  # missed and jittered: P(a) P(b) and P(a + b) differ by the generator
        assert np.max(np.abs(sums["error"][f, :, :, 0] - error) / scale) < tolerance
        assert np.allclose(sums["error"][f, :, :, 1], error**2, rtol=1e-2, atol=2 * tolerance * (scale**2).max())
        assert np.allclose(sums["probability"][f, :, : len(p), 0], expected[2], rtol=0, atol=10 * tolerance)
        position = expected[1][:, 0::3, 0::3]
        nees = np.einsum("ka,kab,kb->k", error[:, 0::3], np.linalg.inv(position), error[:, 0::3])
        assert np.allclose(sums["believed"][f, :, 0], nees, rtol=10 * PRECISION if not sensor else 0.05)
        assert len(t) == len(error)


def test_covariance_at_the_prediction_is_computed_there():
    filters = [{**FILTERS[2], "covariance_at": "prediction"}]
    case = configured_case(filters=filters)
    plan = case.plan
    sums = plan.layout.unpack(case.simulate(0, 1))
    z, R, _ = (part[..., 0] for part in multimodel.simulate_plots(plan, 0))
    a, b, g = plan.world.weights.reshape(3, 3)
    x, P, covariance = np.zeros(9), np.zeros((9, 9)), unpack_covariance(R)
    x[0::3], x[1::3] = a @ z[:3], b @ z[:3]
    for u, v in ((0, 0), (0, 1), (1, 0), (1, 1)):
        P[u::3, v::3] = np.tensordot((a, b)[u] * (a, b)[v], covariance[:3], 1)
    P += np.kron(np.eye(3), np.outer(g, g))
    F, Q = naive.motion("accelerated", 20.0, 0.5)
    turn, sigma = frames.rotation(0, np.radians(30)), np.array([2.5, np.radians(0.1), np.radians(0.1)])
    for k in range(3, len(z)):
        measured = to_biconical(frames.to_antenna((F @ x)[0::3], turn, 12))
        x, P, *_ = naive.advance(x, P, F, Q, z[k], frames.plot_covariance(measured, sigma, turn))
        assert np.allclose(sums["error"][0, k - 3, :, 0], x - plan.world.truth[k], rtol=PRECISION, atol=PRECISION * 100)


def test_stage_sums_are_those_of_the_scans():
    case = configured_case(target={**inline_flight(), "stages": [{"name": "a", "end_s": 20}, {"name": "b"}]})
    plan = case.plan
    sums = plan.layout.unpack(case.simulate(0, 1))
    square, summed = sums["error"][:, :, :, 0] ** 2, rounding(operations=len(plan.world.stage))
    stage = plan.world.stage[3:]
    for s in (0, 1):
        assert np.allclose(sums["stage"][:, s, :9, 0], square[:, stage == s].mean(axis=1), rtol=summed)
        assert np.allclose(sums["stage"][:, s, 9, 0], sums["believed"][:, stage == s, 0].mean(axis=1), rtol=summed)
    product, twice = sums["stage"][0, :, :9, 0] * sums["stage"][1, :, :9, 0], rounding(operations=2)
    assert np.allclose(sums["pairs"][0, 1], product, rtol=twice, atol=0)
    assert np.allclose(sums["stage"][..., 0] ** 2, sums["stage"][..., 1], rtol=twice, atol=0)


def test_report_every_keeps_some_scans_and_the_same_stages():
    case, sparse = configured_case(), configured_case(report_every=7)
    every = case.plan.layout.unpack(case.simulate(0, 8))
    some = sparse.plan.layout.unpack(sparse.simulate(0, 8))
    k = sparse.plan.axes.k
    assert list(k) == [7 * i for i in range(1, 15)] + [100]
    np.testing.assert_array_equal(some["error"], every["error"][:, k - 4])
    np.testing.assert_array_equal(some["stage"][:, :, :9], every["stage"][:, :, :9])


def inline_flight(**changes):
    flight = {
        "kind": "flight",
        "duration_s": 186,
        "position_m": [60e3, 8e3, -30e3],
        "velocity_mps": [0, 0, 300],
        "phases": [{"start_s": 0, "trimmed": True}],
    }
    return {**flight, **changes}


def test_plots_beyond_the_edge_are_missed_and_nothing_is_not_a_number():
    edge = inline_flight(position_m=[2e3, 8e3, -60e3], velocity_mps=[0, 0, 50])
    sensor = {**SENSOR, "antenna_elevation_deg": 0, "sigma_elevation_deg": 1, "sigma_azimuth_deg": 1}
    case = configured_case(target=edge, sensor=sensor)
    detected = np.concatenate([multimodel.simulate_plots(case.plan, 8 * g)[2] for g in range(8)], axis=1)
    assert 0.2 < 1 - detected[3:].mean() < 0.8
    assert np.isfinite(case.simulate(0, 64)).all()


@pytest.mark.parametrize(
    ("target", "words"),
    [
        (inline_flight(position_m=[-60e3, 8e3, 0]), "leaves the antenna's sector at 0 s"),
        (inline_flight(velocity_mps=[-2000, 0, 0]), "leaves the antenna's sector at"),
        (inline_flight(phases=[{"start_s": 0}]), "hits the ground at"),
        (inline_flight(velocity_mps=[0, 0, 8000]), "faster than an orbit"),
        (inline_flight(duration_s=1), "at least 4"),
    ],
)
def test_impossible_flights_are_refused(target, words):
    with pytest.raises(ConfigError, match=words):
        _ = configured_case(target=target).plan


def test_plots_of_the_local_frame():
    sensor = {"sigma_x_m": 5, "sigma_y_m": 10, "sigma_z_m": 20, "scan_period_s": 0.5}
    case = configured_case(sensor=sensor)
    z, R, _ = multimodel.simulate_plots(case.plan, 0)
    np.testing.assert_array_equal(R[7, :, 2], [25, 0, 0, 100, 0, 400])
    error = (z - case.plan.world.truth[:, 0::3, None]) / np.array([5, 10, 20])[:, None]
    assert abs(error.std() - 1) < 0.05
    assert np.isfinite(case.simulate(0, 8)).all()


def test_recorded_flights_are_read_and_their_faults_reported(tmp_path):
    file = tmp_path / "own.csv"
    t = np.arange(0, 60, 0.7)
    lines = [f"{s:.2f},{60e3},{8e3},{-30e3 + 300 * s:.1f}" for s in t]
    file.write_text("\n".join(["t_s,x_m,y_m,z_m", *lines]))
    config = tmp_path / "own.yaml"
    config.write_text(
        f"study: multimodel\nsensor: {SENSOR}\ntarget: {{kind: recorded, file: own.csv}}\n"
        "filters: [{name: k, family: kalman, models: [{motion: uniform, sigma_acceleration_mps2: 1}]}]\n"
        "realisations: 8\n"
    )
    case = CaseWork(load(str(config)).cases[0])
    assert np.allclose(case.plan.world.truth[:, 7], 300, atol=1)
    before = case.identity
    file.write_text("\n".join(["t_s,x_m,y_m,z_m", *lines[:40]]))
    assert CaseWork(load(str(config)).cases[0]).identity != before
    file.write_text("\n".join(["t_s,x_m,y_m,z_m", *lines[:10], "1,2,three,4", "0.1,1,1,1"]))
    with pytest.raises(ConfigError) as caught:
        _ = CaseWork(load(str(config)).cases[0]).plan
    assert "own.csv:12: must be four numbers" in caught.value.lines[0]
    assert "own.csv:13: t_s must increase" in caught.value.lines[1]


def test_cases_of_one_identity_have_their_own_names():
    """A case that differs in display names alone takes over the other's sums, under its own names."""
    shipped, renamed = configured_case(), configured_case(filters=[{**f, "name": f"my {f['name']}"} for f in FILTERS])
    assert shipped.identity == renamed.identity
    plan = shipped.plan
    axes = STUDY.relabelled(plan.axes, renamed.case)
    assert axes.filters == ("my imm", "my gpb2", "my kalman")
    assert isinstance(axes, multimodel.FlightAxes)
    assert np.array_equal(axes.truth, plan.axes.truth)
    sums = plan.layout.unpack(shipped.simulate(0, 16))
    result = CaseResult("other", "multimodel", renamed.case.spec, (), 16, sums, axes)
    for name, table in tables.tables([result]).items():
        assert set(table["filter"]) <= set(axes.filters), name
    # Names of stages make tables of their own: a case that calls them differently is another one.
    flight = {**inline_flight(), "stages": [{"name": "a", "end_s": 20}, {"name": "b"}]}
    other_flight = {**flight, "stages": [{"name": "a", "end_s": 20}, {"name": "c"}]}
    assert configured_case(target=flight).identity != configured_case(target=other_flight).identity


def test_axes_describe_the_reported_scans():
    case = configured_case(report_every=7)
    axes, spec = case.plan.axes, case.case.spec
    assert axes.truth.shape == (len(axes.k), 9)
    assert np.array_equal(axes.truth, case.plan.world.truth[axes.k - 1])
    assert axes.stage_scans.sum() == spec.scans - 3
    assert len(axes.stage_scans) == len(spec.target.stages)


def test_track_over_recorded_plots_equals_the_experiment():
    case = configured_case()
    plan, sensor = case.plan, case.case.spec.sensor
    z, *_ = multimodel.simulate_plots(plan, 0)
    R = frames.rotation(sensor.antenna_azimuth_rad, sensor.antenna_elevation_rad)
    biconical = to_biconical(frames.to_antenna(z[:, :, 0], R, sensor.antenna_height_m))
    t = np.concatenate([plan.axes.t_s[:1] - 1.5, plan.axes.t_s[:1] - 1.0, plan.axes.t_s[:1] - 0.5, plan.axes.t_s])
    columns = tracking.columns(case.case.spec)[0]
    track = tracking.track(case.case, dict(zip(columns, [t + 100, *biconical.T], strict=True)))
    sums = plan.layout.unpack(case.simulate(0, 1))
    assert np.isnan(track.estimate[:, :2]).all()
    assert np.allclose(track.estimate[:, 3:], sums["error"][..., 0] + plan.world.truth[3:], rtol=PRECISION, atol=1e-3)
    assert np.allclose(track.probability[0, 3:], sums["probability"][0, :, :3, 0], rtol=0, atol=10 * PRECISION)
    assert np.allclose(np.nansum(track.probability, axis=2)[:, 2:], 1, rtol=0, atol=rounding(operations=6))


def test_track_waits_over_gaps_and_plots_beyond_the_edge():
    case = configured_case()
    columns = tracking.columns(case.case.spec)[0]
    t = np.cumsum(np.random.default_rng(3).uniform(0.02, 3, 9000))
    plots = np.stack([np.full(9000, 5e4), np.full(9000, 0.1), np.full(9000, -0.1)])
    plots[0, 40:60] = np.nan
    plots[1, 70] = 1.5
    track = tracking.track(case.case, dict(zip(columns, [t, *plots], strict=True)))
    assert np.isfinite(track.estimate[:, 2:]).all()
    assert np.isfinite(track.sigma[:, 2:]).all()
    assert (track.sigma[0, 59, ::3] > track.sigma[0, 39, ::3]).all()
    assert track.sigma[0, 70, 0] > track.sigma[0, 69, 0]


def test_a_track_of_two_plots_has_no_estimate():
    case = configured_case()
    columns = tracking.columns(case.case.spec)[0]
    track = tracking.track(case.case, dict(zip(columns, [np.arange(2.0), *np.full((3, 2), 0.1)], strict=True)))
    assert np.isnan(track.estimate).all()


def test_coarse_angles_err_but_stay_finite():
    sensor = {**SENSOR, "scan_period_s": 0.05, "sigma_elevation_deg": 3, "sigma_azimuth_deg": 3, "antenna_height_m": 0}
    filters = [FILTERS[0], FILTERS[1], {**FILTERS[0], "name": "there", "covariance_at": "prediction"}]
    case = configured_case(sensor=sensor, filters=filters, target="ballistic", scans=1500)
    assert np.isfinite(case.simulate(0, 16)).all()


def test_the_shipped_plots_are_tracked_with_errors_that_fit_sigma():
    """On the ballistic part, where the bank is right: 315 errors within 5.85 σ, and innovations of the stated size."""
    path = Path(__file__).parents[3] / "docs" / "examples" / "multimodel.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    columns = {name: table[name] for name in ("t_s", "range_m", "elevation_rad", "azimuth_rad")}
    tracks = tracking.track(load("multimodel_1hz").cases[0], columns)
    f, ballistic = tracks.filters.index("MMA2-122"), (table["t_s"] >= 20) & (table["t_s"] < 125)
    truth = np.stack([table[f"true_{axis}_m"] for axis in "xyz"], axis=1)
    e = (tracks.estimate[f, :, 0::3] - truth)[ballistic] / tracks.sigma[f, :, 0::3][ballistic]
    assert np.abs(e).max() < 5.85
    freedom = 3 * ballistic.sum()
    assert tracks.tested == (("plot", 3),)
    assert abs(tracks.nis[f, ballistic, 0].sum() / freedom - 1) < 5.85 * np.sqrt(2 / freedom)
