"""`radarsim compare`: stored results on common axes, with their differences; simulates nothing.

`radarsim chart`: one chart for all radars, with the cases of some configs marked on it."""

import os
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.app import configs, stored
from radarsim.app.configs import RESULTS, Config, Overrides, command, load
from radarsim.app.recorded_cases import recorded_case
from radarsim.app.result import Result, captions, names_in
from radarsim.app.run import namesakes
from radarsim.app.shown import Shown
from radarsim.config.experiment import Case, Experiment, canonical, digest, world
from radarsim.errors import ConfigError, argument
from radarsim.language import called
from radarsim.report import compare as sides
from radarsim.report import files
from radarsim.report import tables as common
from radarsim.report.compare import Side
from radarsim.report.drawing import Chart, Figure, reworded
from radarsim.report.page_figure import DrawnFigure
from radarsim.report.quantities import COMMON, FLOORS, Quantity
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


# ---- compare ---------------------------------------------------------------------------------------------------------
FOLDER = "compare"


@dataclass(frozen=True)
class Run:
    """A result: its name, its folder, its run.json and, if known, the config that describes it.

    made: the tables of a result that is not stored."""

    label: str
    folder: Path
    record: dict[str, Any]
    experiment: Experiment | None = None
    made: "Mapping[str, pd.DataFrame] | None" = None


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """A comparison: sentences, notes and warnings, the rows of comparison.csv; the folder and files, if any.

    last: the rows at the last common time; told: the quantities that the terminal shows, with their wording."""

    folder: Path | None
    files: tuple[str, ...]
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    rows: tuple[dict[Hashable, Any], ...]
    last: tuple[dict[Hashable, Any], ...]
    told: tuple[tuple[str, str], ...]
    drawn: Mapping[str, Figure] = field(default_factory=dict)

    @property
    def table(self) -> "pd.DataFrame":
        """comparison.csv: every common time, with the differences and their intervals."""
        return common.frame({str(name): [row[name] for row in self.rows] for name in self.rows[0]})

    @property
    def _described(self) -> Mapping[str, Figure]:
        return self.drawn

    def _said(self) -> tuple[str, ...]:
        return self.sentences


Source = str | os.PathLike[str] | Result


def compare(
    *sources: Source | Mapping[str, Source],
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
) -> Comparison:
    """Compare results with the first one: differences with 95 % intervals, on common axes.

    Each source is a result of `run` or `load`, a config with a stored result in results/ or `out`, or the folder of a
    result; a single mapping gives them by name. out: directory for table, page and figures. If two results use the same
    measurements and the same baseline filter, the difference is paired.

    `table` is comparison.csv: a row for each quantity, filter, component and common time. Raises ConfigError where
    results are missing or have nothing in common, StoreError where a stored one is damaged.

    >>> import radarsim
    >>> mine = radarsim.run("rls2", realisations=2000, overrides={"radar.sigma_velocity_mps": 4})
    >>> compare({"paper": radarsim.run("rls2", realisations=2000), "mine": mine}).table["label"].unique().tolist()
    ['mine']
    """
    configs.check(out=out, figures=figures, width_mm=width_mm)
    formats, mapping = configs.formats(figures), next(iter(sources), None) if len(sources) == 1 else None
    names = list(mapping) if isinstance(mapping, Mapping) else None
    given: Sequence[Any] = list(mapping.values()) if isinstance(mapping, Mapping) else sources
    if len(given) < 2:
        raise ConfigError(f"compare: takes two results or more, got {len(given)}")
    if wrong := [one for one in given if not isinstance(one, Result | str | os.PathLike)]:
        raise ConfigError(
            *(f"compare: must be a result, a config or the folder of a result, got {one!r}" for one in wrong)
        )
    runs = _found(given, Path(RESULTS if out is None else out))
    if names:
        runs = [replace(run, label=str(name)) for run, name in zip(runs, names, strict=True)]
    runs = _named(runs)
    every = [_sides(run) for run in runs]
    pairs, alone = sides.pairs(_labelled(every))
    made = sides.compared(pairs)
    if not len(made):
        raise ConfigError(f"{' and '.join(run.label for run in runs)} share no filter and component to compare")
    shared = sides.shared(side for run in every for side in run)
    said = partial(called, names=names_in(case for run in runs for case in _cases(run)))
    sentences = list(map(said, sides.sentences(made, shared)))
    notes = [*sides.pairings(made), *alone]
    warnings = [line for run in runs for line in _stale(run)]
    drawn = sides.figures([side for run in _labelled(every) for side in run], made)
    described = {name: reworded(figure, said) for name, figure in drawn.items()}
    rows, last = (tuple(table.to_dict("records")) for table in (made, sides.at_the_end(made)))
    told = tuple((of.value, of.words) for of in sides.summary_quantities(made, shared))
    found = Comparison(None, (), tuple(sentences), tuple(notes), tuple(warnings), rows, last, told, described)
    if out is None:
        return found
    folder = Path(out) / FOLDER
    warnings += _replaced(folder, runs)
    contents = {"comparison.csv": common.to_csv(made)}
    drawings: list[DrawnFigure] = []
    if formats:
        from radarsim.report.figures import draw  # Matplotlib

        drawings = [draw(figure, formats, width_mm) for figure in described.values()]
        for name, drawing in zip(described, drawings, strict=True):
            contents |= {f"figures/{name}.{kind}": data for kind, data in drawing.files.items()}
        if described:
            contents["figures/captions.md"] = captions(described).encode()
    contents["compare.html"] = _page(runs, sentences, notes, warnings, drawings, made, contents).encode()
    contents["compare.json"] = files.to_json(_record(runs, contents))
    files.replace_all(folder, contents, stale=partial(files.outputs, name="compare.json"))
    return replace(found, folder=folder, files=tuple(sorted(contents)), warnings=tuple(warnings))


