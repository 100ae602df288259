"""A target's course from a file of positions, smoothed and seen from the radar."""

import csv

import numpy as np

COLUMNS = ("t_s", "x_m", "y_m", "z_m")
MIN_POINTS = 5  # that a smoothing spline takes
MAX_FAULTS = 20


class CourseError(ValueError):
    """A file that is no recorded flight; `faults` name the file and the line of each."""

    def __init__(self, *faults: str):
        super().__init__("\n".join(faults))
        self.faults = faults


def read_points(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) in s and positions (n, 3) in m of a CSV file t_s,x_m,y_m,z_m; raises Unreadable, line by line."""
    with open(path, newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        header = next(reader, [])
        if missing := [name for name in COLUMNS if name not in header]:
            raise CourseError(f"{path}:1: no column {', '.join(missing)}; needed: {', '.join(COLUMNS)}")
        indices = [header.index(name) for name in COLUMNS]
        rows: list[list[float]] = []
        faults: list[str] = []
        for line in reader:
            try:
                row = [float(line[i]) for i in indices]
            except (ValueError, IndexError):
                faults.append(f"{path}:{reader.line_num}: must be four numbers, got {','.join(line)[:60]!r}")
                continue
            if not np.isfinite(row).all():
                faults.append(f"{path}:{reader.line_num}: must be finite, got {','.join(line)[:60]!r}")
            elif rows and row[0] <= rows[-1][0]:
                faults.append(f"{path}:{reader.line_num}: t_s must increase, got {row[0]:g} after {rows[-1][0]:g}")
            else:
                rows.append(row)
    if not faults and len(rows) < MIN_POINTS:
        faults.append(f"{path}: needs at least {MIN_POINTS} points, got {len(rows)}")
    if faults:
        raise CourseError(*faults[:MAX_FAULTS])
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def smooth_course(times: np.ndarray, positions: np.ndarray, t: np.ndarray) -> np.ndarray:
    """States (K, 9) as (x, vx, ax, y, vy, ay, z, vz, az) at times t (K,) from the first point of a recorded flight.

    times (n,) are at least 5 and increase, positions (n, 3). A cubic smoothing spline for each axis, its strength
    chosen by generalised cross-validation; its derivatives are taken as the true velocity and acceleration."""
    from scipy.interpolate import make_smoothing_spline

    elapsed = times - times[0]
    track = np.empty((len(t), 9))
    for axis in range(3):
        spline = make_smoothing_spline(elapsed, positions[:, axis])
        for order in range(3):
            track[:, 3 * axis + order] = spline.derivative(order)(t) if order else spline(t)
    return track


def radial_motion(states: np.ndarray) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3), as seen from the origin, of states (K, 9) as above. V = x·v / r,
    and a = (|v|² + x·a − V²) / r."""
    x, v, a = states[:, 0::3], states[:, 1::3], states[:, 2::3]
    r = np.sqrt((x**2).sum(axis=1))
    radial_velocity = (x * v).sum(axis=1) / r
    radial_acceleration = ((v**2).sum(axis=1) + (x * a).sum(axis=1) - radial_velocity**2) / r
    return np.stack([r, radial_velocity, radial_acceleration], axis=1)
