"""Motion in the plane for floats, arrays and lanes: constant velocity, acceleration, or rate of turn.

A state begins with x north, y east, and their rates; then the two accelerations, or the rate of turn from north to the
east, rad/s. BLK: Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001."""

from collections.abc import Sequence
from typing import Any

from radarsim.kernels.formula_functions import cos, sin
from radarsim.kernels.gaussian_filters import State
from radarsim.kernels.packed_matrices import add
from radarsim.kernels.small_matrices import congruence, dot
from radarsim.kernels.tracing import where

SIZES = {"velocity": 4, "acceleration": 6, "turn": 5}  # numbers of a state by what is constant
SLOW_TURN = 1e-2  # rad in a scan: below, series to 2·10⁻¹⁶ stand for quotients by the rate of turn, good to 5·10⁻¹²


def predict(state: State, model: str, noise: tuple[Any, Any], dt: Any) -> State:
    """A state dt seconds later; noise as in `process_noise`. The model `velocity` takes states of the others too."""
    moved, rows = move(model, state[0], dt)
    return moved, add(congruence(rows, state[1]), process_noise(model, len(moved), noise, dt))


def move(model: str, x: Sequence[Any], dt: Any) -> tuple[tuple[Any, ...], tuple[tuple[Any, ...], ...]]:
    """A state dt seconds later if what the model says stays constant, and its derivatives, rows (n, n)."""
    if model == "turn":
        return turn(x, dt)
    n, used = len(x), 4 if model == "velocity" else len(x)
    rows = [[1.0 if i == j < used else 0.0 for j in range(n)] for i in range(n)]
    for i in range(used - 2):
        rows[i][i + 2] = dt
    for i in range(used - 4):
        rows[i][i + 4] = 0.5 * dt * dt
    return tuple(dot(row, x) for row in rows), tuple(map(tuple, rows))


def turn(x: Sequence[Any], dt: Any) -> tuple[tuple[Any, ...], tuple[tuple[Any, ...], ...]]:
    """As `move` at a constant rate of turn, BLK 11.7.1."""
    _, _, vx, vy, w = x
    angle = w * dt
    s, o, slow = sin(angle), cos(angle), abs(angle) < SLOW_TURN
    rate = where(slow, 1.0, w)
    u, square = angle * angle, dt * dt
    along = where(slow, dt * (1.0 - u / 6 + u * u / 120), s / rate)
    across = where(slow, dt * angle * (0.5 - u / 24 + u * u / 720), (1.0 - o) / rate)
    by_rate = where(slow, -square * angle * (1 / 3 - u / 30 + u * u / 840), (dt * o - along) / rate)
    across_by_rate = where(slow, square * (0.5 - u / 8 + u * u / 144), (dt * s - across) / rate)
    moved = x[0] + along * vx - across * vy, x[1] + across * vx + along * vy, o * vx - s * vy, s * vx + o * vy, w
    return moved, (
        (1.0, 0.0, along, -across, by_rate * vx - across_by_rate * vy),
        (0.0, 1.0, across, along, across_by_rate * vx + by_rate * vy),
        (0.0, 0.0, o, -s, -dt * moved[3]),
        (0.0, 0.0, s, o, dt * moved[2]),
        (0.0, 0.0, 0.0, 0.0, 1.0),
    )


def process_noise(model: str, n: int, noise: tuple[Any, Any], dt: Any) -> tuple[Any, ...]:
    """The packed covariance (n) that a derivative adds over dt seconds in which it is constant: acceleration, m/s², or
    of the model `acceleration` jerk, m/s³, of the standard deviation noise[0]; and a step of the rate of turn, rad/s,
    of noise[1]. BLK 6.3.2, 6.3.3, 11.7.1."""
    g = (dt * dt * dt / 6, 0.5 * dt * dt, dt) if model == "acceleration" else (0.5 * dt * dt, dt)
    variance, used = noise[0] * noise[0], 2 * len(g)

    def element(i: int, j: int) -> Any:
        if model == "turn" and i == j == 4:
            return noise[1] * noise[1]
        return variance * g[i // 2] * g[j // 2] if i % 2 == j % 2 and max(i, j) < used else 0.0

    return tuple(element(i, j) for i in range(n) for j in range(i, n))
