"""`radarsim new`: a config of one's own, written once and never over another."""

import os
from pathlib import Path

from radarsim.config import load
from radarsim.config.faults import Faults, one_line
from radarsim.config.lookup import is_stem
from radarsim.config.schema import Studies
from radarsim.config.starter import starter
from radarsim.errors import ConfigError, StoreError


def new(name: str, like: str | os.PathLike[str], studies: Studies, folder: str | os.PathLike[str] = ".") -> Path:
    """Write folder/NAME.yaml, the suffix given or not, after a known config; its path.

    Raises ConfigError where it is there already.
    """
    name = name.removesuffix(".yaml")
    if not is_stem(name):
        raise ConfigError(
            f"{one_line(name)}: must be a plain name of letters, digits and _ + = - . without folder or suffix, that "
            "begins with a letter, a digit or _"
        )
    path = Path(folder) / f"{name}.yaml"
    experiment = load.load(like, (), studies)
    faults = Faults()
    document = load.read(Path(experiment.path or like), faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is a fault
    text = starter(document.data, studies.keys(experiment.study), name, experiment.stem)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise ConfigError(f"{path}: is there already and is never overwritten; choose another name") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    return path
