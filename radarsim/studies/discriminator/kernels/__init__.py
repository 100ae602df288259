"""P4's kernels: bursts, scoring, sequences of discriminators."""
