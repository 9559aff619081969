"""The order conditions of a Butcher table, by rooted trees: its order without a run.

A Runge-Kutta method with the table (A, b) has order p if and only if, for every rooted tree t of at most p vertices,

    sum_i b_i Phi_i(t) = 1/gamma(t),        Phi_i([t1 .. tm]) = prod_k sum_j a_ij Phi_j(tk),        Phi_i(.) = 1,

with the density gamma([t1 .. tm]) = |t| gamma(t1) .. gamma(tm). There are 1, 1, 2, 4, 9, 20 trees of 1 .. 6 vertices.
A tree is the sorted tuple of the trees at its root. The conditions are those of order for every equation: one that has
a higher order on the top alone (whose f is quadratic in the space frame) is not seen here.
Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, theorem II.2.13.
"""

import functools
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

MET = 1e-12  # a condition that is off by less is met: coefficients come with 15 digits or more
MOST = 6  # vertices of the trees that are tried

Tree = tuple[Any, ...]


class Conditions(NamedTuple):
    """What the conditions of a table are off by: the largest of each number of vertices, from 1 on."""

    defect: tuple[float, ...]

    @property
    def order(self) -> int:
        """The order of the table, at most `MOST`."""
        return next((k for k, value in enumerate(self.defect) if not value <= MET), len(self.defect))

    def words(self, power: int) -> str:
        """What they say of the order `power`."""
        if self.order < min(power, len(self.defect)):
            return f"its table misses a condition of order {self.order + 1} by {self.defect[self.order]:.1e}"
        shown = min(power, len(self.defect))
        return f"its table meets the conditions up to order {shown} to {max(1e-16, *self.defect[:shown]):.0e}"


@functools.cache
def trees(vertices: int) -> tuple[Tree, ...]:
    """All rooted trees of so many vertices."""
    return tuple(dict.fromkeys(tuple(sorted(forest)) for forest in _forests(vertices - 1, vertices - 1)))


def _forests(vertices: int, largest: int) -> Iterator[tuple[Tree, ...]]:
    """Trees of at most `largest` vertices each, so many together."""
    if vertices == 0:
        yield ()
    for first in range(min(vertices, largest), 0, -1):
        for tree in trees(first):
            for rest in _forests(vertices - first, first):
                yield (tree, *rest)


def density(tree: Tree) -> int:
    """gamma(t)."""
    return size(tree) * math.prod(density(branch) for branch in tree)


def size(tree: Tree) -> int:
    """The number of vertices."""
    return 1 + sum(size(branch) for branch in tree)


def conditions(a: ArrayLike, b: ArrayLike, most: int = MOST) -> Conditions:
    """The conditions of a table, explicit or implicit: `a` of shape (stages, stages), `b` (stages,)."""
    matrix, weights = np.asarray(a, dtype=float), np.asarray(b, dtype=float)

    def weight(tree: Tree) -> Any:
        phi = np.ones(weights.size)
        for branch in tree:
            phi = phi * (matrix @ weight(branch))
        return phi

    return Conditions(
        tuple(
            max(abs(math.fsum(weights * weight(tree)) - 1.0 / density(tree)) for tree in trees(vertices))
            for vertices in range(1, most + 1)
        )
    )


def triangle(entries: ArrayLike, stages: int) -> np.ndarray:
    """The matrix of an explicit table from its strict lower triangle, row by row."""
    matrix = np.zeros((stages, stages))
    rows, columns = np.tril_indices(stages, -1)
    matrix[rows, columns] = np.asarray(entries, dtype=float)[: rows.size]
    return matrix
