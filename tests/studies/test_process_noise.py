"""Process noise in answers: the best of several values, the gain with each at its best, and what helps a loser."""

import re

import numpy as np
import pytest

import radarsim
from radarsim.api import new_configs
from radarsim.api.configs import load
from radarsim.studies import registry
from radarsim.studies.process_noise_remedy import remedy_sentence

RADAR = {"name": "mine", "wavelength_m": 0.032, "sigma_range_m": 15, "sigma_velocity_mps": 0.8, "scan_period_s": 2.5}
TURN = {"kind": "turn", "range_m": 8e3, "speed_mps": 12, "aspect_deg": 180, "start_s": 30, "acceleration_g": 0.2}
TARGET = TURN | {"duration_s": 18}
SINCE = 13  # the scan of the manoeuvre
PLANE = {
    "study": "plane",
    "radar": RADAR | {"sigma_bearing_deg": 0.3},
    "target": TARGET,
    "filters": [
        {"name": name, "kind": "extended", "doppler": doppler, "sigma_acceleration_mps2": 0.5, "association": "known"}
        | {"sigma_start_velocity_mps": 15}
        for name, doppler in (("r", False), ("r+Vr", True))
    ],
    "scans": 31,
    "realisations": 300,
}
FOLDED = {
    "study": "ambiguous_doppler",
    "radar": RADAR | {"repetition_rate_hz": 2500},
    "target": TARGET,
    "filters": [
        {"name": "r", "doppler": "none", "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "doppler": "folded", "manoeuvre_variance": 1e-3},
    ],
    "scans": 31,
    "realisations": 300,
}
SWEPT = {
    "plane": (PLANE, "sigma_acceleration_mps2", [0.05, 1.5], ("0.05 m/s²", "1.5 m/s²"), "σ_a"),
    "folded": (FOLDED, "manoeuvre_variance", [1e-5, 1e-1], ("10⁻⁵", "10⁻¹"), "D_M"),
}


def worst_sigmas(config):
    """The worst σ of the range of either filter from the manoeuvre on, of a run of this config alone."""
    curves = radarsim.run(config).curves
    rows = curves[(curves["component"] == "r") & (curves["k"] >= SINCE)]
    return rows.assign(sigma=rows["exact_sigma"].fillna(rows["sigma"])).groupby("filter")["sigma"].max()


@pytest.mark.parametrize("name", SWEPT)
def test_a_sweep_of_process_noise_says_the_best_of_each_filter_and_the_gain_then(name):
    """Against runs of each value alone."""
    config, key, values, texts, symbol = SWEPT[name]
    alone = {}
    for value in values:
        filters = [filter_keys | {key: value} for filter_keys in config["filters"]]
        alone[value] = worst_sigmas(config | {"filters": filters})
    best, gain = radarsim.run(config | {"sweep": {key: values}}).answer[:2]
    assert best.startswith(
        f"mine, best {symbol}, by the largest RMS error of the range from the manoeuvre on (30 s): r "
    )
    for filter_name in ("r", "r+Vr"):
        sigmas = [alone[value][filter_name] for value in values]
        named = re.escape(f"{filter_name} {texts[int(np.argmin(sigmas))]} (RMS error ")
        assert float(re.search(rf"{named}(?:about )?([\d.]+) m, at ", best)[1]) == pytest.approx(min(sigmas), rel=5e-3)
    at_best = 100 * (1 - min(s["r+Vr"] for s in alone.values()) / min(s["r"] for s in alone.values()))
    low, high = map(float, re.search(r"% \((−?[\d.]+) … (−?[\d.]+)\) with each at its best", gain).groups())
    assert low < at_best < high
    assert gain.startswith("mine, gain of r+Vr over r in RMS error of the range at worst (95 % intervals): ")
    assert f"with the same {symbol} for both" in gain


@pytest.mark.parametrize(
    ("like", "line"),
    [
        ("plane", "# sweep: {sigma_acceleration_mps2: "),
        ("ambiguous_rls2", "# sweep: {manoeuvre_variance: [1e-5, 0.0001, 0.001, 0.01, 0.1, 1]}"),
        ("pulses_rls4", "# sweep: {manoeuvre_variance: "),
    ],
)
def test_a_new_config_has_the_sweep_as_a_comment_that_can_be_switched_on(tmp_path, like, line):
    path = new_configs.write_new_config("mine", like, tmp_path)
    (comment,) = [text for text in path.read_text().splitlines() if text.startswith("# sweep")]
    assert comment.startswith(line)
    assert "each filter at its best" in comment
    path.write_text(path.read_text().replace(comment, comment.removeprefix("# ")))
    assert len(load(path).cases) in (5, 6)


def remedy(config):
    """The sentence on what helps, of a config's run."""
    result = radarsim.run(config)
    sentences = [text for text in result.answer if "--out cured helps" in text or "nothing helps" in text]
    return sentences[0] if sentences else ""


def overrides_of(sentence):
    return re.findall(r"--set (\S+=[^ ;]+)", sentence)


SHARP = {
    "study": "range_doppler",
    "radar": RADAR | {"sigma_range_m": 60, "sigma_velocity_mps": 2, "scan_period_s": 12, "wavelength_m": 0.1},
    "target": TURN | {"range_m": 120e3, "speed_mps": 280, "start_s": 100, "acceleration_g": 3, "duration_s": 12},
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 10},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 10},
    ],
    "scans": 21,
    "realisations": 100,
}


