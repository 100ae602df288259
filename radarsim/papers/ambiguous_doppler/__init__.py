"""The claims of Beyond P1: folded Doppler velocity."""

from radarsim.studies.interface import Paper

PAPER = Paper("Gorshkov & Zavizhenets 2017, conclusion", page="ambiguous_doppler")
