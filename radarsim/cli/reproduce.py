"""`make reproduce-figures`: every shipped config at its full size, a line each, and what came of the papers' claims.

python -m radarsim.cli.reproduce [OUT [CONFIG…]] [--set KEY=VALUE] [--no-figures]"""

import argparse
import sys
import time
from collections.abc import Sequence

from radarsim.api.configs import config_stems
from radarsim.api.load_experiments import load_all
from radarsim.api.maintenance.reproduce import reproduce, summary
from radarsim.api.repeat_command import RESULTS
from radarsim.cli import console
from radarsim.cli.early_end import file_error
from radarsim.cli.streams import tolerant_output
from radarsim.engine.stop_conditions import Signals
from radarsim.errors import ON_COMMAND_LINE, RadarsimError


def main(arguments: Sequence[str]) -> int:
    """The shipped configs of some names, or all, into a directory; the exit code."""
    description = (__doc__ or "").partition("\n")[0]  # none with -OO
    parser = argparse.ArgumentParser(prog="python -m radarsim.cli.reproduce", description=description)
    parser.add_argument("out", nargs="?", default=RESULTS, help="directory; results where none is given")
    parser.add_argument("configs", nargs="*", help="names of configs; all where none is given")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of every config")
    parser.add_argument("--no-figures", action="store_true", help="tables, claims and reports without them")
    options, started = parser.parse_args(arguments), time.perf_counter()
    with Signals() as stop:
        try:
            loaded = load_all(options.configs or config_stems(), options.set)
            stems = list(dict.fromkeys(experiment.stem for experiment in loaded))
            finished_configs = reproduce(
                stems, options.out, console.print_line, stop, options.set, not options.no_figures
            )
            for line in summary(finished_configs, options.out, time.perf_counter() - started):
                console.print_line(line)
        except (RadarsimError, OSError) as exception:
            error = file_error(exception) if isinstance(exception, OSError) else exception
            sys.stderr.write("".join(f"{line}\n" for line in error.lines))
            return error.exit_code
    return max((config.code for config in finished_configs), default=0)


if __name__ == "__main__":
    ON_COMMAND_LINE.set(True)
    with tolerant_output():
        sys.exit(main(sys.argv[1:]))
