"""One block of realisations, compiled: bursts estimated eight at a time, filters, sums."""
