"""The config of an experiment with tuned filters, for the config.yaml of its result."""

from collections.abc import Mapping, Sequence
from typing import Any

from radarsim.api.changed_content import changed_content
from radarsim.config.experiment import Case, Experiment
from radarsim.config.identity import all_keys


def tuned_content(experiment: Experiment, tuned_cases: Sequence[Case]) -> dict[str, Any] | None:
    """The config of an experiment with the filters that its tuned cases have in addition; None where it cannot be
    written so."""
    members = {}
    for case, tuned in zip(experiment.cases, tuned_cases, strict=True):
        further = tuned.spec.members[len(case.spec.members) :]
        members[case.stem] = [
            {key: value for key, value in all_keys(member).items() if value is not None} for member in further
        ]
    list_key = tuned_cases[0].spec.bare_keys

    def extended(content: Mapping[str, Any]) -> dict[str, Any]:
        return {**content, list_key: [*content[list_key], *members.get(content["name"], ())]}

    return changed_content(experiment, tuned_cases, extended)