def test_a_filter_that_loses_in_a_manoeuvre_is_told_what_helps_and_that_helps():
    """No D_M does, as D_M acts on range, velocity and acceleration alike; another form of it does."""
    sentence = remedy(SHARP)
    assert "filters.1.process_noise=white_" in sentence
    curves = radarsim.run(SHARP, overrides=overrides_of(sentence)).curves
    late = curves[(curves["component"] == "r") & (curves["k"] >= 10)]
    worst = late.groupby("filter")["exact_sigma"].max()
    gain = 100 * (1 - worst["r+Vr"] / worst["r"])
    assert float(re.search(r"([−\d]+) % at worst", sentence)[1]) == pytest.approx(gain, abs=0.6)
    assert gain > 0


def test_folded_velocities_in_the_plane_have_a_remedy():
    folded = PLANE | {"radar": PLANE["radar"] | {"repetition_rate_hz": 1600, "detection_probability": 0.85}}
    folded |= {"scans": 61, "target": TARGET | {"start_s": 60}}
    sentence = remedy(folded)
    assert "radar.repetition_rate_hz=" in sentence
    gains = radarsim.run(folded, overrides=overrides_of(sentence)).gains
    assert gains[(gains["component"] == "r") & (gains["k"] == 61)]["gain_lo"].item() > 0


def test_no_remedy_is_named_without_a_loss_nor_where_process_noise_is_swept():
    assert remedy(PLANE) == ""
    result = radarsim.run(SHARP | {"sweep": {"manoeuvre_variance": [1, 10]}})
    assert not any("helps" in text for text in result.answer)


def test_what_is_impossible_does_not_help_nor_end_the_run():
    """Among false plots a larger process noise widens the gate beyond the false plots that are drawn."""
    cluttered = PLANE["radar"] | {"repetition_rate_hz": 1200, "false_plots_per_km2": 0.5, "detection_probability": 0.85}
    filters = [keys | {"association": "nearest"} for keys in PLANE["filters"]]
    result = radarsim.run(PLANE | {"radar": cluttered, "filters": filters, "realisations": 100})
    study = registry.study("plane")
    gains = result.tables["gains"].assign(gain_percent=-50.0, gain_lo=-60.0, gain_hi=-40.0)
    (sentence,) = remedy_sentence(study, result.cases, result.tables | {"gains": gains}, study.alternatives)
    assert "--out cured helps" in sentence.text


def test_a_rival_that_measures_no_more_is_told_nothing():
    pair = [keys | {"doppler": False} for keys in PLANE["filters"]]
    pair[1] |= {"sigma_acceleration_mps2": 1e-3}
    assert remedy(PLANE | {"filters": pair}) == ""


def test_where_nothing_helps_that_is_said():
    result = radarsim.run(SHARP)
    study = registry.study("range_doppler")
    (sentence,) = remedy_sentence(study, result.cases, result.tables, lambda spec, index: ())
    assert "nothing helps of what was tried on 400 realisations: D_M = " in sentence.text
