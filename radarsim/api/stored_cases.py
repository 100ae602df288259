"""The cases of earlier results as today's program reads them, from their run.json."""

import hashlib
import importlib.metadata
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from radarsim.api import configs
from radarsim.api.configs import load
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError, RadarsimError
from radarsim.report import provenance, stored_tables

LABEL_KEYS = ("case", "swept")  # of a resolved case: no keys of a config


def stored_experiment(record: Mapping, folder: Path) -> Experiment | None:
    """The experiment of a result as its config.yaml has it; None where there is none, or not that of the record."""
    try:
        text = stored_tables.read_content(folder / CONFIG_FILE)
        if text is None or hashlib.sha256(text).hexdigest() != record["outputs"].get(CONFIG_FILE):
            return None
        experiment = load(folder / CONFIG_FILE)
        return experiment if provenance.is_same_config(record["resolved"], experiment.resolved) else None
    except (RadarsimError, LookupError, TypeError):
        return None


def missing_packages(record: Mapping) -> str:
    """The packages that a result names and that are not installed, with versions, as a phrase that says what to do;
    empty where there is none."""
    missing = []
    for name, package in record.get("packages", {}).items():
        try:
            importlib.metadata.version(name)
        except (importlib.metadata.PackageNotFoundError, ValueError):
            missing.append(f"{name} {package['version']} (SHA-256 of its sources: {package['sha256']})")
    return f"install the package that computed it: {', '.join(missing)}" if missing else ""


def config_faults(record: Mapping, folder: Path) -> list[str]:
    """In what config.yaml of a result of this version differs from its record, though its hash is recorded."""
    if record.get("judged") or record.get("versions", {}).get("radarsim") != provenance.versions()["radarsim"]:
        return []
    path = folder / CONFIG_FILE
    try:
        text = stored_tables.read_content(path)
        if text is None or hashlib.sha256(text).hexdigest() != record["outputs"].get(CONFIG_FILE):
            return []  # which is a fault of an output
        experiment = load(path)
    except ConfigError:
        return []  # as without the package of its study
    if not provenance.is_same_config(record["resolved"], experiment.resolved):
        return [f"{path}: is not the config of run.json"]
    done = {name: (case["done"], case.get("seed")) for name, case in record["cases"].items() if case["done"]}
    if done != {case.name: (case.realisations, case.seed) for case in experiment.cases if case.name in done}:
        return [f"{path}: has other cases, realisations or seeds than run.json"]
    return []


def recomputable_experiment(record: Mapping, folder: Path) -> Experiment:
    """The experiment of a result with the realisations of each case that its tables hold. Where an earlier version
    wrote no config.yaml, its cases are as run.json resolved them. Raises ConfigError where it cannot be read."""
    if judged := record.get("judged"):
        raise ConfigError(f"{folder}: a result does not contain the estimates of its judged filter {', '.join(judged)}")
    if CONFIG_FILE in record["outputs"]:
        experiment = stored_experiment(record, folder)
        if experiment is None:
            load(folder / CONFIG_FILE)  # which says why
            raise ConfigError(f"{folder / CONFIG_FILE}: is not the config of this result")
    else:
        cases = [_recorded_case(folder, record, resolved) for resolved in record["resolved"]["cases"]]
        file = configs.shipped_file(record["config"])
        path = str(file) if file else None
        experiment = Experiment(record["config"], record["study"], path, tuple(cases), 0, record["seed"])
    done = {name: case["done"] for name, case in record["cases"].items()}
    if unknown := sorted({*done} - {case.name for case in experiment.cases}):
        raise ConfigError(f"{folder}: its config has no case {unknown[0]}")
    counted = [replace(case, realisations=done.get(case.name, 0)) for case in experiment.cases]
    return replace(experiment, cases=tuple(counted))


def _recorded_case(folder: Path, record: Mapping, resolved: Mapping) -> Case:
    """A case of a result without a config."""
    case = stored_case(record, resolved["case"])
    if case is None:
        raise ConfigError(f"{folder}: {resolved['case']}: this version does not read its config")
    swept = tuple(resolved["swept"].items())
    return replace(case, name=resolved["case"], stem=record["config"], swept_values=swept)


def stored_case(record: Mapping, name: str, experiment: Experiment | None = None) -> Case | None:
    """A case of a result as its config has it, if that is known, else as run.json resolved it; None where it no longer
    reads as a config."""
    for case in experiment.cases if experiment is not None else ():
        if case.name == name:
            return case
    try:
        for resolved in record["resolved"]["cases"]:
            if resolved["case"] == name:
                keys = {key: value for key, value in resolved.items() if key not in LABEL_KEYS}
                return load({"study": record["study"], **keys}).cases[0]
    except (RadarsimError, LookupError, TypeError):
        pass
    return None


def cases_of_result(record: Mapping, folder: Path) -> list[tuple[str, Case]]:
    """The cases of a result with their names, as far as they read as configs."""
    experiment = stored_experiment(record, folder)
    cases = [(name, stored_case(record, name, experiment)) for name in record["cases"]]
    return [(name, case) for name, case in cases if case is not None]


def stored_cases(out: Path) -> list[tuple[str, Case]]:
    """The cases of all results in a directory with their names there, as far as they read as configs. Raises StoreError
    for a damaged run.json."""
    folders = [path.parent for path in sorted(out.glob("*/run.json"))]
    records = [(folder, stored_tables.find_record(folder)) for folder in folders]
    return [pair for folder, record in records if record for pair in cases_of_result(record, folder)]
