"""A target in the plane and a radar with range, bearing and radial velocity: what studies of its filters share.

    class Plane(PlanarStudy):                       # besides what `radarsim.studies.step_clutter` needs:
        Filter, kinds = …                           # keys of filters, and their steps
        def tells_folds(self, spec, keys): …        # whether a filter knows the fold of a velocity

Letters: x north, y east, m; a bearing b and a course from north to the east, rad; r range, v radial velocity outwards.
"""

import math
from abc import abstractmethod
from collections import namedtuple
from typing import TYPE_CHECKING, Any

from radarsim.config.planar_keys import FlyBy, Radar, Straight, Turn
from radarsim.kernels.formula_functions import cos, sin, wrap_angle
from radarsim.kernels.polar_plots import errors_covariance, fold, polar, polar_rows, speed_and_course_rows
from radarsim.kernels.tracing import maximum, minimum, sqrt
from radarsim.kernels.uniform_numbers import uniform_pairs
from radarsim.report.quantities import Component
from radarsim.studies.onefile import MeasuredColumn
from radarsim.studies.step_clutter import ClutteredStudy

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from radarsim.config.experiment import Experiment
    from radarsim.engine.results import Axes, CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.floors.bound import Floor

LOST = 10  # standard deviations of a plot: a track that errs by more is lost
MAX_NONLINEARITY = 0.3  # of σ of the speed: its second-order term, which then adds 7 % to the NEES
MIDDLE = math.sqrt(2 * math.log(2)), 0.0  # normals of a course in the middle of its spread

World = namedtuple("World", "sigma rho span density speed range bearing aspect spread turns rate begins lasts")