def _found(sources: Sequence[Source], out: Path) -> list[Run]:
    """The stored results, or one ConfigError that names all missing ones."""
    found: list[Run] = []
    faults: list[str] = []
    for source in sources:
        try:
            found.append(_made(source) if isinstance(source, Result) else _folder(Path(source)) or _stored(source, out))
        except ConfigError as error:
            faults += error.lines
    if faults:
        raise ConfigError(*faults)
    return found


def _made(of: Result) -> Run:
    """A result held in Python, with the part of its run.json that is needed here."""
    one = of.experiment
    record: dict[str, Any] = {"config": one.stem, "study": one.study, "resolved": one.resolved, "outputs": {}}
    record["cases"] = {case.name: {"done": case.count} for case in of.cases}
    return Run(one.stem, Path(one.stem), record, made=of.tables)


def _folder(path: Path) -> Run | None:
    """The result in a folder; None where the path is no folder. Raises ConfigError for a folder without a result."""
    record = stored.record(path)
    if record is None:
        if path.is_dir() and path.name != str(path):
            raise ConfigError(f"{path}: must be a config or the folder of a result: there is no run.json in it")
        return None
    return Run(str(record.get("config", path.name)), path, record)


def _stored(source: str | os.PathLike[str], out: Path) -> Run:
    experiment = load(source)
    folder = out / experiment.stem
    record = stored.record(folder)
    if record is None:
        raise ConfigError(f"{experiment.stem}: no result in {folder}; `{command(experiment, (), out)}` computes it")
    return Run(experiment.stem, folder, record, experiment)


def _named(runs: Sequence[Run]) -> list[Run]:
    """The runs with distinct names: two of one config get their folder added, or a number without one."""
    names = [run.label for run in runs]
    apart = [run.label if run.made is not None else f"{run.label} in {run.folder.parent}" for run in runs]
    apart = [
        f"{name} ({apart[: n + 1].count(name)})" if apart.count(name) > 1 else name for n, name in enumerate(apart)
    ]
    return [
        replace(run, label=other) if names.count(run.label) > 1 else run for run, other in zip(runs, apart, strict=True)
    ]


def _sides(run: Run) -> list[Side]:
    """The cases that a result has, with their rows."""
    measured = _measured(str(run.record.get("study")))
    wanted = {one.table for one in measured}
    outputs = run.record["outputs"]
    kept = run.made.get if run.made is not None else partial(stored.table, run.folder, outputs=outputs)
    tables = {name: rows for name in sorted(wanted) if (rows := kept(name)) is not None}
    made = []
    for name, counts in run.record["cases"].items():
        own = {key: rows[rows["case"] == name] for key, rows in tables.items()}
        if len(gains := own.get("gains", ())):  # of several baselines, the first
            own["gains"] = gains[gains["baseline"] == gains["baseline"].iloc[0]]
        if len(own.get("curves", ())):
            made.append(Side(run.label, name, name, _noise(run, name), int(counts["done"]), own, measured))
    return made


def _measured(study: str) -> tuple[Quantity, ...]:
    """What a study measures; for a study no longer installed, σ and gain."""
    try:
        return tuple(one for one in registry.quantities(study, None) if one not in FLOORS)  # which are no measurements
    except (ConfigError, KeyError):
        return COMMON


def _noise(run: Run, name: str) -> str | None:
    """A hash of what a case's measurements depend on: study, seed, world; None if the record is not readable now."""
    case = recorded_case(run.record, name)
    return None if case is None else digest([case.study, case.seed, world(case.spec)])


def _labelled(every: Sequence[Sequence[Side]]) -> list[list[Side]]:
    """The sides with distinct names: a single case takes its run's, others the case's, with the run's where two
    coincide."""
    first = [[replace(side, label=side.run if len(run) == 1 else side.case) for side in run] for run in every]
    names = [side.label for run in first for side in run]
    return [
        [
            replace(side, label=f"{side.label} ({side.run})") if len(run) > 1 < names.count(side.label) else side
            for side in run
        ]
        for run in first
    ]


