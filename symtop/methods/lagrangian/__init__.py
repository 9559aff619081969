"""Discrete Lagrangians."""
