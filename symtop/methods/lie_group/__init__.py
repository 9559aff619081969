"""Lie-group methods."""
