"""Recorded plots: reading and writing files, following tracks, fitting keys, and what a recording says of a config."""
