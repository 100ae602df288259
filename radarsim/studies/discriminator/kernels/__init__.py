"""Sums over the errors of bursts, and the weights of bursts that are drawn where locks are lost."""
