"""The world in formulas: motion, targets, frames."""
