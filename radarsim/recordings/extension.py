"""What recorded plots add to radarsim: the commands `import`, `register`, `simulate`, `track` and `fit`."""

from collections.abc import Mapping, Sequence

from radarsim.extensions import Extension


class RecordingsExtension(Extension):
    """Recorded plots: formats, filters over them, fits of σ, biases of radars."""

    command_module = "radarsim.recordings.commands"
    command_sections: Mapping[str, Sequence[str]] = {
        "Your own data": ("import", "register", "simulate", "track", "fit")
    }


EXTENSION = RecordingsExtension()
