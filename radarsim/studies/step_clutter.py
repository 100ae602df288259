"""A step study among false plots.

False plots are drawn in a window about the target's plot: wide enough for the gates of all filters that follow it, so
that their tracks see the plots that they would see of a field without bounds.

    class Plane(ClutteredStudy):                    # besides what `radarsim.studies.stepwise` needs
        window = ("range_m", "bearing_rad")         # the measured numbers in which the window has bounds
        middle = (…)                                # the normals of the first state of a typical flight

        def false_plots_from_s(self, spec): …       # from which time on there are false plots, s; None: never
        def expected_false_plots(self, x, halves, c): …  # their mean number, of half the widths `halves` about x
        def false_plot(self, x, halves, even, c): … # one, of numbers `even` from 0 to 1, as many as are measured

    class Tracking(Steps):
        def gate(s, u, c): …                        # half the widths of the gate of a state before a plot

In the first state of its track a filter is given the target's plot."""

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from radarsim.errors import ConfigError
from radarsim.language.translate import join_names, quote_name, tr
from radarsim.studies.step_checks import record
from radarsim.studies.stepwise import StepStudy

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence

MARGIN = 2.0  # widths of the window in those of the widest gate
RARE = 0.0099  # probability of a run of missed plots after which gates may be wider
MAX_PLACES, CUT = 500, 1e-6  # places for false plots of a scan; the probability of more


