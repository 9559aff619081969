"""A step on batches, y of shape (batch, 6), as networks and ensembles are stepped: of torch tensors or JAX arrays.

symtop judge studies/examples/judged_batches.py:heun --form torch --order 2
symtop judge studies/examples/judged_batches.py:heun --form jax --order 2
"""


def heun(f, t, y, h):
    """Heun's method."""
    k1 = f(t, y)
    return y + h / 2 * (k1 + f(t + h, y + h * k1))
