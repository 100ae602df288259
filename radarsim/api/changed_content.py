"""The config of an experiment whose cases were changed, for the config.yaml of its result."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from radarsim.api import configs
from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError

Content = Mapping[str, Any]


def changed_content(
    experiment: Experiment, cases: Sequence[Case], change: Callable[[Content], dict[str, Any]]
) -> dict[str, Any] | None:
    """The content of an experiment with that of each config changed, so that it describes these cases; None where it
    cannot be written so, as where a sweep would change the same keys."""
    if experiment.content is None:
        return None

    def changed(content: Content) -> dict[str, Any]:
        if "include" in content:
            return {**content, "include": [changed(inner) for inner in content["include"]]}
        return change(content)

    content = changed(experiment.content)
    try:
        specs = [case.spec for case in configs.load(content).cases]
    except ConfigError:
        return None
    return content if specs == [case.spec for case in cases] else None
