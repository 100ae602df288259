"""Recordings of radars, transponders and ships, converted to our columns: `radarsim import`."""
