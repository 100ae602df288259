"""Recorded plots: reading them, filters over them, checks of the stated accuracies."""
