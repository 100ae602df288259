"""Exact probabilities of alarms in a case, over the patterns of missed plots."""

import numpy as np

from radarsim.studies.sonar import filter_design
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.detector_keys import Detector
from radarsim.studies.sonar.manoeuvre import detection_laws
from radarsim.studies.sonar.manoeuvre.responses import thresholds
from radarsim.studies.sonar.plot_errors import error_covariance
from radarsim.studies.sonar.scene import Scene


def shift_laws(scene: Scene, c: int, detected: np.ndarray, plots: int, k: int) -> tuple[np.ndarray, ...]:
    """Mean, true and believed variance (M,) of the acceleration â of a parabola through the last plots at scan k."""
    first, weights, believed = filter_design.window_weights(scene.plots(c, detected), k, plots, 3)
    t, sigma = scene.t[first : k + 1], scene.sigma[first : k + 1, c]
    C = error_covariance(np.where(np.isfinite(sigma), sigma, 0.0), scene.rho[c], t, scene.period)
    steps = np.diff(t)
    after = np.maximum(t[:, None] - t[1:], 0.0)  # since the end of the interval; a push within it moves by dt²/2
    pushes = np.where(t[:, None] >= t[1:], steps**2 / 2 + steps * after, 0.0) * scene.walk[c]
    mean, variance = detection_laws.acceleration_law(weights[:, 2], scene.truth[first : k + 1, c, 0], C, pushes)
    return mean, variance, believed[:, 2, 2]


def exact_alarms(spec: Keys, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Probability (D, G, T, K) of an alarm at a test, and shift (D, G, K) of its mean; NaN where not known.

    Both are means over the patterns of plots in which there is a test. In the cartesian frames weights depend on the
    plots, and no law is known."""
    K, C = scene.truth.shape[:2]
    max_thresholds = max((len(detector.levels()) for detector in spec.detectors), default=0)
    alarms = np.full((len(spec.detectors), C + 1, max_thresholds, K), np.nan)
    shifts = np.full((len(spec.detectors), C + 1, K), np.nan)
    if spec.frame != "polar":
        return alarms, shifts
    detected, probability = scene.patterns()
    for d, detector in enumerate(spec.detectors):
        limits = thresholds(detector, C)
        for k in range(detector.plots - 1, detected.shape[1], detector.test_every):
            tested = (detected[:, k] > 0) & (detected[:, : k + 1].sum(axis=1) >= detector.plots)
            share = probability[tested]
            if share.sum() > 0:
                laws = [shift_laws(scene, c, detected[tested], detector.plots, k) for c in range(C)]
                law = _alarm_law(np.array(laws), limits, share / share.sum())
                alarms[d, :, : limits.shape[1], k], shifts[d, :, k] = law
    return alarms, shifts


def _alarm_law(laws: np.ndarray, limits: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Probability (G, T) of an alarm and shift (G,), means with weight (M,) over laws (C, 3, M) as in `shift_laws`."""
    C = len(laws)
    mean, true, believed = laws[:, 0], laws[:, 1], laws[:, 2]
    ratio, shift = believed / true, mean / np.sqrt(true)
    alarms, shifts = np.full(limits.shape, np.nan), np.empty(C + 1)
    for c in range(C):
        alarms[c] = detection_laws.detection(limits[c][:, None] * ratio[c], shift[c]) @ weight
        shifts[c] = np.abs(shift[c]) @ weight
    joint_shift = np.sqrt((shift**2).sum(axis=0))
    shifts[C] = joint_shift @ weight
    if np.allclose(ratio, ratio[0], rtol=1e-9):
        alarms[C] = detection_laws.detection(limits[C][:, None] * ratio[0], joint_shift, C) @ weight
    return alarms, shifts


def independent(detector: Detector, scene: Scene) -> bool:
    """Whether the tests of a detector are independent: windows do not overlap, errors are white, no random motion."""
    are_apart, certain = detector.test_every >= detector.plots, (scene.certain > 0).all()
    return bool(are_apart and certain and not scene.rho.any() and not scene.walk.any())
