"""The command pack, and what check and run do with an archive."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from radarsim.cli import command_group, options
from radarsim.errors import ConfigError, Interruption, NotChecked, RadarsimError, StoreError
from radarsim.language.translate import plural, tr

if TYPE_CHECKING:
    from radarsim.api.archive import Archive
    from radarsim.config.experiment import Experiment

MAX_UNANNOUNCED = 10**7  # realisations of a result in an archive that are run without a word
trust_code_option = click.option(
    "--trust-code", is_flag=True, help="Run the code of user filters that a study.zip brings; read it before."
)


@command_group.main.command()
@click.argument("results", nargs=-1, required=True, metavar="RESULT…", type=click.Path())
@click.option("-o", "--output", "archive", required=True, metavar="FILE.zip", help="The archive to write.")
@click.option("--code", is_flag=True, help="Also pack the code of your own filters, which runs for it.")
@options.json_option
def pack(results: tuple[str, ...], archive: str, code: bool, as_json: bool) -> None:
    """Pack results to hand over, in one file.

    RESULT is a folder such as results/rls2, or a directory of such folders. The file holds config, tables, figures and
    report, the stored blocks behind them, versions and hashes; equal results give equal bytes. Whoever gets it verifies
    it with `radarsim check FILE.zip`, and computes it anew with `radarsim run FILE.zip`. Not in it: packages of yours,
    which are named, and files of `claims --also`.

    \b
    Examples
      radarsim pack results/rls2 -o study.zip
      radarsim pack results -o study.zip                  all results in a directory
      radarsim pack results/mine -o study.zip --code      with the code of your own filters
    """
    from radarsim.api import json_output
    from radarsim.api.maintenance.pack import pack as pack_results
    from radarsim.cli import console

    packed = pack_results(results, archive, code)
    if as_json:
        click.echo(json_output.text(json_output.fields(packed)))
        return
    files = plural("{count} file", "{count} files", packed.files)
    console.print_line(tr("{path}: {files}, {size:.1f} MB", path=str(packed.path), files=files, size=packed.size / 1e6))
    console.print_field("results", ", ".join(packed.results))
    console.print_field("SHA-256", packed.sha256)
    console.print_field("verify", shlex.join(["radarsim", "check", str(packed.path)]))
    for note in packed.notes:
        console.print_line(tr("note: {words}", words=note))


def are_archives(sources: Sequence[str]) -> bool:
    """Whether sources are archives. Raises UsageError for archives beside configs."""
    archives = [source for source in sources if source.lower().endswith(".zip")]
    if archives and len(archives) < len(sources):
        raise click.UsageError(f"{archives[0]}: an archive goes with other archives only, not with configs")
    return bool(archives)


def refuse_options(archives: Sequence[str], values: Mapping[str, Any]) -> None:
    """Raise UsageError for options of configs beside an archive; values: of all options, by option or name."""
    used_options = [name if name.startswith("-") else f"--{name}" for name, value in values.items() if value]
    used_options = [name for name in used_options if (name, values.get("of")) != ("--of", "sigma")]
    if used_options:
        raise click.UsageError(f"{archives[0]}: {', '.join(used_options)} does not go with an archive")


@contextmanager
def loadable(sources: Sequence[str], trust_code: bool) -> "Iterator[list[tuple[str, Archive | None]]]":
    """The sources of configs, with each archive unpacked: its results' folders, and the archive. Elsewhere None.

    Results of archives that cannot be run are left out, and named at the end, by NotChecked unless there is another
    error."""
    if not are_archives(sources):
        if trust_code:
            raise click.UsageError("--trust-code applies to a study.zip")
        yield [(source, None) for source in sources]
        return
    from radarsim.api.maintenance import check_archive
    from radarsim.cli import console

    with ExitStack() as stack:
        results: list[tuple[str, Archive | None]] = []
        not_run: list[str] = []
        for source in sources:
            archive, folder = stack.enter_context(check_archive.unpacked(source, trust_code))
            runnable, lines = check_archive.runnable_results(archive, folder, trust_code)
            not_run += lines
            for name, place in runnable.items():
                results.append((str(place), archive))
                for file in archive.facts["results"][name]["code"]:
                    click.echo(f"note: runs code of {source}: results/{name}/{file}", err=True)
        try:
            yield results
        except Interruption:
            raise
        except RadarsimError:
            for line in not_run:
                console.print_error_line(line)
            raise
        if not_run:
            raise NotChecked(*not_run)


def named_by_results(
    experiments: "Sequence[Experiment]", sources: "Sequence[tuple[str, Archive | None]]", out: str
) -> "list[Experiment]":
    """The experiments; those of archives have the configs of the results that they will write under `out`."""
    from radarsim.config.complete_config import CONFIG_FILE

    return [
        experiment if archive is None else replace(experiment, path=str(Path(out) / experiment.stem / CONFIG_FILE))
        for experiment, (_, archive) in zip(experiments, sources, strict=True)
    ]


def print_large_runs(experiments: "Sequence[Experiment]", sources: "Sequence[tuple[str, Archive | None]]") -> None:
    """Say how long the large results of archives take, before any is run: somebody else has chosen their number."""
    from radarsim.api import cost_estimate
    from radarsim.cli import console

    for experiment, (_, archive) in zip(experiments, sources, strict=True):
        if archive is not None and sum(case.realisations for case in experiment.cases) > MAX_UNANNOUNCED:
            total = cost_estimate.check(experiment).total
            console.print_error_line(tr("note: {words}", words=f"{experiment.stem}: {total}"))


def check_archives(archives: Sequence[str], max_pieces: int | None, trust_code: bool, as_json: bool) -> None:
    """Verify archives, and print what was checked. Raises StoreError for faults, else ConfigError for files that are no
    archives, else NotChecked for what was not checked."""
    from radarsim.api import json_output
    from radarsim.api.maintenance.check_archive import RECOMPUTED_PIECES, check_archive
    from radarsim.cli import console, print_inventory, progress

    documents: list[dict[str, Any]] = []
    faults: list[str] = []
    refusals: list[str] = []
    not_checked: list[str] = []
    for archive in archives:
        try:
            with progress.Progress(archive, quiet=as_json) as bar:
                checked = check_archive(
                    archive, RECOMPUTED_PIECES if max_pieces is None else max_pieces, trust_code, bar.update
                )
        except (ConfigError, StoreError) as error:  # which says nothing of the other archives
            lines = faults if isinstance(error, StoreError) else refusals
            lines += error.lines
            documents.append({"archive": archive, "errors": [*error.lines]})
            continue
        for name, inspection in checked.results.items():
            faults += inspection.faults
            not_checked += [f"{archive}: {name}: {line}" for line in inspection.not_checked]
        results = {name: json_output.fields(inspection) for name, inspection in checked.results.items()}
        documents.append({"archive": archive, "sha256": checked.sha256, "files": checked.files, "results": results})
        if as_json:
            continue
        files = plural("{count} file", "{count} files", checked.files)
        console.print_line(tr("{path}: {files}, each as listed", path=archive, files=files))
        console.print_field("SHA-256", checked.sha256)
        for inspection in checked.results.values():
            print_inventory.print_inspection(inspection)
        console.print_line(f"{archive}: {print_inventory.recomputed_share(checked.results)}")
    if as_json:
        click.echo(json_output.text(documents))
    if faults:
        raise StoreError(*faults, *refusals)
    if refusals:
        raise ConfigError(*refusals)
    if not_checked:
        raise NotChecked(*not_checked)


def compare_with_archives(
    experiments: "Sequence[Experiment]", sources: "Sequence[tuple[str, Archive | None]]", out: str, quiet: bool
) -> None:
    """Say whether the tables of results that were run are those of their archives, see `loadable`. Raises StoreError
    for tables that differ, else NotChecked for one that was not computed."""
    if all(archive is None for _, archive in sources):
        return
    from radarsim.api.maintenance.check_archive import differences, has_its_counts, missing_runs_option
    from radarsim.cli import console

    faults: list[str] = []
    not_checked: list[str] = []
    for experiment, (_, archive) in zip(experiments, sources, strict=True):
        folder = Path(out) / experiment.stem
        if archive is None or not has_its_counts(archive, experiment, folder):
            continue
        equal, different = differences(archive, experiment, folder)
        faults += different
        if option := missing_runs_option(archive, experiment, folder):
            not_checked.append(
                f"{archive.path}: {experiment.stem}: runs.csv was not compared: `{option}` computes it too"
            )
        if different or quiet:
            continue
        values = {"tables": plural("{count} table", "{count} tables", len(equal)), "archive": str(archive.path)}
        values["config"] = experiment.stem
        words = (
            tr("{config}: {tables}, the same bytes as in {archive}", **values)
            if all(equal.values())
            else tr("{config}: {tables}, equal to those in {archive} to rounding", **values)
        )
        console.print_field("compared", words)
    if faults:
        raise StoreError(*faults)
    if not_checked:
        raise NotChecked(*not_checked)
