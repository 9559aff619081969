"""Declared properties of an integrator against measured ones."""

# the forms of a foreign step; defined here so that the command line need not import the rest of the package
FORMS = ("ode", "separable", "rotation", "scipy", "diffrax", "torch", "jax", "shared", "program", "server")
