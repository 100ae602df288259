"""`radarsim compare`: stored results on common axes, with their differences; simulates nothing."""

import os
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import arguments
from radarsim.api.configs import config_path, load
from radarsim.api.display import Displayable
from radarsim.api.repeat_command import RESULTS, command
from radarsim.api.result import Result
from radarsim.api.result_content import captions, config_names
from radarsim.api.result_folder import choose_result, find_result
from radarsim.api.stored_cases import cases_of_result
from radarsim.config.experiment import Case, Experiment
from radarsim.config.find_files import did_you_mean, is_stem
from radarsim.config.identity import digest, identity_keys, world_keys
from radarsim.config.quantity_phrase import PhraseError, parse_phrase
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import tr, translate_names
from radarsim.report import atomic_files, csv_text, provenance
from radarsim.report import tables as common
from radarsim.report.comparison import figures as comparison_figures
from radarsim.report.comparison import pairs as comparison_pairs
from radarsim.report.comparison import sentences as comparison_sentences
from radarsim.report.comparison import summary, table
from radarsim.report.comparison.pairs import Side
from radarsim.report.comparison.summary import SummaryTable
from radarsim.report.drawing.model import Figure, reworded
from radarsim.report.drawing.page_figure import DrawnFigure
from radarsim.report.quantities import COMMON, FLOORS, Quantity
from radarsim.report.stored_tables import no_result
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


FOLDER = "compare"


@dataclass(frozen=True)
class ComparedRun:
    """A result: its name, its folder, its run.json and, if known, the config that describes it. note: see
    `choose_result`.

    read_table: gives a table by its name, None where there is none."""

    label: str
    folder: Path
    record: dict[str, Any]
    read_table: "Callable[[str], pd.DataFrame | None]" = field(repr=False)
    experiment: Experiment | None = None
    stored: bool = True
    note: str = ""

    @cached_property
    def cases(self) -> dict[str, Case]:
        """The cases as recorded, by name, as far as they read as configs."""
        return dict(cases_of_result(self.record, self.folder))


@dataclass(frozen=True, repr=False)
class Comparison(Displayable):
    """A comparison: sentences, notes and warnings, the rows of comparison.csv; the folder and files, if any.

    last: the rows at the last common time; shown_quantities: those of the summary, with their wording; summary_tables:
    what the terminal shows of them, of `components`."""

    folder: Path | None
    files: tuple[str, ...]
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    rows: tuple[dict[Hashable, Any], ...]
    last: tuple[dict[Hashable, Any], ...]
    shown_quantities: tuple[tuple[str, str], ...]
    summary_tables: tuple[SummaryTable, ...] = ()
    components: tuple[str, ...] = ()
    figures_by_name: Mapping[str, Figure] = field(default_factory=dict)

    @property
    def table(self) -> "pd.DataFrame":
        """comparison.csv: every common time, with the differences and their intervals."""
        return common.frame({str(name): [row[name] for row in self.rows] for name in self.rows[0]})

    @property
    def _figures_by_name(self) -> Mapping[str, Figure]:
        return self.figures_by_name

    def _answer_lines(self) -> tuple[str, ...]:
        return self.sentences


Source = str | os.PathLike[str] | Result


def compare(
    *sources: Source | Mapping[str, Source],
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    component: str | None = None,
    wanted: str | None = None,
) -> Comparison:
    """Compare results with the first one: differences with 95 % intervals, on common axes.

    Each source is a result of `run` or `load`, a config with a stored result in results/ or `out`, or the folder of a
    result; a single mapping gives them by name. out: directory for table, page and figures. component: the one that
    sentences and summary are about, by default the first; wanted says quantity, component and time in one, as in
    `solve`: `"gain of Vr at 60 s"`. If two results use the same measurements and the same baseline filter, the
    difference is paired.

    `table` is comparison.csv: a row for each quantity, filter, component and common time. Raises ConfigError where
    results are missing or have nothing in common, StoreError where a stored one is damaged.

    >>> import radarsim
    >>> mine = radarsim.run("rls2", realisations=2000, overrides={"radar.sigma_velocity_mps": 4})
    >>> compare({"paper": radarsim.run("rls2", realisations=2000), "mine": mine}).table["label"].unique().tolist()
    ['mine']
    """
    arguments.check_arguments(out=out, figures=figures, width_mm=width_mm)
    formats = arguments.figure_formats(figures)
    runs = _runs_to_compare(sources, Path(RESULTS if out is None else out))
    comparison_table, comparison = _compare_runs(runs, component, wanted)
    if out is None:
        return comparison
    return _write_comparison(Path(out) / FOLDER, runs, comparison, comparison_table, formats, width_mm)


