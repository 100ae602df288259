"""The config of an experiment with tuned filters, for the config.yaml of its result."""

from collections.abc import Mapping, Sequence
from typing import Any

from radarsim.api import configs
from radarsim.config.experiment import Case, Experiment
from radarsim.config.identity import all_keys
from radarsim.errors import ConfigError


def tuned_content(experiment: Experiment, tuned_cases: Sequence[Case]) -> dict[str, Any] | None:
    """The config of an experiment with the filters that its tuned cases have in addition; None where it cannot be
    written so, as where a sweep would change these filters too."""
    if experiment.content is None:
        return None
    members = {}
    for case, tuned in zip(experiment.cases, tuned_cases, strict=True):
        further = tuned.spec.members[len(case.spec.members) :]
        members[case.stem] = [
            {key: value for key, value in all_keys(member).items() if value is not None} for member in further
        ]
    list_key = tuned_cases[0].spec.bare_keys

    def extended(content: Mapping[str, Any]) -> dict[str, Any]:
        if "include" in content:
            return {**content, "include": [extended(inner) for inner in content["include"]]}
        return {**content, list_key: [*content[list_key], *members.get(content["name"], ())]}

    content = extended(experiment.content)
    try:
        specs = [case.spec for case in configs.load(content).cases]
    except ConfigError:
        return None
    return content if specs == [case.spec for case in tuned_cases] else None
