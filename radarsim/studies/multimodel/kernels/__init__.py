"""P2's kernels: hypotheses of nine states on lanes, families and merging rules."""
