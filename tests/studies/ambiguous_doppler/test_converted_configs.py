"""A config of range_doppler with velocities that fold: carried over by one key, and what helps where folds are lost."""

import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.config.yaml_io import as_yaml
from radarsim.errors import ConfigError
from radarsim.studies.ambiguous_doppler.remedy_answer import cures
from tests.tolerances import share_error

RADAR = {
    "wavelength_m": 0.1,
    "sigma_range_m": 60.0,
    "sigma_velocity_mps": 3.0,
    "scan_period_s": 4.0,
    "detection_probability": 0.9,
    "repetition_rate_hz": 1200.0,
}
TURN = {"kind": "turn", "range_m": 120e3, "speed_mps": 280, "aspect_deg": 180, "start_s": 100, "acceleration_g": 3,
        "duration_s": 12}  # fmt: skip
COMMON = {"target": TURN, "realisations": 400, "seed": 2017}
MINE = {
    "study": "range_doppler",
    "radar": {**RADAR, "bias_range_m": 0.0},
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 0.1},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 0.1, "process_noise": "random_jerk"},
    ],
    "duration_s": 240,
    **COMMON,
}
FOLDED = ("study=ambiguous_doppler",)


def test_study_key_equals_a_config_written_by_hand():
    by_hand = {
        "study": "ambiguous_doppler",
        "radar": RADAR,
        "filters": [
            {"name": "r", "doppler": "none", "manoeuvre_variance": 0.1},
            {"name": "r+Vr", "doppler": "folded", "manoeuvre_variance": 0.1},
            {"name": "r+Vr with known folds", "doppler": "unfolded", "manoeuvre_variance": 0.1},
        ],
        "scans": 61,
        **COMMON,
    }
    carried, written = radarsim.run(MINE, overrides=FOLDED), radarsim.run(by_hand)
    for name in ("curves", "gains", "folds"):
        assert carried.tables[name].equals(written.tables[name])


def test_study_key_with_include_takes_further_keys(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(as_yaml(MINE))
    (tmp_path / "wide.yaml").write_text("study: ambiguous_doppler\ninclude: [mine]\nprior: {sigma_velocity_mps: 500}\n")
    (tmp_path / "again.yaml").write_text("include: [wide]\nradar: {repetition_rate_hz: [1200, 1400]}\n")
    (case,) = load("wide.yaml", ()).cases
    assert (case.study, case.spec.prior.sigma_velocity_mps) == ("ambiguous_doppler", 500.0)
    (case,) = load("again.yaml", ()).cases
    assert (case.spec.radar.rates_hz, case.spec.prior.sigma_velocity_mps) == ((1200.0, 1400.0), 500.0)


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ("radar.bias_range_m=5", "radar.bias_range_m.*unknown key"),
        ("filters.1.process_noise=white_jerk", "process_noise"),
        ("filters.1.manoeuvre_variance={minimise: sigma_r, over: worst}", "filters.1.manoeuvre_variance"),
        ("target={kind: jerk_pulse}", "kind.*must be one of"),
    ],
)
def test_keys_without_counterpart_are_refused(changed, fault):
    with pytest.raises(ConfigError, match=fault):
        load(MINE, (*FOLDED, changed))


def lost_share_at_the_end(result):
    """The share of realisations in which the folded filter's velocity is off by over half the span at the last scan."""
    folds = result.tables["folds"]
    return folds[folds["filter"] == "r+Vr"]["beyond_half_interval_share"].iloc[-1]


def test_remedies_are_those_tried():
    """Of the turn with one order nearly all are lost. Orders [1, 2] hold the fold; staggered rates do not here."""
    lost = radarsim.run(MINE, overrides=FOLDED)
    assert lost_share_at_the_end(lost) > 0.8
    trials = cures(load(MINE, FOLDED).cases[0].spec, "r+Vr")
    shares = {settings: trial.share for settings, trial in trials if trial.gain > 0}
    assert shares
    assert all("repetition_rate_hz" not in settings or "manoeuvre_variance" in settings for settings in shares)
    for settings, share in shares.items():
        overrides = (*FOLDED, *(setting for setting in settings.replace("--set ", "").split()))
        cured = radarsim.run(MINE, overrides=overrides)
        assert abs(lost_share_at_the_end(cured) - share) < 2**0.5 * share_error(share, 400)  # two independent samples


def test_remedies_do_not_change_swept_keys():
    """Where it would, the setting is refused beside the sweep."""
    key = "filters.1.manoeuvre_variance"
    swept = load({**MINE, "sweep": {key: [0.1, 0.2]}}, FOLDED)
    case = swept.cases[0]
    touching = {said for said, _ in cures(case.spec, "r+Vr") if key in said}
    assert touching
    for settings in touching:
        with pytest.raises(ConfigError, match="sweep"):
            load({**MINE, "sweep": {key: [0.1, 0.2]}}, (*FOLDED, *settings.replace("--set ", "").split()))
    assert not touching & {said for said, _ in cures(case.spec, "r+Vr", dict(case.swept_values))}


