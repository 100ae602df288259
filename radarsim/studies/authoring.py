"""All that a study or a filter of a package is made with, in one module to import from.

The names are stable: docs/reference/stability.md."""

from radarsim.config.cross_checks import check_error, cross_check
from radarsim.config.key_types import (
    Flag,
    Name,
    NonNegative,
    Number,
    Positive,
    Probability,
    WholeNumber,
    key,
    whole_number,
)
from radarsim.config.marks import DesignMark, DisplayMark
from radarsim.config.model import Model
from radarsim.config.radial_keys import TimedStudyKeys
from radarsim.config.study_keys import Baseline, Member, Members, StudyKeys
from radarsim.kernels.formula_functions import atan2, cos, exp, log, sin, wrap_angle
from radarsim.kernels.small_matrices import congruence, dot, times, update
from radarsim.kernels.tracing import maximum, minimum, sqrt, where
from radarsim.physics.motion import process_noise, transition
from radarsim.report.quantities import Component, Quantity
from radarsim.studies.interface import Paper, Study
from radarsim.studies.linear import LinearStudy, Motion
from radarsim.studies.onefile import MeasuredColumn
from radarsim.studies.plot_arrays import World
from radarsim.studies.stepwise import Steps, StepStudy

__all__ = [
    "Baseline",
    "Component",
    "DesignMark",
    "DisplayMark",
    "Flag",
    "LinearStudy",
    "MeasuredColumn",
    "Member",
    "Members",
    "Model",
    "Motion",
    "Name",
    "NonNegative",
    "Number",
    "Paper",
    "Positive",
    "Probability",
    "Quantity",
    "StepStudy",
    "Steps",
    "Study",
    "StudyKeys",
    "TimedStudyKeys",
    "WholeNumber",
    "World",
    "atan2",
    "check_error",
    "congruence",
    "cos",
    "cross_check",
    "dot",
    "exp",
    "key",
    "log",
    "maximum",
    "minimum",
    "process_noise",
    "sin",
    "sqrt",
    "times",
    "transition",
    "update",
    "where",
    "whole_number",
    "wrap_angle",
]
