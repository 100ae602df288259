"""P3: smoothing and extrapolation."""
