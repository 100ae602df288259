"""`python -m radarsim` is the command `radarsim`."""

from radarsim.cli import entry

entry()
