"""True values, estimates and sums of errors of the quantities derived from a track."""

import math

import numpy as np

from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.manoeuvre import track_uses
from radarsim.studies.sonar.manoeuvre.axes import UsesAxes
from radarsim.studies.sonar.scene import Scene, courses
from radarsim.studies.sonar.use_keys import Uses


def own_ship(uses: Uses, t: np.ndarray) -> np.ndarray:
    """The own ship's x, y and rates (n, 4) at times t."""
    ship = uses.own_ship
    rate = ship.speed_mps * np.array([math.cos(ship.course_rad), math.sin(ship.course_rad)])
    return np.concatenate([np.array([ship.x_m, ship.y_m]) + t[:, None] * rate, np.tile(rate, (len(t), 1))], axis=1)


def uses_axes(uses: Uses, spec: Keys, scene: Scene, use_scans: np.ndarray) -> UsesAxes:
    """True values at use_scans (A,): the closest approach at constant courses, the target's future position."""
    t = scene.t[use_scans]
    track, ship_states = (
        track_uses.cartesian_track(scene.truth[use_scans, :2, :2], spec.frame == "polar"),
        own_ship(uses, t),
    )
    true = track_uses.uses(track, ship_states, uses.horizon_s)
    _, later = courses(spec.target, t + uses.horizon_s, None)
    true[:, 2:4] = later[:, :2, 0]
    relative = track - ship_states
    return UsesAxes(scans=use_scans, true=true, closing_mps=np.hypot(relative[:, 2], relative[:, 3]))


def estimated_uses(
    uses: Uses, frame: str, t: np.ndarray, x: np.ndarray, P: np.ndarray, is_known: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Uses of tracks and their first-order σ (F, n, 6), NaN where a state is not complete.

    t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and is_known (F, n, C, 3), of which the first two
    coordinates are used."""
    state, polar, ship_states = x[:, :, :2, :2], frame == "polar", own_ship(uses, t)
    spread = np.stack([P[:, :, :2, 0, 0], P[:, :, :2, 0, 1], P[:, :, :2, 1, 1]], axis=-1)
    complete = np.all(is_known[:, :, :2, :2], axis=(2, 3), keepdims=True)[..., 0]
    values = track_uses.uses(track_uses.cartesian_track(state, polar), ship_states, uses.horizon_s)
    variance = track_uses.variances(state, spread, polar, ship_states, uses.horizon_s)
    return np.where(complete, values, np.nan), np.where(complete, np.sqrt(variance), np.nan)


def use_sums(uses: Uses, frame: str, labels: UsesAxes, t: np.ndarray, estimates_of_scans: np.ndarray) -> np.ndarray:
    """Sums (F, A, 6, 5) over the complete states of estimates_of_scans (A, F, 2, 6, count) at times t (A,)."""
    polar, ship_states = frame == "polar", own_ship(uses, t)
    A, F = estimates_of_scans.shape[:2]
    sums = np.zeros((F, A, len(track_uses.QUANTITIES), 5))
    for a, f in np.ndindex(A, F):
        complete = (estimates_of_scans[a, f, :, 5] > 0).all(axis=0)
        estimates = np.moveaxis(estimates_of_scans[a, f][:, :, complete], -1, 0)
        values = track_uses.uses(track_uses.cartesian_track(estimates[..., :2], polar), ship_states[a], uses.horizon_s)
        e = track_uses.errors(values, labels.true[a])
        spread = track_uses.variances(estimates[..., :2], estimates[..., 2:5], polar, ship_states[a], uses.horizon_s)
        sums[f, a] = np.stack([part.sum(axis=0) for part in (np.ones_like(e), e, e**2, e**4, spread)], axis=-1)
    return sums
