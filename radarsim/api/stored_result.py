"""`radarsim.load`: a stored result, from its blocks, or from its tables alone where these are not there."""

import os
import warnings
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import repeat_command as api_repeat_command
from radarsim.api import replacement
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import Config, Overrides
from radarsim.api.result import Result
from radarsim.api.result_content import question_text
from radarsim.api.result_folder import ResultFolder, choose_result
from radarsim.api.stored_runs import stored_result
from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError, StoreError, count_text
from radarsim.extensions import extensions

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as Canvas

    from radarsim.api.write_result import WrittenFiles
    from radarsim.report.drawing.model import Figure


class StoredCase:
    """A case of a result of which only the tables are there: its name and its realisations."""

    def __init__(self, name: str, count: int):
        self.name, self.count = name, count
        self.further_baselines: tuple[()] = ()
        self.user_filters = None

    def __repr__(self) -> str:
        return f"<case {self.name}: {count_text(self.count)} realisations>"


class TableResult(Result):
    """A result of which only run.json and tables are there: everything but figures, which need the stored blocks."""

    def __init__(self, stored: ResultFolder):
        experiment = stored.experiment or _experiment_of_record(stored)
        cases: Any = [StoredCase(name, count) for name, count in stored.files.counts.items()]
        super().__init__(experiment, cases, {**stored.record, "warnings": list(stored.record.get("warnings", ()))})
        self.stored = stored

    @cached_property
    def _tables(self) -> "dict[str, pd.DataFrame]":
        tables = {name: self.stored.files.table(name) for name in self.stored.files.table_names}
        found = {name: table for name, table in tables.items() if table is not None}
        for extension in extensions():
            found |= extension.stored_tables(found, str(self.stored.record["study"]))
        return found

    @property
    def tables(self) -> "dict[str, pd.DataFrame]":
        return {name: self._described(table.copy()) for name, table in self._tables.items()}

    @property
    def curves(self) -> "pd.DataFrame":
        return self.tables["curves"]

    @property
    def gains(self) -> "pd.DataFrame":
        return self.tables["gains"]

    @property
    def question(self) -> str:
        return question_text(self.experiment) if self.experiment.cases else ""

    @cached_property
    def answer(self) -> tuple[str, ...]:
        return tuple(map(str, self.stored.record.get("answer", ())))

    @property
    def warnings(self) -> list[str]:
        return list(self.facts["warnings"])

    @cached_property
    def _config(self) -> str:
        return self.stored.config

    @cached_property
    def faults(self) -> tuple[str, ...]:
        return ()

    @cached_property
    def _figures_by_name(self) -> "dict[str, Figure]":
        return {}

    def figure(self, name: str = "", *, ax: Any = None, label: str | None = None) -> "Canvas":
        """Raises ConfigError: figures are drawn from the stored blocks."""
        raise ConfigError(f"{self.stored.folder}: figures need the stored blocks; of this result only tables are there")

    def write(self, *arguments: Any, **options: Any) -> "WrittenFiles":
        """Raises ConfigError: without blocks there is nothing to write but what the folder holds."""
        raise ConfigError(f"{self.stored.folder}: of this result only tables are there; copy the folder instead")


def load(
    config: Config, *, out: str | os.PathLike[str] = api_repeat_command.RESULTS, overrides: Overrides = ()
) -> Result:
    """Load a stored result; computes and writes nothing.

    config is the folder of a result, or, for results in `out`, a name, a path or the other configs that `run` takes. Of
    a folder or a name without overrides the result is as it stands in its folder, whatever its settings were; where
    its blocks are not there, from its tables alone, without figures. A name means the result in `out`, else that in a
    folder here, else a config; a Python warning says what else it could mean. With a path or with overrides it is the
    result of that config, of as many realisations as the last run reported unless overrides say. `write` makes tables,
    figures and report, as `radarsim report` does. Raises ConfigError, with the command to run, if something is missing.

    >>> import radarsim, tempfile
    >>> with tempfile.TemporaryDirectory() as out:
    ...     ran = radarsim.run("rls2", realisations=2000, out=out, figures=False)
    ...     loaded = radarsim.load(f"{out}/rls2")
    >>> loaded.curves.equals(ran.curves)
    True
    """
    if isinstance(config, str | os.PathLike) and not overrides:
        stored, note = choose_result(config, out)
        if note:
            warnings.warn(note, stacklevel=2)
        if stored is not None:
            return read_result(stored)
    return stored_result(config, out=out, overrides=overrides)


def read_result(stored: ResultFolder) -> Result:
    """The result in a folder: from its blocks if they are there, else from its tables."""
    experiment, folder = stored.experiment, Path(os.path.abspath(stored.folder))
    if experiment is not None and experiment.stem != folder.name:
        folder = Path(os.path.realpath(folder))  # a link may have another name
    if experiment is None or stored.record.get("judged") or experiment.stem != folder.name:
        return TableResult(stored)
    counted = replacement.with_counts(experiment, stored.files.counts)
    try:
        has_blocks = all(
            replacement.has_blocks(CaseWork(case), case.realisations, folder.parent)
            for case in counted.cases
            if case.realisations
        )
    except StoreError:
        has_blocks = False
    return stored_result(counted, out=folder.parent, overrides=()) if has_blocks else TableResult(stored)


def _experiment_of_record(stored: ResultFolder) -> Experiment:
    """The experiment of a result without a config that reads: its cases as far as run.json tells them."""
    record = stored.record
    cases = tuple(stored.cases.values())
    name, study, count = str(record.get("config")), str(record.get("study")), max([*stored.files.counts.values(), 0])
    return Experiment(name, study, None, cases, count, int(record["seed"]))
