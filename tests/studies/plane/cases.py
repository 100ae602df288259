"""Configs of the plane, and what a run makes of single realisations."""

import numpy as np

from radarsim.api.configs import load
from radarsim.studies.registry import study
from radarsim.studies.step_plots import draw_plots

RADAR = {
    "wavelength_m": 0.1,
    "sigma_range_m": 50.0,
    "sigma_bearing_rad": 5e-3,
    "sigma_velocity_mps": 2.0,
    "scan_period_s": 5.0,
    "detection_probability": 0.8,
    "range_velocity_correlation": -0.6,
}
TURN = {
    "kind": "turn",
    "range_m": 60e3,
    "speed_mps": 250.0,
    "aspect_rad": 2.5,
    "bearing_rad": 1.0,
    "start_s": 20.0,
    "acceleration_g": 2.0,
    "duration_s": 25.0,
}
STRAIGHT = {"kind": "straight", "range_m": 60e3, "speed_mps": 250.0, "aspect_rad": 2.5, "bearing_rad": -2.0}
NOISE = {
    "velocity": {"sigma_acceleration_mps2": 2.0},
    "acceleration": {"sigma_jerk_mps3": 1.0},
    "turn": {"sigma_acceleration_mps2": 1.0, "sigma_turn_rate_radps": 0.02},
}


def member(kind, model="velocity", doppler=True, **more):
    """Keys of a filter; its name tells them."""
    name = " ".join([kind, model, "Vr" if doppler else "r", *map(str, more.values())])
    quiet = {"quiet_sigma_acceleration_mps2": 0.1} if kind == "imm" else {}
    return {"name": name, "kind": kind, "model": model, "doppler": doppler, **NOISE[model], **quiet, **more}


def case_of(filters, target=TURN, scans=14, seed=1, **radar):
    keys = {"study": "plane", "radar": RADAR | radar, "target": target, "filters": filters, "scans": scans}
    return load(keys | {"realisations": 100, "seed": seed}).cases[0]


def plots_of(case, n, first=0):
    """Times (K,), the target's plots (n, K, 3), not-a-number where missed, the truth (n, K, 4), the false plots
    (n, K, M, 3), not-a-number where there are fewer."""
    plan = study("plane").prepare(case)
    rows, scans = plan.scene.plot_rows, plan.axes.k.size
    values = draw_plots(plan, first, -(-n // 8)).reshape(-1, scans, rows, 8).transpose(0, 3, 1, 2)
    values = values.reshape(-1, scans, rows)[:n]
    z, truth, false = values[..., 1:4], values[..., 4:8], values[..., 8:].reshape(*values.shape[:2], -1, 4)
    z = np.where(values[..., :1] > 0.5, z, np.nan)
    return plan.axes.t_s, z, truth, np.where(false[..., :1] > 0.5, false[..., 1:], np.nan)


def run_of(case, i):
    """The sums of realisation i alone: its errors, believed variances, NEES, and what is counted."""
    plan = study("plane").prepare(case)
    return plan.layout.unpack(study("plane").simulate(plan, i, 1))
