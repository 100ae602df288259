"""A target that reaches the sensor, or passes behind it, is refused in every study that has ranges."""

import pytest

import radarsim
from radarsim.errors import ConfigError

THROUGH = "target={kind: polynomial, frame: polar, range_m: [200, -20], bearing_rad: [0.1]}"
ACROSS = "target={kind: polynomial, frame: cartesian, x_m: [200, -20], y_m: [0]}"
STRAIGHT_IN = "kind: turn, range_m: 5e3, speed_mps: 250, aspect_deg: 180"
OVER = f"target={{{STRAIGHT_IN}, start_s: 500, duration_s: 1, acceleration_g: 1}}"
AWAY = "target={kind: polynomial, frame: polar, range_m: [200, 20], bearing_rad: [0.1]}"
COURSE = (
    "target={kind: accelerating, x_m: 250, y_m: 0, speed_mps: 10, course_deg: 180, acceleration_mps2: 0, start_s: 5}"
)
RANGE, NEAR = r"target: its range must stay > 0, is", r"target: its range must stay > 0.001 m, is"

REFUSED = [
    ("rls2", ["target={kind: polynomial, coefficients: [10e3, -250]}"], rf"{RANGE} 0 m at 40 s, scan 5 of 15"),
    ("rls2", ["target={kind: polynomial, coefficients: [100, -250]}"], rf"{RANGE} -2400 m at 10 s, scan 2 of 15"),
    ("rls2", [OVER], "over the radar"),
    ("ambiguous_rls4", ["target={kind: polynomial, coefficients: [10e3, -250]}"], rf"{RANGE} 0 m at 40 s, scan 5 of"),
    ("sonar_smoothing", [THROUGH], rf"{NEAR} \S+ m at 10 s, plot 3 of"),
    ("sonar_smoothing", [ACROSS], rf"{NEAR} \S+ m at 10 s, plot 3 of"),
    ("sonar_conversion", [ACROSS], rf"{NEAR} \S+ m at 10 s, plot 3 of"),
    ("sonar_missed", [THROUGH], rf"{NEAR} \S+ m at 10 s, plot 3 of"),
    ("sonar_clutter", [THROUGH, "sweep.sensor.false_plots_per_km2=[1]"], rf"{NEAR} \S+ m at 10 s, plot 3 of"),
    ("sonar_manoeuvre", [COURSE, "sweep.target.acceleration_mps2=[0]"], rf"{NEAR} \S+ m at 25 s, plot 6 of"),
    ("multimodel", ["sensor.antenna_azimuth_rad=3"], "target: leaves the antenna's sector at 0 s"),
]


@pytest.mark.parametrize(("config", "overrides", "words"), REFUSED)
def test_a_target_at_the_sensor_or_behind_it_is_refused(config, overrides, words):
    with pytest.raises(ConfigError, match=words):
        radarsim.run(config, realisations=200, overrides=overrides)


def test_a_target_that_goes_away_is_none():
    result = radarsim.run("sonar_smoothing", realisations=200, overrides=[AWAY])
    assert result.curves["sigma"].notna().all()
