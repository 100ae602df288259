"""Kernels of tracks among false plots."""
