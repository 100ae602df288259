"""The world in formulas: motion, targets, frames, sensors, signals. NumPy, no randomness, no other package."""
