"""The experiment of a long run: each case lasts until its filters have settled, without a manoeuvre."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from radarsim.api.changed_content import changed_content
from radarsim.config.experiment import Case, Experiment
from radarsim.config.identity import all_keys
from radarsim.language.translate import tr
from radarsim.studies import registry


def long_experiment(experiment: Experiment) -> Experiment:
    """The experiment with its cases in the long run, all of as many scans. Raises ConfigError for a case that has none.

    It has no path: the config of its stem is another."""
    study = registry.study(experiment.study)
    long_specs = [study.in_the_long_run(case).spec for case in experiment.cases]
    scans = {"scans": max(spec.scans for spec in long_specs)}
    cases = tuple(
        replace(case, spec=spec.model_copy(update=scans))
        for case, spec in zip(experiment.cases, long_specs, strict=True)
    )
    changes = {old.stem: _changes(old, new) for old, new in zip(experiment.cases, cases, strict=True)}

    def long_content(content: Mapping[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in content.items() if key != "duration_s"} | changes[content["name"]]

    return replace(experiment, path=None, cases=cases, content=changed_content(experiment, cases, long_content))


def long_run_notes(experiments: Sequence[Experiment]) -> list[str]:
    """How long the cases of long experiments last, in words."""
    notes = []
    for experiment in experiments:
        last_s = [float(registry.study(case.study).prepare(case).axes.t_s[-1]) for case in experiment.cases]
        fields = {"stem": experiment.stem, "scans": str(experiment.cases[0].spec.scans), "t_s": max(last_s)}
        notes.append(tr("{stem}: the long run is {scans} scans without a manoeuvre, to {t_s:g} s", **fields))
    return notes


def _changes(old: Case, new: Case) -> dict[str, Any]:
    """The keys of a study that differ between two cases, as the new one has them."""
    before, after = all_keys(old.spec), all_keys(new.spec)
    return {key: value for key, value in after.items() if before.get(key) != value}
