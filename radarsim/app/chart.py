"""`radarsim chart`: one chart for every device, with the cases of some configs marked on it."""

import os
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path

from radarsim.app import arguments
from radarsim.app.configs import load
from radarsim.app.output import captions
from radarsim.app.run import namesakes
from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.report import files
from radarsim.report import tables as common
from radarsim.report.drawing import Chart
from radarsim.studies import registry

FOLDER = "chart"


@dataclass(frozen=True)
class Drawn:
    """What was written: the folder, the files in it, a sentence for each case, and the rows of chart.csv."""

    folder: Path
    files: tuple[str, ...]
    sentences: tuple[str, ...]
    rows: tuple[dict[Hashable, object], ...]


def chart(
    configs: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str] = "results",
    *,
    overrides: Sequence[str] = (),
    formats: Sequence[str] = ("svg", "png"),
    width_mm: float | None = None,
    progress: Callable[[int, int, int], None] | None = None,
) -> Drawn:
    """Draw the chart of the configs' study, with their cases on it, into `out`/chart; nothing is simulated.

    Without configs, of the study that has a chart, with its paper's own devices; a config that is given twice counts
    once. width_mm is the width of the figures' files in place of their own. progress is told of each figure. Raises
    ConfigError where the study has none, configs are of several, or two have one name.
    """
    arguments.directory(out)
    experiments = [load(config, overrides) for config in dict.fromkeys(configs)]
    if faults := namesakes(experiments):
        raise ConfigError(*faults)
    made = described([case for one in experiments for case in one.cases])
    contents = {"chart.csv": common.to_csv(made.table), "chart.html": made.page.encode()}
    if formats:
        from radarsim.report import figures as drawing  # Matplotlib

        for n, (name, figure) in enumerate(made.figures.items()):
            contents |= {f"{name}.{kind}": data for kind, data in drawing.save(figure, formats, width_mm).items()}
            if progress is not None:
                progress(n + 1, len(made.figures), 0)
        contents["captions.md"] = captions(made.figures).encode()
    folder = Path(out) / FOLDER
    files.replace_all(folder, contents)
    return Drawn(folder, tuple(sorted(contents)), made.sentences, tuple(made.table.to_dict("records")))


def described(cases: Sequence[Case]) -> Chart:
    """The chart of some cases, or without any of the one study that has a chart. Raises ConfigError."""
    studies = list(dict.fromkeys(case.study for case in cases))
    if len(studies) > 1:
        raise ConfigError(f"one study a chart, these are of {', '.join(studies)}")
    for name in studies or registry.names():
        made = registry.study(name).chart(cases, references(name))
        if made is not None:
            return made
    raise ConfigError(f"study {studies[0]} has no chart")


def references(study: str) -> list[Case]:
    """The devices that a study's chart shows beside one's own: the unswept cases of the shipped config of its name."""
    try:
        found = load(study)
    except ConfigError:
        return []
    return [case for case in found.cases if not case.swept and case.study == study]
