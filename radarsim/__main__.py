"""`python -m radarsim` is the command `radarsim`."""

from radarsim.cli import main

main()
