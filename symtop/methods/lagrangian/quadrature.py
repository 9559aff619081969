"""Quadrature rules on [0, 1], from which discrete Lagrangians are made: nodes a_i, weights w_i with sum w = 1."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from symtop.core.errors import SymtopError, row


class Quadrature(NamedTuple):
    """Nodes and weights of a rule on [0, 1], and the stop rule of its Newton iteration.

    The iteration stops after a correction below `tolerance` times the step's increment. Newton converges
    quadratically and the last correction is applied to first order, so 1e-8 leaves only rounding.
    """

    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    tolerance: float = 1e-8
    iterations: int = 50


class Rule(NamedTuple):
    """A built-in method: the arguments of `discrete_lagrangian` beside its name."""

    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    order: int
    summary: str


RULES = {
    "midpoint": Rule((0.5,), (1.0,), 2, "discrete Lagrangian, midpoint rule"),
    "trapezoidal": Rule((0.0, 1.0), (0.5, 0.5), 2, "discrete Lagrangian, trapezoidal rule"),
    "simpson-linear": Rule(
        (0.0, 0.5, 1.0), (1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0), 2,
        "discrete Lagrangian, Simpson's rule on a straight line (order 2: the line limits it)",
    ),
}  # fmt: skip


def quadrature(nodes: Sequence[float], weights: Sequence[float]) -> tuple[Quadrature, bool]:
    """The checked rule with its nodes in order, and whether it reads the same from both ends."""
    points, shares = tuple(row("nodes", nodes)), tuple(row("weights", weights))
    if len(points) != len(shares) or not points:
        raise SymtopError(f"nodes and weights must be equally many, at least one, not {len(points)} and {len(shares)}")
    if not all(0.0 <= node <= 1.0 for node in points):
        raise SymtopError(f"nodes must lie in [0, 1], not {points}")
    if abs(math.fsum(shares) - 1.0) > 1e-14:
        raise SymtopError(f"weights must sum to 1, not {math.fsum(shares)!r}")
    pairs = sorted(zip(points, shares, strict=True))
    mirror = sorted((1.0 - node, share) for node, share in pairs)
    symmetric = all(abs(a - c) + abs(b - d) < 1e-15 for (a, b), (c, d) in zip(pairs, mirror, strict=True))
    points, shares = (tuple(column) for column in zip(*pairs, strict=True))
    return Quadrature(points, shares), symmetric
