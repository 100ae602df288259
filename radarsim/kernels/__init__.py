"""Compiled arithmetic on arrays: no classes, no files, no randomness but the counter-based one of `random`."""