class PlanarStudy(ClutteredStudy):
    """A study of filters of a target in the plane; the module's docstring lists what a subclass gives."""

    components = (
        Component("r", "m", "$r$", "range"),
        Component("b", "rad", "$\\beta$", "bearing"),
        Component("v", "m/s", "$v$", "speed"),
        Component("course", "rad", "$\\psi$", "course"),
    )
    extra_figures = (*ClutteredStudy.extra_figures, "position", "gain_map*")
    parts = {"radar": Radar, "target": Straight | Turn | FlyBy}  # noqa: RUF012  as of every study in one file
    scan_period = "radar.scan_period_s"
    measured = (
        MeasuredColumn("range_m", "m", ("radar.sigma_range_m",)),
        MeasuredColumn("bearing_rad", "rad", ("radar.sigma_bearing_rad",)),
        MeasuredColumn("velocity_mps", "m/s", ("radar.sigma_velocity_mps",)),
    )
    normals, window, middle = (2, 0, 3), ("range_m", "bearing_rad"), MIDDLE

    def world(self, spec: Any) -> World:
        """The numbers of a case that its truth and plots need."""
        radar, target, density = spec.radar, spec.target, 1e-6 * spec.radar.false_plots_per_km2
        flight = target.speed_mps, target.range_m, target.bearing_rad, target.aspect_rad, target.course_spread_rad
        plots = radar.sigma, radar.range_velocity_correlation, radar.span_mps, density
        return World(*plots, *flight, target.turn[0] != 0, *target.turn)

    def span_mps(self, spec: Any) -> float | None:
        return None if spec.radar.repetition_rate_hz is None else float(spec.radar.span_mps)

    def unfolding(self, spec: Any, span_mps: float) -> "Sequence[str]":
        return (f"radar.repetition_rate_hz={2 * span_mps / spec.radar.wavelength_m:.6g}",)

    def detection(self, spec: Any) -> float:
        return float(spec.radar.detection_probability)

    def begin(self, c: Any, w: Any) -> tuple[Any, ...]:
        """x, y and the course of the first scan."""
        even, _ = uniform_pairs(w)
        heading = c.bearing + c.aspect + c.spread * (2 * even - 1)
        return c.range * cos(c.bearing), c.range * sin(c.bearing), heading

    def move(self, x: Any, dt: Any, c: Any, w: Any, t: Any) -> tuple[Any, ...]:
        if not c.turns:
            return x[0] + dt * c.speed * cos(x[2]), x[1] + dt * c.speed * sin(x[2]), x[2]
        before = minimum(maximum(c.begins - t + dt, 0.0), dt)
        after = minimum(maximum(t - c.begins - c.lasts, 0.0), dt)
        angle = c.rate * (dt - before - after)
        chord, middle, last = 2 * c.speed / c.rate * sin(angle / 2), x[2] + angle / 2, x[2] + angle
        north, east = (c.speed * (before * f(x[2]) + after * f(last)) + chord * f(middle) for f in (cos, sin))
        return x[0] + north, x[1] + east, last

    def plot(self, x: Any, u: Any, c: Any, w: Any) -> tuple[Any, ...]:
        r, b, v = polar((x[0], x[1], c.speed * cos(x[2]), c.speed * sin(x[2])))
        e = c.rho * w[0] + sqrt(1 - c.rho * c.rho) * w[2]
        return r + c.sigma[0] * w[0], wrap_angle(b + c.sigma[1] * w[1]), fold(v + c.sigma[2] * e, c.span)

    def truth(self, x: Any, u: Any, c: Any) -> tuple[Any, ...]:
        return *polar((x[0], x[1], 0.0, 0.0))[:2], c.speed, wrap_angle(x[2])

    def false_plots_from_s(self, spec: Any) -> float | None:
        return spec.radar.false_plots_from_s if spec.radar.false_plots_per_km2 else None

    def edges(self, x: Any, halves: "Sequence[Any]") -> tuple[Any, ...]:
        """Of a window: the bearing of its middle, the squares of its least and greatest range, half its angle."""
        r, b, _ = polar((*x[:2], 0.0, 0.0))
        return b, maximum(r - halves[0], 0.0) ** 2, (r + halves[0]) ** 2, minimum(halves[1], math.pi)

    def expected_false_plots(self, x: Any, halves: "Sequence[Any]", c: Any) -> Any:
        _, near, far, across = self.edges(x, halves)
        return c.density * (far - near) * across

    def false_plot(self, x: Any, halves: "Sequence[Any]", even: "Sequence[Any]", c: Any) -> tuple[Any, ...]:
        b, near, far, across = self.edges(x, halves)  # even in area
        return sqrt(near + (far - near) * even[0]), wrap_angle(b + across * (2 * even[1] - 1)), c.span * (even[2] - 0.5)

    def is_on_target(self, e: Any, u: Any, c: Any) -> Any:
        """Whether a track errs by less than LOST; outside the time of false plots, whose window is empty, always."""
        return (u[0] <= 0.0) | ((abs(e[0]) < LOST * c.sigma[0]) & (abs(e[1]) < LOST * c.sigma[1]))

    def moving_flight(self, spec: Any) -> list[tuple[float, ...]]:
        """The states (x, y, vx, vy) of the scans of a typical flight."""
        c = self.world(spec)
        return [(*x[:2], c.speed * math.cos(x[2]), c.speed * math.sin(x[2])) for x in self.typical_flight(spec)]

    def tested_from(self, spec: Any, filter_keys: Any) -> int:
        """Where speed and course are linear enough in the velocity for their covariance to mean something: the
        second-order term of the speed, v σ² / 2 with σ of the course, is small beside σ of the speed, the other
        components given."""
        import numpy as np

        steps: Any = self.kinds[filter_keys.kind]
        speed, P = self.world(spec).speed, np.zeros((4, 4))
        for k, (s, c) in enumerate(self.typical_states(spec, filter_keys)):
            P[np.triu_indices(4)] = steps.covariance(s, (), c)
            P = np.triu(P) + np.triu(P, 1).T
            if (speed * P[3, 3] / 2) ** 2 * np.linalg.inv(P)[2, 2] < MAX_NONLINEARITY**2:
                return k
        return int(spec.scans)

    def floor(self, spec: Any, axes: "Axes") -> "Floor | None":
        """As `Study.floor`, of straight flights on one course."""
        import numpy as np

        from radarsim.studies.floors.bound import CRB, Floor
        from radarsim.studies.floors.false_plots import information_shares
        from radarsim.studies.floors.straight_flight import straight_flight_bound

        c, m_of_filters = self.world(spec), [len(self.columns(spec, keys)) for keys in spec.filters]
        if c.turns or c.spread or not c.speed:
            return None
        flight = self.moving_flight(spec)
        rows, R = np.array([polar_rows(x) for x in flight]), np.zeros((3, 3))
        R[np.triu_indices(3)] = errors_covariance(c.sigma, c.rho)
        R = R + np.triu(R, 1).T
        maps = np.concatenate([rows[:, :2], [speed_and_course_rows(x) for x in flight]], axis=1)
        detection, bounds = self.detection(spec), {}
        # Of false plots per m, rad and m/s, from when they begin.
        density = c.density * np.array([polar(x)[0] for x in flight]) * (axes.t_s >= spec.radar.false_plots_from_s)
        for m in (2, 3):
            errors = R[:m, :m]
            per_unit = density * np.sqrt(np.linalg.det(errors)) / (c.span if m == 3 else 1.0)
            shares = information_shares(detection, per_unit, m) if c.density else None
            bounds[m] = straight_flight_bound(axes.t_s, rows[:, :m], errors, maps, detection, shares)
        return Floor(CRB, tuple(bounds[m] for m in m_of_filters), bounds[3])

    @abstractmethod
    def tells_folds(self, spec: Any, keys: Any) -> bool:
        """Whether a filter ever knows the fold of a velocity, or uses none."""

    def _sentences(self, result: "CaseResult", tables_by_name: "Mapping[str, pd.DataFrame]") -> "Iterator[Sentence]":
        """As of every study; then the filters whose velocities never count."""
        from radarsim.studies.planar_tables import unused_velocity_sentences

        yield from super()._sentences(result, tables_by_name)
        yield from unused_velocity_sentences(self, result)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.report import tables
        from radarsim.studies.planar_tables import position_columns

        position = tables.join_columns([position_columns(self, result) for result in results])
        return {**super().tables(results), "position": position}

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.report.gain_maps import gain_map_figures
        from radarsim.studies.planar_tables import position_figure

        position = position_figure(results, tables["position"], experiment)
        maps = gain_map_figures(results, tables["gains"], self.user_filter_components())
        return {**super().figures(results, tables, experiment), "position": position, **maps}

    def answer(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]"
    ) -> "Sequence[str | Sentence]":
        from radarsim.report.gain_maps import gain_map_sentences

        maps = gain_map_sentences(results, tables["gains"], self.user_filter_components())
        return [*super().answer(results, tables), *maps]
