"""P3's kernels that its three studies share."""
