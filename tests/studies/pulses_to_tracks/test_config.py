"""What a config of the study may say, and what is told of one that is wrong."""

import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.studies.pulses_to_tracks import answer
from tests.tolerances import rounding

ALL = "[range, velocity, acceleration]"
FAULTS = [
    (["burst.pulses=400000"], "burst.pulses: "),
    (["burst.repetition_rate_hz=1"], "burst.pulses: the burst must be <= radar.scan_period_s, 10 s, is 16 s"),
    (["burst.repetition_rate_hz=100"], "burst.repetition_rate_hz: must be >= "),
    (["burst.pulse_length_s=1e-3"], "burst.pulse_length_s: must be <= 1/repetition_rate_hz"),
    (["burst.pulses=4", "filters.2.derivatives=1"], "4 pulses are too few for 3 parameters: at least 6"),
    (["filters.0.estimator=cured"], "filters.0.estimator: has no effect on range alone; leave it out"),
    (["filters.4.forecast=track"], "filters.4.forecast: has no effect with estimator: spectrum; leave it out"),
    (["filters.1.use=gated"], "filters.1.use: must be as_measured with estimator: fisher_bound"),
    (["filters.2.gate_probability=0.9"], "filters.2.gate_probability: belongs to use: gated"),
    (["filters.2.observes=[velocity]"], "filters.2.observes: must be [range]"),
    ([f"filters.2.observes={ALL}", "filters.2.derivatives=0"], "filters.2.derivatives: must be >= 1"),
    (["filters.0.hypotheses=3"], "filters.0.hypotheses: has no effect on range alone; leave it out"),
    (["filters.1.hypotheses=3"], "filters.1.hypotheses: has no effect with estimator: fisher_bound, which has"),
    (["filters.5.hypotheses=3"], "filters.5.use: must be as_measured or mixture with several hypotheses"),
    (["filters.2.hypotheses=0"], "filters.2.hypotheses: must be"),
    (["filters.2.prune_below=0.1"], "filters.2.prune_below: has no effect without hypotheses: 2 or more; leave it out"),
    (["filters.2.hypotheses=1", "filters.2.estimate=best"], "filters.2.estimate: has no effect without hypotheses: 2"),
    (["filters.2.hypotheses=3", "filters.2.prune_below=1"], "filters.2.prune_below: must be"),
    (["prior.sigma_velocity_mps=1e9"], "prior.sigma_velocity_mps: out of proportion"),
    (["radar.band=L"], "radar.band: L is"),
]  # fmt: skip


@pytest.mark.parametrize(("overrides", "said"), FAULTS)
def test_faults_are_reported_at_their_key(overrides, said):
    with pytest.raises(ConfigError) as caught:
        load("pulses", overrides)
    lines = [line.replace("']:", ":") for line in caught.value.lines]  # a key given in Python: overrides['KEY']
    assert any(said in line for line in lines), lines


def test_defaults_are_filled_in():
    spec = load("pulses").cases[0].spec
    cured, gated, mixture = spec.filters[3], spec.filters[5], spec.filters[6]
    assert (cured.forecast, cured.derivatives, cured.use, cured.gate_probability) == ("track", 0, "as_measured", None)
    assert (gated.gate_probability, mixture.lock_probability) == (0.999, 0.95)
    assert spec.filters[0].estimator is None
    assert [f.hypotheses for f in spec.filters] == [None, None, 1, 1, 1, 1, 1]
    many = load("pulses", ["filters.6.hypotheses=9"]).cases[0].spec.filters[6]
    assert (many.hypotheses, many.prune_below, many.estimate) == (9, 1e-6, "mean")
    assert spec.span_mps == pytest.approx(300.0, rel=rounding(operations=3))


def test_pulses_by_their_number_a_second_and_a_duration():
    cases = load("pulses_energy").cases
    assert [case.spec.burst.pulses for case in cases] == [8, 16, 32, 64]
    assert [case.spec.scans for case in cases] == [57, 29, 15, 8]
    assert load("pulses", ["burst.pulses_per_second=1.6"]).cases[0].spec == load("pulses").cases[0].spec


def test_forecast_wider_than_the_span_warns():
    assert answer.warnings(load("pulses")) == []
    (line,) = answer.warnings(load("pulses", ["prior.sigma_velocity_mps=100"]))
    assert line.startswith(
        "pulses: prior.sigma_velocity_mps: 3 σ of the velocity, 300 m/s, are over half the unambiguous interval of "
    )
    many = [f"filters.{n}.hypotheses=9" for n in (2, 3, 4, 6)]
    gated = "filters.5={name: many, observes: [range, velocity], manoeuvre_variance: 1e-3, hypotheses: 9}"
    assert answer.warnings(load("pulses", ["prior.sigma_velocity_mps=100", gated, *many])) == []


def test_forecast_without_windows_is_refused():
    """A burst whose noise leaves no schedule ends in one line."""
    from radarsim.studies.pulses_to_tracks import study

    with pytest.raises(ConfigError, match="no windows lead from the forecast to the burst"):
        study.prepare(
            load("pulses", ["burst.snr_db=-60", "burst.pulses=4096", "burst.repetition_rate_hz=1e6"]).cases[0]
        )
