"""The command as a user types it, and what it leaves in a folder of results."""

import io
import json
import os

from click.testing import CliRunner

from radarsim.cli.command_group import main
from radarsim.kernels.cache import cache_root


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self):
        return True


def command(*words, code=0):
    """The command's result, after its exit code is checked, unless `...` is given; words are written out as in a
    shell."""
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert code in (..., result.exit_code), result.output
    return result


def printed(*words):
    """What the command prints when all is well."""
    return command(*words).stdout


def csv_bytes(folder):
    """The bytes of all tables of a result folder, by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.csv"))}


def record(folder):
    """What run.json of a result folder holds."""
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def newcomer(home, **more):
    """The environment of somebody who has set nothing, with an empty home but a filled cache of kernels."""
    given = {"PATH": os.defpath, "HOME": str(home), "LANG": "C.UTF-8", "RADARSIM_CACHE_DIR": str(cache_root())}
    return given | more
