"""The claims of Beyond P1 and P4: from bursts to tracks."""

from radarsim.studies.interface import Paper

PAPER = Paper("Uss, Baryshev & Djavad 2010, into Gorshkov & Zavizhenets 2017", page="pulses_to_tracks")
