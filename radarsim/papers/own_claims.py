"""Claims that a user writes: on a stored run of any config, and on a table that radarsim did not make."""

import codecs
import csv
import importlib.util
import os
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from radarsim.api.stored_runs import stored_result
from radarsim.config.experiment import Experiment
from radarsim.config.value_text import quoted_value
from radarsim.errors import AUTHOR_ERRORS, ConfigError
from radarsim.papers import one_file_measures, table_measures
from radarsim.papers.claim import Claim
from radarsim.papers.claim_files import parse_own_claims
from radarsim.papers.claims_table import COLUMNS, rows_of_claim
from radarsim.papers.paper_keys import claim_folders
from radarsim.papers.study_claims import claims_of
from radarsim.report import atomic_files, csv_text
from radarsim.report.tables import frame
from radarsim.studies.onefile import OneFile
from radarsim.studies.registry import study
from radarsim.user_code import errors as user_code_errors

if TYPE_CHECKING:
    import pandas as pd

TEXT = "claims"  # stands for the file of claims that are given as text


def rows_on_table(
    claims: str | os.PathLike[str],
    table: "pd.DataFrame | Mapping[str, Any] | str | os.PathLike[str]",
    measures: ModuleType | None = None,
) -> list[dict[str, Any]]:
    """The rows of claims judged on a table; see `list_claims.judge_table`."""
    own_claims = _load(claims, (table_measures,), measures)
    evidence = table_measures.TableEvidence(_as_table(table))
    return [row for claim in own_claims for row in _rows(claim, evidence, claim.config or "table")]


def _rows(claim: Claim, evidence: Any, config: str) -> list[dict[str, Any]]:
    """The rows of a claim with the columns of claims.csv, and the config, or what stands for it."""
    rows = rows_of_claim(claim, claim.paper, evidence)
    return [{name: row[name] for name in COLUMNS} | {"config": config} for row in rows]


def _as_table(table: Any) -> "pd.DataFrame":
    if isinstance(table, str | os.PathLike):
        return _read_csv(Path(table))
    if hasattr(table, "columns") and hasattr(table, "reset_index"):
        has_names = any(name is not None for name in table.index.names)
        frame_of_user: pd.DataFrame = table.reset_index() if has_names else table
        return _checked_table(frame_of_user, "table")
    if isinstance(table, Mapping):
        try:
            return frame({name: list(column) for name, column in table.items()})
        except (TypeError, ValueError) as error:
            raise ConfigError(f"table: must have columns of one length: {error}") from error
    raise ConfigError(f"table: must be a DataFrame, its columns, or a CSV file, got {type(table).__name__}")


def _read_csv(file: Path) -> "pd.DataFrame":
    try:
        content = atomic_files.read(file).removeprefix(codecs.BOM_UTF8)  # which spreadsheets write
        first_line = content.partition(b"\n")[0]
        if b"," not in first_line and (b";" in first_line or b"\t" in first_line):
            raise ConfigError(f"{file}: is no table in CSV with commas: its first line has another separator")
        return _checked_table(csv_text.from_csv(content.rstrip(b"\r\n")), f"{file}:1")
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error
    except (ValueError, csv.Error) as error:
        raise ConfigError(f"{file}: is no table in CSV with commas: {error}") from error


def _checked_table(table: "pd.DataFrame", name: str) -> "pd.DataFrame":
    """The table. Raises ConfigError where a name of a column stands twice."""
    if not table.columns.is_unique:
        twice = ", ".join(map(str, dict.fromkeys(table.columns[table.columns.duplicated()])))
        raise ConfigError(f"{name}: names of columns must differ, twice there: {twice}")
    return table


def rows_on_stored_run(
    experiment: Experiment, claims: str | os.PathLike[str], out: str | os.PathLike[str]
) -> list[dict]:
    """Rows of a user's claims, judged on the stored run of an experiment: those that name its config, or none.

    A case is found by its keys (`of: [{radar.scan_period_s: 10}]`, `{}` is the first one) or as in the claims of the
    study, whose measures there are too. Raises ConfigError where the run is not stored."""
    case_study = study(experiment.study)
    own_claims = _load(claims, (*_study_measures(case_study), one_file_measures))
    asserted = [claim for claim in own_claims if claim.config in ("", experiment.stem)]
    if not asserted:
        configs = ", ".join(dict.fromkeys(claim.config for claim in own_claims))
        raise ConfigError(f"{claims}: config: no claim is of {experiment.stem}; there are claims of {configs}")
    result = stored_result(experiment, out=out)
    paper_claims = claims_of(case_study)
    bases: list[type] = [one_file_measures.Evidence, *([paper_claims.evidence] if paper_claims else [])]
    evidence_class: Any = type("Evidence", tuple(dict.fromkeys(bases)), {})
    may_grow = paper_claims.may_grow if paper_claims else ()
    members = {case.name: {key: set(range(len(getattr(case.spec, key)))) for key in may_grow} for case in result.cases}
    evidence = evidence_class(result.cases, result.tables, members)
    return [row for claim in asserted for row in _rows(claim, evidence, experiment.stem)]


def _study_measures(case_study: Any) -> list[ModuleType]:
    """The modules with the measures of a study's own claims."""
    if isinstance(case_study, OneFile):
        return [import_module(type(case_study).__module__)]
    return [import_module(f"{package}.measures") for package, _ in claim_folders(case_study)]


def _load(
    claims: str | os.PathLike[str], modules: Iterable[ModuleType], measures: ModuleType | None = None
) -> tuple[Claim, ...]:
    """The claims of a file or a text, with the measures of these modules and of the one beside the file."""
    if not isinstance(claims, str | os.PathLike) or "\0" in os.fspath(claims):
        raise ConfigError(f"claims: must be a YAML file, or its text, got {quoted_value(claims)}")
    if isinstance(claims, str) and "\n" in claims:
        return parse_own_claims(claims, TEXT, *modules, *([measures] if measures else []))
    file = Path(claims)
    try:
        text = atomic_files.read(file).decode("utf-8")
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: is no text in UTF-8") from error
    own_modules = [measures] if measures else _module_beside(file)
    return parse_own_claims(text, str(file), *modules, *own_modules)


def _module_beside(file: Path) -> list[ModuleType]:
    """The module of the same name beside a file of claims, if there is one. Raises ConfigError where it fails."""
    path = file.with_suffix(".py")
    if not path.is_file():
        return []
    if user_code_errors.is_code_forbidden():
        raise ConfigError(f"{path}: is code of yours, and --no-code runs none")
    specification = importlib.util.spec_from_file_location(f"_radarsim_claims_{file.stem}", path)
    assert specification is not None  # the name ends in .py
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    try:
        specification.loader.exec_module(module)
    except AUTHOR_ERRORS as error:
        raise ConfigError(f"{path}: cannot be imported: {user_code_errors.error_summary(error)}") from error
    return [module]