def _runs_to_compare(sources: Sequence[Source | Mapping[str, Source]], out: Path) -> list[ComparedRun]:
    """The runs that the arguments of `compare` mean, each with a name of its own."""
    mapping = sources[0] if len(sources) == 1 else None
    names = list(mapping) if isinstance(mapping, Mapping) else None
    run_sources: Sequence[Any] = list(mapping.values()) if isinstance(mapping, Mapping) else sources
    if len(run_sources) < 2:
        raise ConfigError(f"compare: takes two results or more, got {len(run_sources)}")
    if unusable := [source for source in run_sources if not isinstance(source, Result | str | os.PathLike)]:
        raise ConfigError(
            *(f"compare: must be a result, a config or the folder of a result, got {source!r}" for source in unusable)
        )
    runs = _find_runs(run_sources, out)
    if names:
        runs = [replace(run, label=str(name)) for run, name in zip(runs, names, strict=True)]
    return _with_distinct_names(runs)


def _compare_runs(
    runs: Sequence[ComparedRun], component: str | None, wanted: str | None
) -> "tuple[pd.DataFrame, Comparison]":
    """The table of a comparison, and the comparison as it is before anything is written."""
    sides_of_runs = [_sides(run) for run in runs]
    pairs, pairing_notes = comparison_pairs.pairs(_label_sides(sides_of_runs))
    comparison_table = table.comparison_table(pairs)
    if not len(comparison_table):
        raise ConfigError(f"{' and '.join(run.label for run in runs)} share no filter and component to compare")
    shared = table.shared_quantities(side for sides in sides_of_runs for side in sides)
    translate = partial(translate_names, names=config_names(case for run in runs for case in _cases(run)))
    quantities = comparison_sentences.summary_quantities(comparison_table, shared)
    at_s = None
    if wanted is not None:
        if component is not None:
            options = argument("component", "--component"), argument("wanted", "--for")
            raise ConfigError("{}: stands in {} already".format(*options))
        compared_quantities = [q for q in shared if (comparison_table["quantity"] == q.value).any()]
        quantity, component, at_s = asked_of_comparison(wanted, compared_quantities)
        quantities = [quantity]
    summaries = summary.summaries(comparison_table, quantities, component, at_s)
    notes = [*comparison_sentences.pairing_lines(comparison_table), *pairing_notes]
    warnings = [line for run in runs for line in (*([run.note] if run.note else []), *_stale_tables(run))]
    labelled_sides = [side for sides in _label_sides(sides_of_runs) for side in sides]
    figures = comparison_figures.figures(labelled_sides, comparison_table)
    comparison = Comparison(
        folder=None,
        files=(),
        sentences=tuple(translate(part.sentence) for part in summaries),
        notes=tuple(notes),
        warnings=tuple(warnings),
        rows=tuple(comparison_table.to_dict("records")),
        last=tuple(comparison_sentences.final_rows(comparison_table).to_dict("records")),
        shown_quantities=tuple((quantity.value, quantity.words) for quantity in quantities),
        summary_tables=tuple(part.table for part in summaries),
        components=tuple(dict.fromkeys(comparison_table["component"][comparison_table["component"] != ""])),
        figures_by_name={name: reworded(figure, translate) for name, figure in figures.items()},
    )
    return comparison_table, comparison


def asked_of_comparison(wanted: str, measured: Sequence[Quantity]) -> tuple[Quantity, str | None, float | None]:
    """The quantity, component and time, s, of a phrase, None for the last common time. Raises ConfigError."""
    option = argument("wanted", "--for")
    try:
        phrase = parse_phrase(wanted)
    except PhraseError as error:
        raise ConfigError(f"{option}: {error}") from None
    if phrase.over != "at" or phrase.at_k is not None:
        raise ConfigError(f"{option}: a comparison is of common times: give one in s, or the end, got {wanted!r}")
    by_name = {quantity.name: quantity for quantity in measured}
    if phrase.name not in by_name:
        suggestion = did_you_mean(phrase.name, by_name)
        raise ConfigError(f"{option}: must be one of {', '.join(by_name)}, got {phrase.name!r}{suggestion}")
    return by_name[phrase.name], phrase.component, phrase.at_s


