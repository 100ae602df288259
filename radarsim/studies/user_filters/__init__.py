"""Filters of the user's own beside those of a config: their code, its sources, and their sums."""
