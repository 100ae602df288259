"""What Doppler gains for any radar, over time and in the long run: figures, table and sentences of `radarsim chart`."""

import json
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.translate import term, tr
from radarsim.report import render_page, tables
from radarsim.report.drawing.model import Chart
from radarsim.report.wording import list_numbers, significant_digits
from radarsim.studies.range_doppler import closed_form
from radarsim.studies.range_doppler.doppler_gain_figures import (
    gain_against_time_figure,
    gain_map_figure,
    steady_gain_figure,
)
from radarsim.studies.range_doppler.radar_on_chart import RadarOnChart, corrected_gains, place_case
from radarsim.studies.range_doppler.study import COMPONENTS

if TYPE_CHECKING:
    import pandas as pd


def chart(cases: Sequence[Case], references: Sequence[Case]) -> Chart:
    """The figures, the table, a sentence for each case, and the live page; references are marked as well."""
    reference_places = [place for case in references if (place := place_case(case)) is not None]
    reference_inputs = {place.name: place.inputs for place in reference_places}
    placed_cases = [(case, place_case(case)) for case in cases]
    for i, (case, place) in enumerate(placed_cases):
        if place is not None and reference_inputs.get(place.name, place.inputs) != place.inputs:  # a reference, edited
            placed_cases[i] = case, replace(place, name=tr("{name}, as set", name=place.name))
    user_places = [place for _, place in placed_cases if place is not None]
    reference_places = [
        place for place in reference_places if all(place.groups != user_place.groups for user_place in user_places)
    ]
    figures = [
        gain_against_time_figure(user_places or reference_places),
        steady_gain_figure(user_places, reference_places),
        gain_map_figure(user_places, reference_places),
    ]
    absence = tr("not on the chart: it needs one filter of range and one of range and velocity")
    sentences = [
        f"{case.name}: {absence}"
        if place is None
        else sentence(place) + accuracy_warning(place) + left_out_sentence(case)
        for case, place in placed_cases
    ]
    sentences = sentences or [sentence(place) for place in reference_places]
    return Chart(
        {figure.name: figure for figure in figures},
        table([*user_places, *reference_places]),
        tuple(sentences),
        page(user_places, reference_places),
    )


def sentence(place: RadarOnChart) -> str:
    """The position of a radar on the chart, and its gains from Doppler in the long run."""
    r, V, a = (round(float(gain), 1) for gain in place.exact_gain)
    changes_alike = (r >= 0) == (V >= 0)
    return tr(
        "{name}: in the long run Doppler {range} and {velocity}; {acceleration}. "
        "At its last scan, {t_s:g} s: {gains} %.",
        name=place.name,
        range=_change(r, "reduces the range error by {size} %", "raises the range error by {size} %"),
        velocity=tr("the velocity error by {size} %", size=_size(V))
        if changes_alike
        else _change(V, "reduces the velocity error by {size} %", "raises the velocity error by {size} %"),
        acceleration=_change(a, "the acceleration error falls by {size} %", "the acceleration error rises by {size} %"),
        t_s=float(place.t_s[-1]),
        gains=list_numbers(significant_digits(float(g), ".3g") for g in place.gain[-1]),
    )


def _change(gain: float, lower: str, higher: str) -> str:
    """What a gain, %, does to an error; both messages are among PAGE_TERMS."""
    return tr(lower if gain >= 0 else higher, size=_size(gain))


def _size(gain: float) -> str:
    return significant_digits(abs(gain), ".4g")


def accuracy_warning(place: RadarOnChart) -> str:
    """The warning that the closed form may be inaccurate for a radar, as a further sentence; empty where it is not."""
    if place.groups.c <= closed_form.MAX_C:
        return ""
    distance = float(np.abs(place.exact_gain - corrected_gains(place)).max())
    clause = tr("here it is {away} points off", away=significant_digits(distance, ".2g"))
    return tr(
        " Beyond c = 50 000 the closed form may be inaccurate even with the correction for the period: "
        "{how}; the gains above are exact.",
        how=clause if np.isfinite(distance) else tr("here it has no value"),
    )


def left_out_sentence(case: Case) -> str:
    """What the chart leaves out of a case, as a further sentence; empty where it leaves out nothing."""
    omissions = [] if case.spec.radar.as_the_papers else [tr("missed plots and biases")]
    omissions += [] if case.spec.target.kind == "polynomial" else [tr("the target's manoeuvre")]
    has_usual_noise = {getattr(filter_keys, "process_noise", "random_jerk") for filter_keys in case.spec.filters} == {
        "random_jerk"
    }
    omissions += [] if has_usual_noise else [tr("another process noise")]
    return tr(" Not included in the long-run values: {what}.", what=", ".join(omissions)) if omissions else ""


def table(places: Sequence[RadarOnChart]) -> "pd.DataFrame":
    """chart.csv: of each case and component the steady gain, exact and in closed form, and what it depends on."""
    names = [name for name, _ in COMPONENTS]
    count = len(names)
    with_period = [corrected_gains(place) for place in places]
    columns: dict[str, Any] = {
        "case": np.repeat(np.array([p.name for p in places], dtype=object), count),
        "component": names * len(places),
    }
    columns |= {"tau_1_s": np.repeat([p.tau_1_s for p in places], count)}
    columns |= {"tau_2_s": np.repeat([p.tau_2_s for p in places], count)}
    columns |= dict(
        zip(closed_form.Groups._fields, np.repeat([p.groups for p in places], count, axis=0).T, strict=True)
    )
    return tables.frame(
        columns
        | {
            "steady_gain_percent": np.concatenate([p.exact_gain for p in places]),
            "limit_percent": np.concatenate([p.limit_gain for p in places]),
            "corrected_percent": np.concatenate(with_period),
        }
    )


def page(user_places: Sequence[RadarOnChart], reference_places: Sequence[RadarOnChart]) -> str:
    """The live page: the user's radars first, then the reference radars, as settings to begin from."""
    data = [
        dict(zip(("name", "r", "v", "dt", "dm"), (place.name, *place.inputs), strict=True))
        for place in [*user_places, *reference_places]
    ]
    parts = [resources.files(__package__).joinpath("live", name).read_text(encoding="utf-8") for name in PAGE_PARTS]
    return render_page.live_page(tr("What Doppler gains for a radar"), parts, json.dumps(data), PAGE_TERMS)


PAGE_PARTS = ("body.html.j2", "style.css", "script.js")
PAGE_TERMS = (  # by the page's script
    *(term("range"), term("velocity"), term("acceleration"), term("time, s"), term("Scan {k}, {t} s: {values}")),
    *(term("reduces the range error by {size} %"), term("raises the range error by {size} %")),
    *(
        term("the velocity error by {size} %"),
        term("reduces the velocity error by {size} %"),
        term("raises the velocity error by {size} %"),
    ),
    *(term("the acceleration error falls by {size} %"), term("the acceleration error rises by {size} %")),
    *(term("from {low} to {high}"), term("At scan {k}, {t} s, Doppler {range} and {velocity}; {acceleration}.")),
)