def _write_comparison(
    folder: Path,
    runs: Sequence[ComparedRun],
    comparison: Comparison,
    comparison_table: "pd.DataFrame",
    formats: Sequence[str],
    width_mm: float | None,
) -> Comparison:
    """Write table, figures, page and record of a comparison; the comparison with its files and further warnings."""
    warnings = [*comparison.warnings, *_replaced_runs(folder, runs)]
    contents = {"comparison.csv": csv_text.to_csv(comparison_table)}
    drawings: list[DrawnFigure] = []
    if formats:
        from radarsim.report.drawing.canvas import draw  # Matplotlib

        drawings = [draw(figure, formats, width_mm) for figure in comparison.figures_by_name.values()]
        for name, drawing in zip(comparison.figures_by_name, drawings, strict=True):
            contents |= {f"figures/{name}.{kind}": data for kind, data in drawing.files.items()}
        if comparison.figures_by_name:
            contents["figures/captions.md"] = captions(comparison.figures_by_name).encode()
    page = _page(runs, comparison, warnings, drawings, comparison_table, contents)
    contents["compare.html"] = page.encode()
    contents["compare.json"] = provenance.to_json(_record(runs, contents))
    atomic_files.replace_all(folder, contents, stale=partial(provenance.outputs, name="compare.json"))
    return replace(comparison, folder=folder, files=tuple(sorted(contents)), warnings=tuple(warnings))


def _find_runs(sources: Sequence[Source], out: Path) -> list[ComparedRun]:
    """The stored results, or one ConfigError that names all missing ones."""
    runs: list[ComparedRun] = []
    faults: list[str] = []
    for source in sources:
        try:
            runs.append(
                _run_of_result(source)
                if isinstance(source, Result)
                else _run_in_folder(source, out) or _stored_run(source, out)
            )
        except ConfigError as error:
            faults += error.lines
    if faults:
        raise ConfigError(*faults)
    return runs


def _run_of_result(result: Result) -> ComparedRun:
    """A result held in Python, with the part of its run.json that a comparison needs."""
    experiment = result.experiment
    record: dict[str, Any] = {
        "config": experiment.stem,
        "study": experiment.study,
        "resolved": experiment.resolved,
        "outputs": {},
    }
    record["cases"] = {case.name: {"done": case.count} for case in result.cases}
    return ComparedRun(experiment.stem, Path(experiment.stem), record, result.tables.get, stored=False)


def _run_in_folder(source: str | os.PathLike[str], out: Path) -> ComparedRun | None:
    """The result in a folder, or that of a name; None where the source is neither. Raises ConfigError for a folder
    without a result."""
    path = Path(source)
    result, note = choose_result(source, out, names_config=False)
    if result is None:
        if path.is_dir() and path.name != str(path):
            raise ConfigError(no_result(path))
        return None
    name = os.fspath(source)
    experiment = load(name) if is_stem(name) and result.folder != path and config_path(name) else None
    label = str(result.record["config"])
    return ComparedRun(label, result.folder, dict(result.record), result.files.table, experiment, note=note)


def _stored_run(source: str | os.PathLike[str], out: Path) -> ComparedRun:
    experiment = load(source)
    folder = out / experiment.stem
    result = find_result(folder)
    if result is None:
        raise ConfigError(f"{experiment.stem}: no result in {folder}; `{command(experiment, (), out)}` computes it")
    return ComparedRun(experiment.stem, folder, dict(result.record), result.files.table, experiment)


