"""`make reproduce-figures`: every shipped config at its full size, a line each, and what came of the papers' claims.

python -m radarsim.cli.reproduce [OUT [CONFIG…]] [--set KEY=VALUE] [--no-figures]"""

import argparse
import sys
import time
from collections.abc import Sequence

from radarsim.app.configs import RESULTS
from radarsim.app.reproduce import reproduce, summary
from radarsim.app.run import load_all
from radarsim.cli import console
from radarsim.cli.group import file_fault
from radarsim.cli.streams import tolerant_output
from radarsim.config import document
from radarsim.engine.run import Signals
from radarsim.errors import ON_COMMAND_LINE, RadarsimError


def main(arguments: Sequence[str]) -> int:
    """The shipped configs of some names, or all, into a directory; the exit code."""
    about = (__doc__ or "").partition("\n")[0]  # none with -OO
    parser = argparse.ArgumentParser(prog="python -m radarsim.cli.reproduce", description=about)
    parser.add_argument("out", nargs="?", default=RESULTS, help="directory; results where none is given")
    parser.add_argument("configs", nargs="*", help="names of configs; all where none is given")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of every config")
    parser.add_argument("--no-figures", action="store_true", help="tables, claims and reports without them")
    asked, started = parser.parse_args(arguments), time.perf_counter()
    with Signals() as stop:
        try:
            loaded = load_all(asked.configs or document.stems("configs"), asked.set)
            stems = list(dict.fromkeys(one.stem for one in loaded))
            done = reproduce(stems, asked.out, console.say, stop, asked.set, not asked.no_figures)
            for line in summary(done, asked.out, time.perf_counter() - started):
                console.say(line)
        except (RadarsimError, OSError) as caught:
            error = file_fault(caught) if isinstance(caught, OSError) else caught
            sys.stderr.write("".join(f"{line}\n" for line in error.lines))
            return error.exit_code
    return max((one.code for one in done), default=0)


if __name__ == "__main__":
    ON_COMMAND_LINE.set(True)
    with tolerant_output():
        sys.exit(main(sys.argv[1:]))
