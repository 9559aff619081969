"""Integrators of other libraries, and the closed form as one."""
