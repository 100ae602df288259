"""The hypotheses of one realisation, scan by scan, and their figure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH
from radarsim.language.translate import quote_name, tr
from radarsim.report import case_selection, key_labels, panel_layout
from radarsim.report.drawing.model import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.studies.ambiguous_doppler.kernels import layout, realisations
from radarsim.studies.ambiguous_doppler.study import prepare

LANE = WIDTH - 1  # the realisation of a group whose list is left in memory


@dataclass(frozen=True)
class Fan:
    """The hypotheses of a filter in one realisation: times (K,), true velocities (K,), and a list for each scan.

    A list is (velocity (n,) m/s, acceleration (n,) m/s², probability (n,)), the most probable first."""

    t_s: np.ndarray
    truth: np.ndarray
    lists: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]


def fan(case: Case, filter_index: int, scans: int) -> Fan:
    """The lists of a filter over the first scans, in realisation 7 of the case."""
    single_filter = {"filters": (case.spec.filters[filter_index],), "baseline": None, "rare": None}
    single_spec: Any = case.spec.model_copy(update=single_filter)
    plan = prepare(Case(case.name, case.stem, case.study, single_spec, case.swept_values, case.realisations, case.seed))
    lists = []
    for k in range(1, scans + 1):
        world = plan.world._replace(
            truth=plan.world.truth[:k].copy(), t=plan.world.t[:k].copy(), spans=plan.world.spans[:k].copy()
        )
        plots, out, columns = realisations.simulate_hypotheses(world, plan.banks, 0)
        count = int(out[0, -1, layout.COUNT, LANE])
        list_index = int(plots[:, layout.DETECTED, LANE].sum()) % 2  # each plot moves hypotheses to the other list
        hypotheses = columns.reshape(COLUMNS, -1)[4 * list_index : 4 * list_index + 4, :count]
        weight = np.exp(hypotheses[3] - hypotheses[3].max(initial=-np.inf))
        order = np.argsort(-weight, kind="stable")
        lists.append((hypotheses[1][order], hypotheses[2][order], weight[order] / weight.sum()))
        truth = plots[:, layout.TRUTH + 1, LANE]
    return Fan(plan.world.t[:scans], truth, tuple(lists))


def hypotheses_figure(cases: Sequence[Case]) -> dict[str, Figure]:
    """The hypotheses of one realisation as a fan: a panel for each config, for its last filter that keeps several."""
    fan_panels: list[Panel] = []
    fans: dict[str, Fan] = {}
    stems: list[str] = []
    for case in cases:
        remembering = [i for i, o in enumerate(case.spec.filters) if (o.hypotheses or 1) > 1 and o.combine is None]
        if not remembering or case.stem in stems:
            continue
        stems.append(case.stem)
        if len(fan_panels) < MAX_FANS:
            fans[case.stem] = fan(case, remembering[-1], min(FAN_SCANS, case.spec.scans))
            fan_panels.append(_fan_panel(case, fans[case.stem], remembering[-1]))
    if not fan_panels:
        return {}
    panels_by_title = case_selection.with_distinct_titles(
        [(panel.title, config) for panel, config in zip(fan_panels, fans, strict=True)], fan_panels
    )
    fan_panels = [replace(panel, title=title) for title, panel in panels_by_title.items()]
    counts = [len(velocities) for velocities, _, _ in next(iter(fans.values())).lists]
    caption = tr(
        "Hypotheses on the folds in realisation 7, {name}: {first} after the first scan, {last} after {scans}. Each "
        "line has a hypothesis's velocity and acceleration, the more probable the thicker. Dots: the true velocity.",
        **{
            "first": counts[0],
            "last": counts[-1],
            "scans": len(counts),
            "name": quote_name(key_labels.without_markup(fan_panels[0].title)),
        },
    ) + case_selection.left_out_remark(stems, list(fans))
    columns = min(2, len(fan_panels))
    width = COLUMN_MM if columns == 1 else PAGE_MM
    return {
        "hypotheses": Figure("hypotheses", tr("Pruning of hypotheses"), caption, tuple(fan_panels), columns, width, 70)
    }


MAX_FANS, FAN_SCANS, MAX_FAN_LINES = 4, 8, 40  # panels; scans of a panel; lines of a scan


def _fan_panel(case: Case, hypotheses: Fan, filter_index: int) -> Panel:
    marks: list = []
    dt = case.spec.radar.scan_period_s
    for t, (v, a, p) in zip(hypotheses.t_s, hypotheses.lists, strict=True):
        for velocity, acceleration, weight in zip(v[:MAX_FAN_LINES], a[:MAX_FAN_LINES], p[:MAX_FAN_LINES], strict=True):
            shade = weight / p[0]
            style = Style(0.15 + 0.85 * shade, 0, None, 0.25 + 1.75 * weight)
            marks.append(
                Line(np.array([t, t + 0.92 * dt]), velocity + acceleration * np.array([0, 0.92 * dt]), "", style)
            )
    marks.append(Line(hypotheses.t_s, hypotheses.truth, "", Style(1, None, 0, size_pt=3.5), name=tr("true velocity")))
    names = case.spec.device or case.stem, case.spec.filters[filter_index].name
    title = ", ".join(map(key_labels.escape_dollars, names))
    low, high = hypotheses.truth.min() - FAN_SPANS * case.spec.radar.spans_mps[0], hypotheses.truth.max()
    limits = (low, high + FAN_SPANS * case.spec.radar.spans_mps[0])
    x, y = replace(panel_layout.time_axis(), limits=(None, None)), Axis(tr("radial velocity, m/s"), limits=limits)
    return Panel(x, y, tuple(marks), title, direct=False)


FAN_SPANS = 8  # spans shown to either side of the true velocities
