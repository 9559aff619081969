"""Integrators: the families of kernels, the one stepping loop that drives them, and the registry."""
