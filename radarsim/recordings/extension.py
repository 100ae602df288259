"""What recorded plots add to radarsim: the commands `import`, `register`, `simulate`, `track` and `fit`."""

from collections.abc import Mapping

from radarsim.extensions import Extension


class RecordingsExtension(Extension):
    """Recorded plots: formats, filters over them, fits of σ, biases of radars."""

    command_sections: Mapping[str, Mapping[str, str]] = {
        "Your own data": dict.fromkeys(
            ("import", "register", "simulate", "track", "fit"), "radarsim.recordings.commands"
        )
    }


EXTENSION = RecordingsExtension()
