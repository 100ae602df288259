"""Whether a result may take the place of the one that its folder holds: nothing is replaced in silence.

A result of the same settings and seed is extended; of fewer realisations, those that are stored are shown. Anything
else in its place must be asked for by `replace`."""

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path
from typing import Any

from radarsim.api import configs
from radarsim.api.case_work import CaseWork
from radarsim.api.repeat_command import out_option
from radarsim.config.experiment import Experiment
from radarsim.config.yaml_text import one_line_yaml
from radarsim.engine.store.inventory import take_inventory
from radarsim.errors import ConfigError, RadarsimError, StoreError, argument
from radarsim.language.translate import plural, tr
from radarsim.report import provenance, stored_tables

MAX_NAMED_KEYS = 3  # in a message
MAX_VALUE_CHARACTERS = 40
Path_ = str | os.PathLike[str]


@dataclass(frozen=True)
class EarlierResult:
    """The result in the folder of an experiment under `out`, as it was when its record was read; None: no record that
    can be read."""

    experiment: Experiment
    out: Path_
    record: Mapping[str, Any] | None

    @property
    def counts(self) -> dict[str, int]:
        """The realisations of each case that its tables have."""
        return {} if self.record is None else _counts(self.record)

    def check_replacement(self, judged: Sequence[str] = ()) -> None:
        """Raise ConfigError if its tables are of another study, other settings, another seed or other judged filters;
        judged: the names of those of this run."""
        if self.record is not None and (difference := _difference(self.record, self.experiment, judged)):
            raise _refusal(self.record, self.experiment, self.out, difference)

    def check_counts(self, done: Mapping[str, int]) -> None:
        """Raise ConfigError if a case of these counts has fewer realisations than its tables."""
        if self.record is not None and any(done.get(name, 0) < count for name, count in self.counts.items()):
            raise _refusal(self.record, self.experiment, self.out, tr("and this result would have fewer"))

    def larger_counts(self) -> dict[str, int]:
        """The realisations of each case of which its tables hold more than the experiment asks for. Raises ConfigError
        if their blocks are not stored, so that the tables cannot be made again."""
        counts, cases = self.counts, self.experiment.cases
        larger = {case.name: counts[case.name] for case in cases if counts.get(case.name, 0) > case.realisations}
        for case in cases:
            if case.name in larger and not has_blocks(CaseWork(case), larger[case.name], self.out):
                assert self.record is not None  # it gives the counts
                why = tr("whose blocks are not stored, and this result would have fewer")
                raise _refusal(self.record, self.experiment, self.out, why)
        return larger


def earlier_result(experiment: Experiment, out: Path_) -> EarlierResult:
    """The result that the folder of an experiment holds; its record is read once."""
    try:
        record = stored_tables.find_record(Path(out) / experiment.stem)
        return EarlierResult(experiment, out, record if record is None or _counts(record) else None)
    except StoreError:
        return EarlierResult(experiment, out, None)  # what cannot be read cannot be lost


def has_blocks(work: CaseWork, realisations: int, out: Path_) -> bool:
    """Whether so many realisations of a case are stored."""
    return not take_inventory(work, realisations, out).missing


def with_counts(experiment: Experiment, counts: Mapping[str, int]) -> Experiment:
    """The experiment with other numbers of realisations for some cases."""
    cases = tuple(replaced(case, realisations=counts.get(case.name, case.realisations)) for case in experiment.cases)
    return replaced(experiment, cases=cases, realisations=max(case.realisations for case in cases))


def larger_counts_note(experiment: Experiment, counts: Mapping[str, int], out: Path_) -> str:
    """A sentence on stored realisations that are shown in place of fewer."""
    return tr(
        "{config}: {stored} are stored in {out} and shown in place of {asked}; {option} writes tables of {asked}",
        config=experiment.stem,
        stored=provenance.realisations_text(sorted({*counts.values()})),
        asked=provenance.span(sorted({case.realisations for case in experiment.cases if case.name in counts})),
        out=os.fspath(out),
        option=argument("replace=True", "--replace"),
    )


def _counts(record: Mapping[str, Any]) -> dict[str, int]:
    """The realisations of each case that a record says are done."""
    return {name: case["done"] for name, case in record["cases"].items()}


