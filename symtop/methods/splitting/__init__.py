"""Splitting methods."""
