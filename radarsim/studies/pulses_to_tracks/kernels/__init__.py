"""One block of realisations, compiled: bursts, their estimates, and the tracks from these."""
