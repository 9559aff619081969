"""Declared properties of an integrator against measured ones."""
