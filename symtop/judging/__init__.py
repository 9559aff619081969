"""Declared properties of an integrator against measured ones."""

# what a step from elsewhere may be; here, as the command line names them before it loads a judge
FORMS = ("ode", "separable", "rotation", "scipy", "diffrax", "torch", "jax", "shared", "program")
