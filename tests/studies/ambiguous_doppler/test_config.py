"""What the keys refuse, and the words that the user gets; what is warned of."""

import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.studies import registry


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("filters.5.hypotheses", "0", "filters.5.hypotheses: must be >= 1, got 0"),
        ("filters.5.hypotheses", "-3", "filters.5.hypotheses: must be >= 1, got -3"),
        ("filters.5.hypotheses", "1e6", "filters.5.hypotheses: must be <= 100000, got 1000000"),
        ("filters.5.prune_below", "1", "filters.5.prune_below: must be < 1, got 1"),
        ("filters.5.prune_below", "true", "filters.5.prune_below: must be a number, got true"),
        ("filters.5.prune_below", "-1e-3", "filters.5.prune_below: must be >= 0, got -0.001"),
        ("filters.5.merge", "sometimes", "filters.5.merge: must be one of never, each_scan"),
        ("filters.0.hypotheses", "10", "filters.0.hypotheses: belongs to doppler: folded, not none"),
        ("filters.1.estimate", "best", "filters.1.estimate: belongs to doppler: folded, not unfolded"),
        ("filters.3.hypotheses", "10", "filters.3.hypotheses: belongs to merge: never, not each_scan"),
        ("filters.5.orders", "[3]", "filters.5.orders.0: must be <= 2, got 3"),
        ("filters.5.orders", "[2, 1]", "filters.5.orders: must increase, without repetition"),
        ("filters.5.orders", "[1, 2]", "filters.5.manoeuvre_variance: must be a list of 2, one for each order"),
        ("filters.5.combine", "likelihood", "filters.5.combine: has no effect on one order; leave it out"),
        ("filters.3.doppler", "remainder", "filters.3.merge: belongs to doppler: folded, not remainder"),
        ("filters.1.doppler", "remainder", "filters.1.doppler: remainder needs several rates in radar.repetition_rate"),
        ("filters.5.stay_probability", "0.9", "filters.5.stay_probability: belongs to combine: likelihood"),
        ("radar.repetition_rate_hz", "1", "repetition_rate_hz: its unambiguous interval must be at least 0.03 m/s"),
        ("radar.sigma_velocity_mps", "1e17",
         "its unambiguous interval must be at least 1e+13 m/s, radar.sigma_velocity_mps over 10000"),
        ("radar.repetition_rate_hz", "0", "radar.repetition_rate_hz: must be > 0, got 0"),
        ("radar.repetition_rate_hz", "[1000, 1200, 1000]", "radar.repetition_rate_hz: must differ from rate to rate: "),
        ("radar.repetition_rate_hz", "[]", "radar.repetition_rate_hz: must hold at least 1"),
        ("radar.detection_probability", "0", "radar.detection_probability: must be > 0, got 0"),
        ("prior.sigma_velocity_mps", "1e9", "prior.sigma_velocity_mps: must be at most 1e+06 times"),
        ("prior.sigma_velocity_mps", "0", "prior.sigma_velocity_mps: must be > 0, got 0"),
        ("filters.5.manoeuvre_variance", "-1", "filters.5.manoeuvre_variance: must be >= 0, got -1"),
        ("filters.5.manoeuvre_variance", "1e15", "filters.5.manoeuvre_variance: out of proportion"),
        ("scans", "1", "scans: must be >= 2, got 1"),
        ("scans", "1e5", "scans: must be <= 10000, got 100000"),
        ("target", "{kind: turn, range_m: 5e3, speed_mps: 250, aspect_deg: 180, start_s: 500, duration_s: 1, "
         "acceleration_g: 1}", "target: must not fly over the radar: it comes within 100 m of it"),
        ("target", "{kind: fly_by, distance_m: 8e3, speed_mps: 300, start_range_m: 7e3}",
         "target.start_range_m: must be >= distance_m, 8000"),
        ("target", "{kind: acceleration_start, coefficients: [1e5], acceleration_mps2: 5}",
         "target.start_s: required key is missing"),
        ("target", "{kind: polynomial, coefficients: [1e5, 1e12]}", "target: must stay within 45e11 m of the radar"),
        ("target", "{kind: random_polynomial, sigma_acceleration_mps2: 1e17}",
         "sigma_acceleration_mps2: must be <= 1000, got"),
        ("target", "{kind: hovering}", "target.kind: must be one of polynomial, random_polynomial, acceleration_start, "
         "acceleration_pulse, turn, fly_by, recorded"),
    ],
)  # fmt: skip
def test_invalid_keys_are_refused(key, value, words):
    with pytest.raises(ConfigError) as error:
        load("ambiguous_rls4", [f"{key}={value}"])
    assert words in str(error.value).replace("']:", ":")  # a key given in Python: overrides['KEY']


def test_several_orders_need_a_combination():
    assert "filters.4.combine: is needed by several orders" in refused_without("combine")
    assert "filters.5.manoeuvres: is needed by combine: expected_error" in refused_without("manoeuvres")


def refused_without(key):
    case = load("orders").cases[0]
    document = {"study": "ambiguous_doppler", **case.resolved()}
    document = {name: value for name, value in document.items() if name not in ("case", "swept")}
    for f in document["filters"]:
        f.pop(key, None)
    with pytest.raises(ConfigError) as error:
        load(document)
    return str(error.value)


def test_combinations_of_fixed_shares_need_every_plot():
    with pytest.raises(ConfigError, match=r"filters\.5\.combine: expected_error needs every plot"):
        load("orders", ["radar.detection_probability=0.9"])


def test_defaults_are_filled_in():
    spec = load("ambiguous_rls4").cases[0].spec
    assert (spec.target.sigma_velocity_mps, spec.target.sigma_acceleration_mps2) == (300, 10)
    range_only, _, nearest, no_memory, best, memory = spec.filters
    assert (memory.hypotheses, memory.prune_below, memory.merge, memory.estimate) == (300, 1e-6, "never", "mean")
    assert (nearest.hypotheses, best.estimate, range_only.hypotheses) == (1, "best", None)
    assert (no_memory.merge, no_memory.hypotheses) == ("each_scan", None)


def test_short_span_warns_and_runs():
    study = registry.study("ambiguous_doppler")
    assert study.warnings(load("ambiguous_rls4")) == []
    (line,) = study.warnings(load("ambiguous_rls4", ["radar.repetition_rate_hz=120"]))
    interval = "its unambiguous interval of 1.8 m/s"
    assert line.startswith(f"ambiguous_rls4: radar.repetition_rate_hz: {interval} is under 2 σ_V, 2 m/s")
    (line,) = study.warnings(load("ambiguous_rls4", ["radar.repetition_rate_hz=[120, 1000]"]))
    assert "1.8 m/s" in line
    assert study.warnings(load("orders", ["radar.repetition_rate_hz=1"])) == []  # nothing there is folded
