"""Stored results side by side: the cases that answer to one another, their differences, figures, sentences."""
