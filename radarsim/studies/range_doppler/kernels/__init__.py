"""P1's own kernels, beside the shared linear ones."""
