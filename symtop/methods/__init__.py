"""Integrators: four kernel families, the one stepping loop that drives them, and the registry."""
