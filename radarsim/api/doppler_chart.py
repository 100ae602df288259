"""`radarsim chart`: what Doppler gains for every radar, and where a config's radar lies."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.api import arguments
from radarsim.api.configs import Config, Overrides, load
from radarsim.api.display import Displayable
from radarsim.api.load_experiments import name_clashes
from radarsim.api.result_content import captions
from radarsim.config.experiment import Case
from radarsim.errors import ConfigError, argument
from radarsim.report import atomic_files, csv_text
from radarsim.report.drawing.model import Chart, Figure
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


CHART_FOLDER = "chart"


@dataclass(frozen=True, repr=False)
class DopplerChart(Displayable):
    """The chart: a sentence for each case, the rows of chart.csv, figures; the folder and its files, if any."""

    folder: Path | None
    files: tuple[str, ...]
    sentences: tuple[str, ...]
    table: "pd.DataFrame"
    figures_by_name: Mapping[str, Figure]

    @property
    def _figures_by_name(self) -> Mapping[str, Figure]:
        return self.figures_by_name

    def _answer_lines(self) -> tuple[str, ...]:
        return self.sentences


def chart(
    *configs: Config,
    overrides: Overrides = (),
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    progress: Callable[[int, int, int], None] | None = None,
) -> DopplerChart:
    """Chart the gain by Doppler for all radars, with the configs' radars marked; simulates nothing.

    Without configs, shows the five radars of the first paper. `table` is chart.csv: a row for each case and filter,
    with the gains in the long run, per cent. out: directory for table, figures and the page with sliders. Raises
    ConfigError if the configs' study has no chart.

    >>> chart("rls2").figures[0]
    'gain_against_time'
    """
    override_texts = arguments.check_arguments(overrides, out=out, figures=figures, width_mm=width_mm)
    formats = arguments.figure_formats(figures)
    if override_texts and not configs:
        raise ConfigError(f"{argument('overrides', '--set')}: without a config there is nothing to change")
    unique_configs = [config for n, config in enumerate(configs) if config not in configs[:n]]
    experiments = [load(config, overrides) for config in unique_configs]
    if faults := name_clashes(experiments):
        raise ConfigError(*faults)
    chart_content = describe_chart([case for experiment in experiments for case in experiment.cases])
    result = DopplerChart(None, (), chart_content.sentences, chart_content.table, chart_content.figures)
    if out is None:
        return result
    contents = {"chart.csv": csv_text.to_csv(chart_content.table), "chart.html": chart_content.page.encode()}
    if formats:
        from radarsim.report.drawing.canvas import save  # Matplotlib

        for n, (name, figure) in enumerate(chart_content.figures.items()):
            contents |= {f"{name}.{kind}": data for kind, data in save(figure, formats, width_mm).items()}
            if progress is not None:
                progress(n + 1, len(chart_content.figures), 0)
        contents["captions.md"] = captions(chart_content.figures).encode()
    folder = Path(out) / CHART_FOLDER
    atomic_files.replace_all(folder, contents)
    return replace(result, folder=folder, files=tuple(sorted(contents)))


def describe_chart(cases: Sequence[Case]) -> Chart:
    """The chart of these cases; without cases that of the study which has one. Raises ConfigError."""
    studies = list(dict.fromkeys(case.study for case in cases))
    if len(studies) > 1:
        raise ConfigError(f"one study per chart; these belong to {', '.join(studies)}")
    for name in studies or registry.study_names():
        chart_content = registry.study(name).chart(cases, reference_cases(name))
        if chart_content is not None:
            return chart_content
    raise ConfigError(f"study {studies[0]} has no chart")


def reference_cases(study: str) -> list[Case]:
    """The reference radars of a study's chart: the unswept cases of the shipped config of its name."""
    try:
        experiment = load(study)
    except ConfigError:
        return []
    return [case for case in experiment.cases if not case.swept_values and case.study == study]
