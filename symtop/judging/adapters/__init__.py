"""Adapters that make foreign integrators callable as solvers."""
