"""Monte Carlo without any radar: blocks of realisations, additive sums, threads, a store, stopping."""
