"""Every YAML key: the common ones here, each study's own in a file of its name beside this one.

To add a study: write config/<study>.py with one subclass of `fields.Study` (parts from fields.py, every field with a
description, units in the keys, fields marked with Display, Design, Scenario or NameIn), and add its line to STUDIES.
"""

from importlib import import_module
from typing import Annotated

from pydantic import Field

from radarsim.config.fields import Anything, Flag, Model, Name, Stem, Study, whole

STUDIES = {
    "range_doppler": "radarsim.config.range_doppler:RangeDoppler",
    "multimodel": "radarsim.config.multimodel:Multimodel",
    "sonar": "radarsim.config.sonar:Sonar",
    "discriminator": "radarsim.config.discriminator:Discriminator",
}
LARGEST_REALISATIONS = 10**12
LARGEST_SEED = 2**64 - 1


class Common(Model):
    """Keys that every config may have, whatever its study."""

    study: Stem | None = Field(None, description="the study, which decides the other keys")
    include: Annotated[tuple[Stem, ...], Field(min_length=1)] | None = Field(
        None, description="stems of other configs, to be run together in place of an experiment of one's own"
    )
    sweep: Annotated[dict[str, Annotated[tuple[Anything, ...], Field(min_length=1)]], Field(min_length=1)] | None = (
        Field(None, description="a case for each combination of values: key or dotted path, and its list of values")
    )
    realisations: whole(1, LARGEST_REALISATIONS) | None = Field(
        None, description="how often the experiment is repeated"
    )
    seed: whole(0, LARGEST_SEED) | None = Field(None, description="seed of the noise; default 1")
    figures: dict[Name, Annotated[tuple[Name, ...], Field(min_length=1)]] = Field(
        {}, description="for a figure the cases it shows: names, or patterns with * and ?"
    )
    control_variate: Flag = Field(
        False,
        description="a further table, controlled.csv: σ of each filter with the baseline, exactly known, as control",
    )


COMMON_KEYS = tuple(Common.model_fields)


def study_model(name: str) -> type[Study]:
    """The schema of a study, imported when first asked for."""
    module, _, model = STUDIES[name].partition(":")
    return getattr(import_module(module), model)
