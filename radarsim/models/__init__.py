"""The world in formulas: motion, targets, frames, sensors, signals. NumPy, no randomness, nothing of the other packages."""
