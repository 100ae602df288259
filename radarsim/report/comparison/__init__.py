"""The comparison of two runs: its table, figures and sentences."""
