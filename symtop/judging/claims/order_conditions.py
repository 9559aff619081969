"""The order conditions of a Butcher table and of a splitting, which give the order of a method without a run.

*Rooted trees.* A Runge-Kutta method with the table (A, b) has order p if and only if, for every rooted tree t of at
most p vertices,

    sum_i b_i Phi_i(t) = 1/gamma(t),        Phi_i([t1 .. tm]) = prod_k sum_j a_ij Phi_j(tk),        Phi_i(.) = 1,

with the density gamma([t1 .. tm]) = |t| gamma(t1) .. gamma(tm). There are 1, 1, 2, 4, 9, 20 trees of 1 .. 6 vertices.
A tree is the sorted tuple of the trees at its root. The conditions are those for all equations; a method may have a
higher order on the top (whose f is quadratic in the space frame).
Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, theorem II.2.13.

*Splitting.* A step exp(b_0 h V) exp(a_1 h T) exp(b_1 h V) ... exp(b_n h V) is the exponential of one element of the
free Lie algebra of T and V (Baker, Campbell, Hausdorff), and of order p if and only if

    log(step) = h (T + V) + O(h^(p + 1)).

Here every kick V commutes with W = [V, [V, T]], which depends on position alone: the condition needs to hold only
modulo the ideal that [V, W] generates. There are 2, 1, 2, 2, 4, 5, 10, 14, 25, 39 conditions of the orders 1 to
10, against 2, 1, 2, 3, 6, 9, 18, 30, 56, 99 in the free algebra. A kick with a gradient is exp(b h V + c h^3 W), a
processor k is exp(k h^2 [T, V]) before the step and its inverse after it. The series are kept as coefficients of the
words in T and V, 2^k of length k.
Source: Murua, Sanz-Serna, Phil. Trans. R. Soc. A 357 (1999) 1079; McLachlan, Quispel, Acta Numerica 11 (2002) 341.
"""

import functools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.model.charts import Array

MET_DEFECT = 1e-12  # a condition is met if its defect is smaller: coefficients have 15 digits or more
MOST_VERTICES = 6  # vertices of the largest trees
LONGEST_WORD = 10  # the highest order of the conditions of a splitting
RANK = 1e-9  # singular values below this are zero

Tree = tuple[Any, ...]
Words = list[Array]  # coefficients of the words of length 0, 1, 2 ..., shapes (1,), (2,), (4,) ...; T is 0 and V is 1


class Conditions(NamedTuple):
    """The largest defect of the conditions of each order, from 1 on."""

    defect: tuple[float, ...]

    @property
    def order(self) -> int:
        """The order of the table, at most `MOST_VERTICES`."""
        return next((k for k, value in enumerate(self.defect) if not value <= MET_DEFECT), len(self.defect))

    def words(self, power: int) -> str:
        """A clause on whether the conditions up to order `power` are met."""
        if self.order < min(power, len(self.defect)):
            return f"its table misses a condition of order {self.order + 1} by {self.defect[self.order]:.1e}"
        order = min(power, len(self.defect))
        return f"its table meets the conditions up to order {order} to {max(1e-16, *self.defect[:order]):.0e}"


@functools.cache
def trees(vertices: int) -> tuple[Tree, ...]:
    """All rooted trees with that number of vertices."""
    return tuple(dict.fromkeys(tuple(sorted(forest)) for forest in _forests(vertices - 1, vertices - 1)))


def _forests(vertices: int, largest: int) -> Iterator[tuple[Tree, ...]]:
    """Forests with `vertices` vertices in all, of trees of at most `largest` vertices."""
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


def conditions(a: ArrayLike, b: ArrayLike, most: int = MOST_VERTICES) -> Conditions:
    """The conditions of a table, explicit or implicit: `a` of shape (stages, stages), `b` (stages,)."""
    matrix, weights = np.asarray(a, dtype=float), np.asarray(b, dtype=float)

    def weight(tree: Tree) -> Any:
        phi = np.ones(weights.size)
        for branch in tree:
            phi = phi * (matrix @ weight(branch))
        return phi

    def defect(tree: Tree) -> float:
        return abs(math.fsum(weights * weight(tree)) - 1.0 / density(tree))

    return Conditions(tuple(max(map(defect, trees(vertices))) for vertices in range(1, most + 1)))


