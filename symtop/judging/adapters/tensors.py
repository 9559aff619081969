"""The top's equations on arrays of torch and JAX, y of shape (..., 6) or (..., 7), in double precision.

The fields of the axis and of the attitude are arithmetic alone, so that they are what they are for floats. A library is
imported when something of it is judged.
"""

import contextlib
import importlib
from collections.abc import Iterator
from typing import Any

from symtop.core.errors import SymtopError
from symtop.methods.framework.equations import FORMULATIONS

CHARTS = ("axis", "attitude")  # the angles have sines, which each library has for itself


def library(form: str, name: str) -> Any:
    """The package `name`; SymtopError if it is not there."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SymtopError(f"form {form} needs the package {name}, which is not installed") from None


def on_these_charts(form: str, chart: str) -> str:
    """The chart; SymtopError for one whose equations are not arithmetic alone."""
    if chart not in CHARTS:
        raise SymtopError(f"chart must be axis or attitude for the form {form}, not {chart!r}")
    return chart


def field_of(chart: str, par: Any, stack: Any) -> Any:
    """f(t, y) on arrays; `stack(columns)` joins arrays of shape (...) along a new last axis."""
    field = FORMULATIONS[chart].field

    def f(_t: Any, y: Any) -> Any:
        """The time derivative of y, of the shape of y."""
        columns = tuple(y[..., k] for k in range(y.shape[-1]))
        nothing = 0.0 * columns[0]  # a derivative that is zero is a number
        return stack([value + nothing if isinstance(value, float) else value for value in field(par, columns)])

    return f


@contextlib.contextmanager
def double_precision(jax: Any) -> Iterator[None]:
    """JAX computes in double precision within, and as before after."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)
