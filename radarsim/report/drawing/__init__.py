"""Figures: their description, and how Matplotlib draws them."""