def triangle(entries: ArrayLike, stages: int) -> np.ndarray:
    """The matrix of an explicit table from its strict lower triangle, row by row."""
    matrix = np.zeros((stages, stages))
    rows, columns = np.tril_indices(stages, -1)
    matrix[rows, columns] = np.asarray(entries, dtype=float)[: rows.size]
    return matrix


def product(first: Words, second: Words) -> Words:
    """The product of two series of words."""
    outer = np.multiply.outer  # `np.kron` of two rows, a tenth of its time
    return [np.sum([outer(first[j], second[k - j]).ravel() for j in range(k + 1)], axis=0) for k in range(len(first))]


def commutator(first: Words, second: Words) -> Words:
    """[first, second]."""
    return [left - right for left, right in zip(product(first, second), product(second, first), strict=True)]


def element(t: float = 0.0, v: float = 0.0) -> Words:
    """t T + v V as a series up to `LONGEST_WORD`."""
    return [np.array([t, v]) if k == 1 else np.zeros(2**k) for k in range(LONGEST_WORD + 1)]


def exponential(words: Words) -> Words:
    """exp of a series without a constant."""
    total: Words = [np.ones(1), *(np.zeros_like(row) for row in words[1:])]
    power = total
    for k in range(1, len(words)):
        power = [row / k for row in product(power, words)]
        total = [row + term for row, term in zip(total, power, strict=True)]
    return total


def logarithm(words: Words) -> Words:
    """log of a series whose constant is one."""
    series: Words = [np.zeros(1), *words[1:]]
    total, power = [np.zeros_like(row) for row in words], series
    for k in range(1, len(words)):
        total = [row - (-1.0) ** k / k * term for row, term in zip(total, power, strict=True)]
        power = product(power, series)
    return total


@functools.cache
def vanishing(length: int) -> Array:
    """An orthonormal basis of the combinations of words of a length that vanish here, shape (2^length, rank).

    They are spanned by brackets whose number of V exceeds that of T by more than one: T is of degree two in the
    momenta, V of degree zero, and each bracket lowers the degree by one.
    """
    return np.concatenate([_vanishing(length, letters) for letters in range(length + 1)], axis=1)


@functools.cache
def _vanishing(length: int, letters: int) -> Array:
    """The same basis for words with `letters` letters V."""
    columns: list[Array] = []
    if length >= 4 and 0 <= letters <= length:
        columns += [_spread(column, 0) for column in _vanishing(length - 1, letters).T]
        columns += [_spread(column, 1) for column in _vanishing(length - 1, letters - 1).T]
        if letters > length - letters + 1:
            for word in (word for word in range(2**length) if word.bit_count() == letters):
                bits = [word >> bit & 1 for bit in range(length)]  # [x1, [x2, ... [x(n-1), xn]]], the last first
                columns.append(functools.reduce(_spread, bits[1:], np.eye(2)[bits[0]]))
    if not columns:
        return np.zeros((2**length, 0))
    left, sizes, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return left[:, sizes > RANK]


def _spread(column: Array, letter: int) -> Array:
    """[X, column] for the letter X."""
    x = np.eye(2)[letter]
    return np.asarray(np.kron(x, column) - np.kron(column, x))


def splitting_conditions(
    drift: Sequence[float], kick: Sequence[float], gradient: Sequence[float] = (), processor: float = 0.0
) -> Conditions:
    """Defects of the conditions of a splitting, the largest of each length; arguments are those of `composition`."""
    t, v = element(t=1.0), element(v=1.0)
    nested = commutator(v, commutator(v, t))
    step = exponential(element())
    for stage, (b, c) in enumerate(zip(kick, gradient or [0.0] * len(kick), strict=True)):
        if b or c:
            step = product(step, exponential([b * row + c * term for row, term in zip(v, nested, strict=True)]))
        if stage < len(drift):
            step = product(step, exponential(element(t=drift[stage])))
    if processor:
        ends = [exponential([sign * processor * row for row in commutator(t, v)]) for sign in (1.0, -1.0)]
        step = product(product(ends[0], step), ends[1])
    defects = logarithm(step)
    defects[1] = defects[1] - 1.0
    pairs = [(row, vanishing(length)) for length, row in enumerate(defects[1:], start=1)]
    return Conditions(tuple(float(np.max(np.abs(row - basis @ (basis.T @ row)))) for row, basis in pairs))
