"""The single case of an experiment, and its study's interface to recorded plots."""

from typing import Literal

from radarsim.config.case_choice import case_choice
from radarsim.config.experiment import Case, Experiment
from radarsim.config.foreign_keys import foreign_keys
from radarsim.errors import ConfigError
from radarsim.studies.recording_interface import RecordingInterface
from radarsim.studies.registry import module as home_of
from radarsim.studies.registry import study


def recording_interface(case: Case) -> RecordingInterface:
    """The recorded-plots interface of a case's study, which `single_case` has checked for."""
    interface = study(case.study).recording_interface()
    assert interface is not None
    return interface


InterfacePart = Literal["tracker", "simulated", "drawing", "likelihood"]


def unknown_inherited_keys(case: Case, part: InterfacePart) -> list[str]:
    """The keys of a case, dotted, that an inherited part of its study's interface does not know.

    That happens where the keys of a study extend those of the study from which it inherits."""
    interface = recording_interface(case)
    module = getattr(interface, part).__module__
    if module == RecordingInterface.__module__ or interface.of_any_keys:  # the default of no study
        return []
    if f"{module}.".startswith(f"{home_of(case.study)}."):  # of the study itself
        return []
    packages = module.split(".")
    return foreign_keys(case.spec, ".".join(packages[:3] if packages[0] == "radarsim" else packages[:1]))


def refuse_inherited_part(case: Case, part: InterfacePart) -> None:
    """Raise ConfigError if an inherited part of a study's interface would ignore keys that it does not know."""
    if keys := unknown_inherited_keys(case, part):
        module = getattr(recording_interface(case), part).__module__
        raise ConfigError(
            f"study {case.study}: its part `{part}` of recorded plots is that of {module}, which does not know "
            f"{', '.join(keys)}: it must have one of its own"
        )


def single_case(experiment: Experiment, purpose: str, command: str) -> Case:
    """The only case of an experiment, of a study with plots; raises ConfigError.

    purpose and command are for the message, which lists the choices; {} in the command is the config."""
    config_name = experiment.path or experiment.stem
    if len(experiment.cases) > 1:
        count = len(experiment.cases)
        choices = case_choice(experiment, command)
        raise ConfigError(f"{config_name}: must be one case to {purpose}, got {count}; {choices}")
    (case,) = experiment.cases
    if study(case.study).recording_interface() is None:
        if purpose == "simulate":
            raise ConfigError(f"{config_name}: study: {case.study} draws no plots: its filters take bursts of pulses")
        raise ConfigError(f"{config_name}: study: {case.study} has no filters for recorded plots")
    return case
