"""`radarsim new --target`: a first config that fits a target and the radar, and warnings of runs that are too short."""

import math
import re

import numpy as np
import pytest

import radarsim
from radarsim.api import configs, fitted_target, new_configs
from radarsim.api.fitted_target import TARGETS
from radarsim.config.yaml_io import as_yaml
from radarsim.errors import ConfigError
from tests.program import command

RADAR = {"name": "coast", "wavelength_m": 0.032, "sigma_range_m": 15, "sigma_velocity_mps": 0.8, "scan_period_s": 2.5}
COAST = {
    "study": "range_doppler",
    "radar": RADAR,
    "target": "polynomial",
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
    ],
    "scans": 15,
    "realisations": 100,
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "coast.yaml").write_text(as_yaml(COAST))
    return tmp_path


def written(like, target):
    path = new_configs.write_new_config("mine", like, target=target)
    (case,) = configs.load(path).cases
    return path.read_text(), case.spec


@pytest.mark.parametrize("like", ["rls2", "coast"])
@pytest.mark.parametrize("target", TARGETS)
def test_the_new_config_fits_target_and_radar(folder, target, like):
    text, spec = written(like, target)
    keys, period = spec.target, spec.radar.scan_period_s
    (shipped,) = configs.load(COAST | {"target": TARGETS[target], "scans": 3}).cases
    assert (keys.speed_mps, keys.acceleration_g, keys.duration_s) == tuple(
        getattr(shipped.spec.target, name) for name in ("speed_mps", "acceleration_g", "duration_s")
    )
    change = keys.acceleration_g * 9.80665 / 2
    for filter_ in spec.filters:  # half the acceleration of the turn, gained in a scan
        assert filter_.manoeuvre_variance == pytest.approx((change / period) ** 2, rel=0.06)
    last_s = (spec.scans - 1) * period
    assert keys.start_s % period == 0
    assert last_s >= 2 * keys.start_s + keys.duration_s - period
    assert keys.closest_m(last_s) > 0.4 * keys.range_m
    for name in ("range_m", "speed_mps", "start_s", "acceleration_g", "duration_s", "scans"):
        assert re.search(rf"^ *{name}: .* # .*; .+", text, re.MULTILINE), name
    assert configs.load(folder / "mine.yaml").cases[0].realisations == (1e5 if like == "rls2" else 100)


def settled_scan(observed, variance, sigma, dt):
    """The scan, from 1, from which on σ of the range is within 5 % of its limit, by a recursion of its own."""
    F = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    g = np.array([dt**3 / 6, dt**2 / 2, dt])
    H, R = np.eye(3)[:observed], np.diag(np.array(sigma[:observed]) ** 2)
    start = {1: 3, 2: 2}[observed]
    design = np.concatenate([H @ np.linalg.matrix_power(np.linalg.inv(F), start - 1 - k) for k in range(start)])
    believed = np.linalg.inv(design.T @ np.kron(np.eye(start), np.linalg.inv(R)) @ design)
    noise, sigmas = believed, []
    for _ in range(600):
        sigmas.append(math.sqrt(noise[0, 0]))
        predicted = F @ believed @ F.T + variance * np.outer(g, g)
        K = predicted @ H.T @ np.linalg.inv(H @ predicted @ H.T + R)
        A = np.eye(3) - K @ H
        believed, noise = A @ predicted, A @ F @ noise @ F.T @ A.T + K @ R @ K.T
    wrong = np.flatnonzero(np.abs(np.array(sigmas) / sigmas[-1] - 1) > 0.05)
    return start + (int(wrong[-1]) + 1 if wrong.size else 0)


@pytest.mark.parametrize("target", ["boat", "ship", "helicopter"])
def test_the_turn_begins_once_the_filters_have_settled(folder, target):
    _, spec = written("coast", target)
    variance = spec.filters[0].manoeuvre_variance
    scan = max(settled_scan(observed, variance, (15, 0.8), 2.5) for observed in (1, 2))
    assert spec.target.start_s == (scan - 1) * 2.5


def test_the_variance_of_the_turn_is_nearly_the_best(folder):
    """Of the boat: r 13.3 m, r+Vr 5.25 m at worst, and no D_M of a sweep does better by 5 %."""
    written("coast", "boat")
    sweep = "sweep={manoeuvre_variance: [0.0015, 0.015, 0.05, 0.15, 0.5, 1.5]}"
    result = radarsim.run("mine.yaml", realisations=20, overrides=[sweep], figures=False)
    for f in (0, 1):
        worst = {}
        for case in result.cases:
            k = round(case.spec.target.start_s / 2.5)
            worst[float(case.axes.manoeuvre_variance[f])] = case.axes.exact_sigma[f, k:, 0].max()
        assert worst[0.15] < 1.05 * min(worst.values())


def test_the_first_answer_runs_at_once(folder):
    run = command("new", "harbour", "--like", "rls4", "--target", "boat")
    assert "warning" not in run.output + run.stderr
    answer = command("run", "harbour.yaml", "-n", 200, "--no-figures").output
    assert "harbour, from the manoeuvre on (70 s)" in answer


@pytest.mark.parametrize(("name", "ends"), [("baot", "; did you mean boat?"), ("submarine", "")])
def test_an_unknown_target_names_those_that_there_are(folder, name, ends):
    with pytest.raises(ConfigError) as caught:
        new_configs.write_new_config("mine", "rls2", target=name)
    (line,) = caught.value.lines
    assert line.endswith(f"{name}: no such target; there are: {', '.join(TARGETS)}{ends}")
    assert not (folder / "mine.yaml").exists()


@pytest.mark.parametrize(("like", "shown"), [("multimodel", "1 case of multimodel"), ("range_doppler", "30 cases of")])
def test_a_config_without_one_radar_in_range_is_refused(folder, like, shown):
    with pytest.raises(ConfigError, match=shown):
        new_configs.write_new_config("mine", like, target="boat")


def test_a_run_that_ends_before_its_filters_settle_is_warned_of(folder):
    """35 s, as the finding has it: the filters settle at 37.5 and 42.5 s."""
    (warning,) = fitted_target.short_run_warnings(configs.load(COAST).cases)
    scan = max(settled_scan(observed, 1e-3, (15, 0.8), 2.5) for observed in (1, 2))
    assert warning == (
        f"config: the last of 15 scans is at 35 s, before the filters have settled at {(scan - 1) * 2.5:g} s: set "
        f"scans to {scan} or more"
    )
    assert fitted_target.short_run_warnings(configs.load(COAST | {"scans": scan}).cases) == ()
    assert f"scans to {scan} or more" in command("new", "again", "--like", "coast").stderr
    assert f"scans to {scan} or more" in command("check", "coast.yaml").stderr


def test_a_run_that_ends_before_the_manoeuvre_is_warned_of(folder):
    (warning,) = fitted_target.short_run_warnings(configs.load(COAST | {"target": "boat"}).cases)
    assert warning.endswith("is at 35 s, before the target's manoeuvre at 60 s: set scans to 26 or more")


def test_shipped_radars_and_other_studies_are_not_warned_of():
    for like in ("rls1", "rls2", "rls3", "rls4", "rls5", "multimodel", "ambiguous_rls4", "sonar_smoothing"):
        assert fitted_target.short_run_warnings(configs.load(like).cases) == (), like