class ClutteredStudy(StepStudy):
    """A step study among false plots; the module's docstring lists what a subclass gives."""

    window: tuple[str, ...]
    middle: tuple[float, ...]

    def false_plots_from_s(self, spec: Any) -> float | None:
        """From which time on there are false plots, s. Default: None, there are none."""
        return None

    @property
    def false_quantities(self) -> int:  # type: ignore[override]
        return len(self.window)

    def known_quantities(self, spec: Any, t_s: "np.ndarray") -> "Sequence[np.ndarray]":
        import numpy as np

        is_clear = self.false_plots_from_s(spec) is None
        return list(np.zeros((len(self.window), t_s.size)) if is_clear else self.halves(spec))

    def false_places(self, spec: Any) -> int:
        import numpy as np
        from scipy.special import pdtrik

        if self.false_plots_from_s(spec) is None:
            return 0
        c = record(self.world, spec)
        flight, halves = self.typical_flight(spec), np.transpose(self.halves(spec))
        expected = max(float(self.expected_false_plots(x, half, c)) for x, half in zip(flight, halves, strict=True))
        places = max(1, math.ceil(pdtrik(1 - CUT, expected))) if expected <= MAX_PLACES else math.inf
        if places > MAX_PLACES:
            raise ConfigError(
                f"study {self.name}: some {expected:.3g} false plots in and about the widest gate, of which "
                f"{MAX_PLACES} are drawn: give a smaller density, or let them begin when tracks are accurate"
            )
        return int(places)

    def typical_flight(self, spec: Any) -> list[Any]:
        """The true states of the scans without noise."""
        from radarsim.studies.step_programs import moves_by_time

        c, dt, no_noise = record(self.world, spec), self.scan_period_s(spec), (0.0,) * self.normals[1]
        states = [self.begin(c, self.middle)]
        for k in range(1, spec.scans):
            times = (k * dt,) if moves_by_time(self) else ()
            states.append(self.move(states[-1], dt, c, no_noise, *times))
        return states

    def typical_states(self, spec: Any, filter_keys: Any) -> "Iterator[tuple[Any, Any]]":
        """A filter's states at the scans of a typical flight, by plots without errors, each with its numbers."""
        steps, dt, c = self.kinds[filter_keys.kind], self.scan_period_s(spec), record(self.world, spec)
        numbers, in_clutter = record(steps.design, spec, filter_keys), self.false_plots_from_s(spec) is not None
        s = None
        for x in self.typical_flight(spec):
            z = self.plot(x, (), c, (0.0,) * self.normals[2])
            if s is None:
                s = steps.start(z, (), numbers)
            else:
                s = steps.update(steps.predict(s, dt, (), numbers), ((1.0, z),) if in_clutter else z, (), numbers)
            yield s, numbers

    @functools.lru_cache(maxsize=16)  # noqa: B019  there is one object of the class
    def halves(self, spec: Any) -> "np.ndarray":
        """Half the widths (W, K) of the window, zero while there are no false plots."""
        import numpy as np

        from radarsim.studies.step_plan import plot_probability

        halves, dt, c = np.zeros((len(self.window), spec.scans)), self.scan_period_s(spec), record(self.world, spec)
        u, no_noise, missed = (), (0.0,) * self.normals[2], 1 - plot_probability(self, spec)
        most_missed = math.floor(math.log(RARE) / math.log(missed)) if missed > 0 else 0
        for keys in spec.filters:
            steps, numbers = self.kinds[keys.kind], record(self.kinds[keys.kind].design, spec, keys)
            flight = [self.plot(x, u, c, no_noise) for x in self.typical_flight(spec)]
            states = [steps.start(flight[0], u, numbers)]  # after none, one, two … missed plots
            for k, z in enumerate(flight[1:], 1):
                states = [steps.predict(s, dt, u, numbers) for s in states]
                gates = np.array([steps.gate(s, u, numbers) for s in states])
                halves[:, k] = np.maximum(halves[:, k], MARGIN * gates.max(axis=0))
                after_missed = [steps.update(s, (), u, numbers) for s in states[:most_missed]]
                states = [steps.update(states[0], ((1.0, z),), u, numbers), *after_missed]
        halves[:, dt * np.arange(spec.scans) < (self.false_plots_from_s(spec) or 0.0)] = 0.0
        return halves

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.report import case_selection, figure_lines, panel_layout
        from radarsim.report import tables as common
        from radarsim.report.drawing.model import Axis, Figure, Panel

        figures = super().figures(results, tables, experiment)
        if "tracks" not in tables:
            return figures
        names = case_selection.cases_for_figure(experiment, "tracks")
        visible, remark = case_selection.select_cases_by_panel(results, names)
        rows = common.group_by(tables["tracks"].assign(component=""), "case", "filter", "component")
        filters, panels = figure_lines.all_filters(visible), []
        for title, members in case_selection.group_by_panel(visible).items():
            columns = "t_s", "kept_share", "kept_share_lo", "kept_share_hi"
            marks = tuple(figure_lines.case_lines(members, rows, "", columns, filters))
            panel = Panel(panel_layout.time_axis(), Axis(tr("share of tracks kept")), marks, title)
            panels += panel_layout.keyed_panels(panel, members, filters)
        caption = tr(
            "Share of tracks that are still the target's, from {realisations}.",
            realisations=case_selection.realisations_text(visible),
        )
        figure = Figure("tracks", tr("Tracks kept among false plots"), caption + remark, tuple(panels))
        return {**figures, "tracks": panel_layout.arrange_columns(figure)}

    def _sentences(self, result: "CaseResult", tables_by_name: "Mapping[str, pd.DataFrame]") -> "Iterator[Sentence]":
        """How many tracks are kept, then σ and gain of these."""
        from radarsim.report import case_selection, sentences, tables, wording

        if "tracks" in tables_by_name:
            rows = tables.select_rows(tables_by_name["tracks"], case=result.name)
            rows = rows[rows["k"] == rows["k"].max()] if len(rows) else rows
            ends = ("kept_share", "kept_share_lo", "kept_share_hi")
            texts = [
                f"{quote_name(row['filter'])} {wording.share(*(100 * float(row[end]) for end in ends))}"
                for _, row in rows.iterrows()
            ]
            if texts:
                text = tr(
                    "Tracks kept for {t:g} s: {filters}; the RMS errors of each filter are of its own.",
                    t=float(result.axes.t_s[-1]),
                    filters=join_names(texts),
                )
                intervals = sentences.intervals("tracks", "kept_share", rows)
                yield sentences.Sentence(case_selection.after_swept_values(result, text), intervals)
        yield from super()._sentences(result, tables_by_name)

    def _gains_text(self, result: "CaseResult", base: str, gains: str) -> str:
        if "both" not in result.sums:
            return super()._gains_text(result, base, gains)
        return tr(
            "Gain over {base} at {t:g} s, of the tracks that both keep: {filters}.",
            base=base,
            filters=gains,
            t=float(result.axes.t_s[-1]),
        )
