"""Recordings of radars, transponders and ships, read into our columns: `radarsim import`."""
