"""What a velocity that folds is worth in the plane: a rare wrong fold must not outweigh the gain."""

import radarsim

COAST = {
    "wavelength_m": 0.032,
    "sigma_range_m": 15.0,
    "sigma_bearing_deg": 0.4,
    "sigma_velocity_mps": 0.8,
    "scan_period_s": 2.5,
    "detection_probability": 0.85,
    "repetition_rate_hz": 1200.0,  # velocity folds into 19.2 m/s
}
BOAT = {"kind": "straight", "range_m": 20e3, "speed_mps": 20.0, "aspect_deg": 180.0}


def test_folded_velocities_of_a_coast_radar_gain_in_range():
    """A fold taken at ±3 σ of the predicted velocity is wrong in one of these realisations, and the gain −305 %."""
    quiet = {"kind": "extended", "sigma_acceleration_mps2": 0.1}
    filters = [quiet | {"name": "r", "doppler": False}, quiet | {"name": "r+Vr", "doppler": True}]
    keys = {"study": "plane", "radar": COAST, "target": BOAT, "filters": filters, "scans": 40}
    gains = radarsim.run(keys | {"realisations": 200, "seed": 3}).tables["gains"]
    last = gains[(gains["component"] == "r") & (gains["k"] == gains["k"].max())].iloc[0]
    assert 0 < last["gain_lo"] < last["gain_percent"]