def _difference(record: Mapping[str, Any], experiment: Experiment, judged: Sequence[str]) -> str:
    """In what a stored result differs from one of an experiment, in words; empty if in nothing but realisations."""
    if record.get("study") != experiment.study:
        return tr("of study {stored}, not {wanted}", stored=str(record.get("study")), wanted=experiment.study)
    if sorted(record.get("judged", ())) != sorted(judged):
        names = ", ".join(record.get("judged", ())) or tr("no judged filter")
        return tr("with {stored}, not {wanted}", stored=names, wanted=", ".join(judged) or tr("no judged filter"))
    if not provenance.is_same_config(record["resolved"], experiment.resolved):
        return tr("of other settings: {keys}", keys=_changed_keys(record["resolved"], experiment.resolved))
    seeds = {case.name: case.seed for case in experiment.cases}
    for name, case in record["cases"].items():
        if case.get("seed") != seeds[name]:
            return tr("of seed {stored}, not {wanted}", stored=case.get("seed"), wanted=seeds[name])
    return ""


def _changed_keys(stored: Mapping[str, Any], requested: Mapping[str, Any]) -> str:
    """The first keys in which two resolved configs differ, with the values of each."""
    stored_cases, cases = ({case["case"]: case for case in resolved["cases"]} for resolved in (stored, requested))
    if stored_cases.keys() != cases.keys():
        names = [*(name for name in cases if name not in stored_cases), *(n for n in stored_cases if n not in cases)]
        return tr("other cases, such as {name}", name=names[0])
    labels = ("case", "swept", "realisations", "seed")
    pairs = ((stored_cases[name], case) for name, case in cases.items())
    changes = dict.fromkeys(line for pair in pairs for line in _differences(*pair) if line.split(" ")[0] not in labels)
    lines = list(changes)
    omitted = len(lines) - MAX_NAMED_KEYS
    return ", ".join([*lines[:MAX_NAMED_KEYS], *([tr("{count} more", count=omitted)] if omitted > 0 else [])])


def _differences(stored: object, requested: object, path: str = "") -> Iterator[str]:
    """Lines on the keys in which plain data differ."""
    if isinstance(stored, dict) and isinstance(requested, dict):
        for key in dict.fromkeys((*stored, *requested)):
            yield from _differences(stored.get(key), requested.get(key), f"{path}.{key}".strip("."))
    elif isinstance(stored, list) and isinstance(requested, list) and len(stored) == len(requested):
        for i, (item, requested_item) in enumerate(zip(stored, requested, strict=True)):
            yield from _differences(item, requested_item, f"{path}.{i}".strip("."))
    elif stored != requested:
        yield tr("{key} {stored}, not {wanted}", key=path, stored=_value_text(stored), wanted=_value_text(requested))


def _value_text(value: object) -> str:
    text = tr("none") if value is None else one_line_yaml(value)
    return text if len(text) <= MAX_VALUE_CHARACTERS else text[:MAX_VALUE_CHARACTERS] + "…"


def _refusal(record: Mapping[str, Any], experiment: Experiment, out: Path_, difference: str) -> ConfigError:
    """The error that a result would replace another one, and how that is kept or brought back."""
    folder = Path(out) / experiment.stem
    counts = sorted({*_counts(record).values()})
    sentence = plural(
        "{folder} holds tables of {count} realisation {difference}",
        "{folder} holds tables of {count} realisations {difference}",
        max(counts),
        folder=str(folder),
        count=provenance.span(counts),
        difference=difference,
    )
    replace_option, out_argument = argument("replace=True", "--replace"), argument("out", "--out")
    remedy = tr("give {out} another directory, or {replace} to replace them", out=out_argument, replace=replace_option)
    return ConfigError(f"{sentence}; {remedy}; {_way_back(record, out, folder)}")


def _way_back(record: Mapping[str, Any], out: Path_, folder: Path) -> str:
    """How the tables of a record are brought back after they were replaced, or kept."""
    command = str(record.get("command", ""))
    if _gives(command, record, folder):
        return tr("`{command}` brings them back", command=f"{command}{out_option(out)} --replace")
    copy = shlex.join(["cp", "-r", str(folder), f"{folder}-before"])
    return tr("`{command}` keeps them", command=copy)


def _gives(command: str, record: Mapping[str, Any], folder: Path) -> bool:
    """Whether a recorded command still runs what its record says after the result in its folder is replaced."""
    try:
        words = shlex.split(command)
        program, verb, config, *options = words
        pairs = dict.fromkeys(zip(options[::2], options[1::2], strict=True))
        keys = {"-n": "realisations=", "--seed": "seed=", "--set": ""}
        overrides = [keys[option] + value for option, value in pairs if option in keys]
        experiment = configs.load(config, overrides)
        is_run = (program, verb) == ("radarsim", "run")
        is_replaced = folder.resolve() in Path(config).resolve().parents  # config.yaml of this very result
        return is_run and not is_replaced and provenance.is_same_config(record["resolved"], experiment.resolved)
    except (RadarsimError, ValueError, LookupError, TypeError):
        return False
