"""The command `radarsim`: parse, call one function, print; a file for each part of `radarsim --help`."""

import gc
import os

from radarsim.cli.command_group import main
from radarsim.cli.streams import tolerant_output

# Matrices here are of a few rows: where other processes run too, a second thread of OpenBLAS made a Riccati equation
# cost 15 times its processor time. It reads this when NumPy loads it, which is not yet.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__all__ = ["entry", "main"]


def entry() -> None:
    """The console script: `main`, whose output may be written anywhere or nowhere."""
    gc.set_threshold(100_000)  # a tenth of a start went into collecting objects of Numba and pandas that stay
    with tolerant_output():
        main()