def _stale(run: Run) -> list[str]:
    """A warning where a config no longer matches its stored result."""
    if run.experiment is None:
        return []
    held = {name: recorded_case(run.record, name) for name in run.record["cases"]}
    now = {case.name: case for case in run.experiment.cases}
    same = held.keys() == now.keys() and all(
        one is not None and canonical(one.spec) == canonical(now[name].spec) for name, one in held.items()
    )
    again = command(run.experiment, (), run.folder.parent)
    return [] if same else [f"{run.folder}: of an earlier state of {run.label}; `{again}` brings it up to date"]


def _replaced(folder: Path, runs: Sequence[Run]) -> list[str]:
    """A note where another comparison in the folder is overwritten."""
    before = files.earlier(folder, "compare.json").get("compared")
    now = [str(run.folder) for run in runs]
    if not isinstance(before, list) or before == now:
        return []
    return [f"{folder}: held the comparison of {', '.join(map(str, before))}; it is replaced"]


def _record(runs: Sequence[Run], contents: "dict[str, bytes]") -> dict[str, Any]:
    held = {
        str(run.folder): {key: run.record.get(key) for key in ("config", "resolved_sha256", "identities", "versions")}
        for run in runs
    }
    empty: dict[str, Any] = {"outputs": {}}
    for path, data in sorted(contents.items()):
        empty = files.with_output(empty, path, data)
    return {"compared": [str(run.folder) for run in runs], "runs": held, "versions": files.versions(), **empty}


def _page(
    runs: Sequence[Run],
    sentences: Sequence[str],
    notes: Sequence[str],
    warnings: Sequence[str],
    drawings: Sequence[DrawnFigure],
    made: "pd.DataFrame",
    outputs: Collection[str],
) -> str:
    from radarsim.report import html

    cases = [case for run in runs for case in _cases(run)]
    names = [case.name for case in cases]
    unique = len(set(names)) == len(names) and len({case.study for case in cases}) == 1
    differing = html.settings_tables(cases) if unique else {}
    labels = [run.label for run in runs]
    return html.comparison_page(labels, sentences, notes, warnings, drawings, made, differing, outputs)


def _cases(run: Run) -> list[Case]:
    """The cases of a result as recorded, if still valid."""
    found = ((name, recorded_case(run.record, name)) for name in run.record["cases"])
    label = run.label if len(run.record["cases"]) == 1 else ""
    return [replace(case, name=label or name) for name, case in found if case is not None]


# ---- chart -----------------------------------------------------------------------------------------------------------
CHART_FOLDER = "chart"


@dataclass(frozen=True, repr=False)
class DopplerChart(Shown):
    """The chart: a sentence for each case, the rows of chart.csv, figures; the folder and its files, if any."""

    folder: Path | None
    files: tuple[str, ...]
    sentences: tuple[str, ...]
    table: "pd.DataFrame"
    drawn: Mapping[str, Figure]

    @property
    def _described(self) -> Mapping[str, Figure]:
        return self.drawn

    def _said(self) -> tuple[str, ...]:
        return self.sentences


def chart(
    *given: Config,
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
    checked, formats = configs.check(overrides, out=out, figures=figures, width_mm=width_mm), configs.formats(figures)
    if checked and not given:
        raise ConfigError(f"{argument('overrides', '--set')}: without a config there is nothing to change")
    once = [config for n, config in enumerate(given) if config not in given[:n]]
    experiments = [load(config, overrides) for config in once]
    if faults := namesakes(experiments):
        raise ConfigError(*faults)
    made = described([case for one in experiments for case in one.cases])
    found = DopplerChart(None, (), made.sentences, made.table, made.figures)
    if out is None:
        return found
    contents = {"chart.csv": common.to_csv(made.table), "chart.html": made.page.encode()}
    if formats:
        from radarsim.report.figures import save  # Matplotlib

        for n, (name, figure) in enumerate(made.figures.items()):
            contents |= {f"{name}.{kind}": data for kind, data in save(figure, formats, width_mm).items()}
            if progress is not None:
                progress(n + 1, len(made.figures), 0)
        contents["captions.md"] = captions(made.figures).encode()
    folder = Path(out) / CHART_FOLDER
    files.replace_all(folder, contents)
    return replace(found, folder=folder, files=tuple(sorted(contents)))


def described(cases: Sequence[Case]) -> Chart:
    """The chart of some cases, or without any of the one study that has a chart. Raises ConfigError."""
    studies = list(dict.fromkeys(case.study for case in cases))
    if len(studies) > 1:
        raise ConfigError(f"one study per chart; these belong to {', '.join(studies)}")
    for name in studies or registry.names():
        made = registry.study(name).chart(cases, references(name))
        if made is not None:
            return made
    raise ConfigError(f"study {studies[0]} has no chart")


def references(study: str) -> list[Case]:
    """The reference radars of a study's chart: the unswept cases of the shipped config of its name."""
    try:
        found = load(study)
    except ConfigError:
        return []
    return [case for case in found.cases if not case.swept and case.study == study]
