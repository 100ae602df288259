"""Write the page of tracks over recorded plots, with its figures as files."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.config.find_files import SHIPPED
from radarsim.errors import ConfigError
from radarsim.language.translate import tr
from radarsim.recordings.fit.advice import Advice
from radarsim.recordings.report.figures import track_figures
from radarsim.recordings.report.innovation_tests import InnovationTest
from radarsim.recordings.report.sentences import Statement, answer_statements, plot_statements
from radarsim.recordings.report.tables import ERRORS_TITLE, TESTS_TITLE, error_table, test_table
from radarsim.recordings.tracking_result import TrackingResult

PAGE_NAME = "report.html"


@np.errstate(all="ignore")  # of a filter that diverged
def write_page(
    followed: TrackingResult,
    experiment: Experiment,
    source: str | os.PathLike,
    judged: Sequence[InnovationTest],
    advised: Advice | None,
    folder: str | os.PathLike,
    config_text: str = "",
) -> list[str]:
    """Write the page and `figures/` into a folder, and return the names of the figures. config_text: the whole config.

    Raises StoreError, or, with nothing written, ConfigError where a file would overwrite the plots or the config."""
    from radarsim.report import atomic_files
    from radarsim.report import page as report_page
    from radarsim.report.drawing.canvas import draw

    source_name = os.path.basename(os.fspath(source))
    drawings = {name: draw(figure) for name, figure in track_figures(followed).items()}
    page = report_page.track_page(
        experiment.stem,
        source_name,
        _sentences(answer_statements(followed, judged, advised)) or [_no_answer_reason(followed)],
        _sentences(plot_statements(followed)),
        list(drawings.values()),
        {
            tr(ERRORS_TITLE): error_table(followed),
            tr(TESTS_TITLE): test_table(judged),
            tr("Tracks"): _track_table(followed),
        },
        config_text,
        f"radarsim track {_config_argument(experiment)} {source_name}",
    )
    contents = {PAGE_NAME: page.encode()}
    for name, drawing in drawings.items():
        contents |= {f"figures/{name}.{kind}": data for kind, data in drawing.files.items()}
    for path in (Path(folder, name) for name in contents):
        if any(atomic_files.same_file(path, input_file) for input_file in (source, experiment.path) if input_file):
            raise ConfigError(f"{path}: would be overwritten; choose another folder")
    atomic_files.replace_all(Path(folder), contents)
    return list(drawings)


def _config_argument(experiment: Experiment) -> str:
    """The config in a command: a shipped one by its name, others by their path."""
    path = experiment.path
    return path if path and not Path(path).is_relative_to(SHIPPED) else experiment.stem


def _no_answer_reason(followed: TrackingResult) -> str:
    """Why the plots do not tell which filter is best."""
    if followed.filters_without_test:
        return tr("The plots do not tell which filter is best: the filters give no innovation with a covariance.")
    return tr("Too few plots to rank the filters.")


def _sentences(statements: Sequence[Statement]) -> list[str]:
    """Statements as sentences: a label gets a colon, and a statement without one is appended to the previous."""
    sentences: list[str] = []
    for statement in statements:
        label, text = tr(statement.label), statement.text.strip()
        if statement.label:
            sentences.append(f"{label[:1].upper()}{label[1:]}: {text}")
        elif sentences:
            sentences[-1] += f", {text}"
        else:
            sentences.append(text)
    return [f"{sentence}." for sentence in sentences]


def _track_table(followed: TrackingResult) -> list[dict[str, object]]:
    return [
        {"track": name, "rows": result.rows, "from, s": result.first_s, "to, s": result.last_s, "gaps": result.gaps}
        for name, result in followed.tracks.items()
    ]