BOAT = {
    "study": "ambiguous_doppler",
    "radar": {
        "name": "mine",
        "wavelength_m": 0.032,
        "sigma_range_m": 15,
        "sigma_velocity_mps": 0.8,
        "scan_period_s": 2.5,
    }
    | {"repetition_rate_hz": 1200, "detection_probability": 0.85},
    "target": {"kind": "turn", "range_m": 8e3, "speed_mps": 12, "aspect_deg": 180, "start_s": 60}
    | {"acceleration_g": 0.2, "duration_s": 18},
    "filters": [
        {"name": "r", "doppler": "none", "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "doppler": "folded", "manoeuvre_variance": 1e-3},
    ],
    "scans": 61,
    "realisations": 4000,
}


def prior_sigmas(target, **prior):
    """σ of velocity and of acceleration that filters start from, of the boat's radar and another target."""
    (case,) = load({**BOAT, "target": target, **({"prior": prior} if prior else {})}, ()).cases
    return case.spec.prior.sigma_velocity_mps, case.spec.prior.sigma_acceleration_mps2


def test_prior_follows_the_speed_of_the_target():
    """1.2 times the speed; a change of the speed in 25 s, or the acceleration at the first plot where it is more."""
    boat = BOAT["target"]
    assert prior_sigmas(boat) == (14.4, 0.48)
    assert prior_sigmas(boat, sigma_velocity_mps=300) == (300, 0.48)
    assert prior_sigmas(boat, sigma_acceleration_mps2=10) == (14.4, 10)
    near = {"kind": "fly_by", "distance_m": 200, "speed_mps": 12, "start_range_m": 250}
    assert prior_sigmas(near) == (14.4, 0.576)  # 12² / 250, as it passes
    assert prior_sigmas(boat | {"start_s": 0}) == pytest.approx((14.4, 0.2 * 9.80665 + 12**2 / 8e3), abs=0.01)
    assert prior_sigmas({"kind": "polynomial", "coefficients": [8e3, -12, 2]}) == (14.4, 2)
    assert prior_sigmas({"kind": "fly_by", "distance_m": 500, "speed_mps": 12, "start_range_m": 8e3}) == (14.4, 0.48)
    for coefficients in ([8e3], [8e3, 0, 3], [100e3, -250, 4]):  # no speed, or that of an aircraft
        assert prior_sigmas({"kind": "polynomial", "coefficients": coefficients}) == (300, 10)
    assert prior_sigmas({"kind": "random_polynomial"}) == (300, 10)


def test_prior_is_in_the_answer():
    """One sentence for all cases, whatever else the answer says."""
    small = BOAT | {"scans": 4, "realisations": 60}
    (line,) = [line for line in radarsim.run(small).answer if line.startswith("Note")]
    assert line.startswith("Note: prior of the filters: σ of the velocity 14.4 m/s, of the acceleration 0.48 m/s²")
    swept = small | {"sweep": {"target.speed_mps": [10, 20]}}
    (line,) = [line for line in radarsim.run(swept).answer if line.startswith("Note")]
    assert "σ of the velocity 12 to 24 m/s, of the acceleration 0.4 to 0.8 m/s²; D is " in line


@pytest.mark.parametrize("config", ["ambiguous_depth", "ambiguous_manoeuvre", "ambiguous_orders", "orders"])
def test_prior_of_shipped_configs_without_it_is_that_of_an_aircraft(config):
    priors = {(p.sigma_velocity_mps, p.sigma_acceleration_mps2) for c in load(config, ()).cases for p in [c.spec.prior]}
    assert priors == {(300, 10)}


@pytest.mark.slow
def test_a_loss_names_what_turns_it_into_a_gain():
    """1.6 % of folds are lost, and the range is four times worse than without Doppler: -281 % (and -307, -308)."""
    result = radarsim.run(BOAT)
    first, second = [line for line in result.answer if "--out cured helps" in line]
    assert any("σ of the velocity 14.4 m/s, of the acceleration 0.48 m/s²" in line for line in result.answer)
    setting = "filters.1.manoeuvre_variance=0.1"
    assert f": --set {setting} --out cured helps: 0 % of the tracks are lost, " in first
    gain = float(first.partition("0 % of the tracks are lost, ")[2].split()[0])
    gains = radarsim.run(BOAT, overrides=[setting]).gains
    row = gains[(gains["filter"] == "r+Vr") & (gains["component"] == "r")].iloc[-1]
    assert row["gain_percent"] == pytest.approx(gain, abs=3)
    assert f"{setting} --set radar.repetition_rate_hz=[1200,1400,1600]" in second  # not the rates alone
