"""Recorded plots: reading, following, judging."""