def _with_distinct_names(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """The runs with distinct names: to equal names their folder is added, or a number where they have none."""
    names = [run.label for run in runs]
    longer_names = [f"{run.label} in {run.folder.parent}" if run.stored else run.label for run in runs]
    longer_names = [
        f"{name} ({longer_names[: n + 1].count(name)})" if longer_names.count(name) > 1 else name
        for n, name in enumerate(longer_names)
    ]
    return [
        replace(run, label=longer_name) if names.count(run.label) > 1 else run
        for run, longer_name in zip(runs, longer_names, strict=True)
    ]


def _sides(run: ComparedRun) -> list[Side]:
    """The cases that a result has, with their rows."""
    quantities = _measured_quantities(str(run.record.get("study")))
    table_names = {quantity.table for quantity in quantities}
    tables_read = ((name, run.read_table(name)) for name in sorted(table_names))
    tables = {name: rows for name, rows in tables_read if rows is not None and "case" in rows}
    sides = []
    for name, case_record in run.record["cases"].items():
        case_rows = {key: rows[rows["case"] == name] for key, rows in tables.items()}
        if len(gains := case_rows.get("gains", ())):  # of several baselines, the first
            case_rows["gains"] = gains[gains["baseline"] == gains["baseline"].iloc[0]]
        if len(case_rows.get("curves", ())):
            sides.append(
                Side(run.label, name, name, _noise_identity(run, name), int(case_record["done"]), case_rows, quantities)
            )
    return sides


def _measured_quantities(study: str) -> tuple[Quantity, ...]:
    """What a study measures; for a study no longer installed, σ and gain."""
    try:
        return tuple(quantity for quantity in registry.quantities(study, None) if quantity not in FLOORS)
    except (ConfigError, KeyError):
        return COMMON


def _noise_identity(run: ComparedRun, name: str) -> str | None:
    """A hash of what a case's measurements depend on: study, seed, world; None if the record no longer reads."""
    case = run.cases.get(name)
    return None if case is None else digest([case.study, case.seed, world_keys(case.spec)])


def _label_sides(sides_of_runs: Sequence[Sequence[Side]]) -> list[list[Side]]:
    """The sides with distinct names: the run's where it has one case, else the case's, and the
    run's added where two are equal."""
    labelled_sides = [
        [replace(side, label=side.run if len(run) == 1 else side.case) for side in run] for run in sides_of_runs
    ]
    labels = [side.label for run in labelled_sides for side in run]
    return [
        [
            replace(side, label=f"{side.label} ({side.run})") if len(run) > 1 < labels.count(side.label) else side
            for side in run
        ]
        for run in labelled_sides
    ]


def _stale_tables(run: ComparedRun) -> list[str]:
    """A warning where a config no longer matches its stored result."""
    if run.experiment is None:
        return []
    stored_cases = {name: run.cases.get(name) for name in run.record["cases"]}
    config_cases = {case.name: case for case in run.experiment.cases}
    is_current = stored_cases.keys() == config_cases.keys() and all(
        stored is not None and identity_keys(stored.spec) == identity_keys(config_cases[name].spec)
        for name, stored in stored_cases.items()
    )
    if is_current:
        return []
    rerun_command = f"{command(run.experiment, (), run.folder.parent)} --replace"
    return [f"{run.folder}: of an earlier state of {run.label}; `{rerun_command}` brings it up to date"]


def _replaced_runs(folder: Path, runs: Sequence[ComparedRun]) -> list[str]:
    """A note where another comparison in the folder is overwritten."""
    earlier_folders = provenance.earlier_record(folder, "compare.json").get("compared")
    folders = [str(run.folder) for run in runs]
    if not isinstance(earlier_folders, list) or earlier_folders == folders:
        return []
    return [f"{folder}: held the comparison of {', '.join(map(str, earlier_folders))}; it is replaced"]


def _record(runs: Sequence[ComparedRun], contents: "dict[str, bytes]") -> dict[str, Any]:
    run_records = {
        str(run.folder): {key: run.record.get(key) for key in ("config", "resolved_sha256", "identities", "versions")}
        for run in runs
    }
    output_record: dict[str, Any] = {"outputs": {}}
    for path, data in sorted(contents.items()):
        output_record = provenance.with_output(output_record, path, data)
    return {
        "compared": [str(run.folder) for run in runs],
        "runs": run_records,
        "versions": provenance.versions(),
        **output_record,
    }


def _page(
    runs: Sequence[ComparedRun],
    comparison: Comparison,
    warnings: Sequence[str],
    drawings: Sequence[DrawnFigure],
    comparison_table: "pd.DataFrame",
    outputs: Collection[str],
) -> str:
    from radarsim.report import page, page_tables, settings_tables

    cases = [case for run in runs for case in _cases(run)]
    names = [case.name for case in cases]
    comparable = len(set(names)) == len(names) and len({case.study for case in cases}) == 1
    settings = settings_tables.settings_tables(cases) if comparable else {}
    summaries = [
        page_tables.text_table(part.title, [tr(name) for name in part.columns], part.rows)
        for part in comparison.summary_tables
    ]
    return page.comparison_page(
        [run.label for run in runs],
        comparison.sentences,
        summaries,
        comparison.notes,
        warnings,
        drawings,
        comparison_table,
        settings,
        outputs,
    )


def _cases(run: ComparedRun) -> list[Case]:
    """The cases of a result as recorded, if still valid."""
    label = run.label if len(run.record["cases"]) == 1 else ""
    return [replace(case, name=label or name) for name, case in run.cases.items()]
