"""Compiled: bursts, their block sums, scoring, sequences of discriminators."""
