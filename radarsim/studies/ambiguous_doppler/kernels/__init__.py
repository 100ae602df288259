"""One block of realisations, compiled: folded plots, filters that share their gains, hypotheses on folds."""
