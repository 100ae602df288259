"""`radarsim new`: a config of one's own, after another."""

import os
from pathlib import Path

from radarsim.config import load
from radarsim.config.faults import Faults, one_line
from radarsim.config.lookup import RESERVED, is_reserved, is_stem
from radarsim.config.schema import Studies
from radarsim.config.starter import starter
from radarsim.errors import ConfigError


def new(name: str, like: str | os.PathLike[str], studies: Studies) -> tuple[str, str]:
    """The name of the file of a new config, NAME with the suffix given or not, and its text, after a known config.

    Raises ConfigError for a name that a config cannot have.
    """
    name = name.removesuffix(".yaml")
    if is_reserved(name):
        raise ConfigError(f"{name}: {RESERVED}")
    if not is_stem(name):
        raise ConfigError(
            f"{one_line(name)}: must be a plain name of letters, digits and _ + = - . without folder or suffix, that "
            "begins with a letter, a digit or _"
        )
    experiment = load.load(like, (), studies)
    faults = Faults()
    document = load.read(Path(experiment.path or like), faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is a fault
    return f"{name}.yaml", starter(document.data, studies.keys(experiment.study), name, experiment.stem)
