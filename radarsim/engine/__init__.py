"""Monte Carlo without a word of radar: blocks of realisations, sums that add, threads, a store, stopping."""
