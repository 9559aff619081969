"""The order conditions of a splitting, in the Lie algebra of its two parts: its order without a run.

A step exp(b_0 h V) exp(a_1 h T) exp(b_1 h V) ... exp(b_n h V) is the exponential of one element of the free Lie algebra
of T and V (Baker, Campbell, Hausdorff), and of order p if and only if

    log(step) = h (T + V) + O(h^(p + 1)).

Here every kick V commutes with W = [V, [V, T]], which depends on position alone: what holds in the free algebra needs
to hold only beside what vanishes with [V, W]. There are 2, 1, 2, 2, 4, 5, 10, 14, 25, 39 conditions of the orders 1 to
10, against 2, 1, 2, 3, 6, 9, 18, 30, 56, 99 in the free algebra. A kick with a gradient is exp(b h V + c h^3 W), a
processor k is exp(k h^2 [T, V]) before the step and its inverse after it. The series are kept as coefficients of the
words in T and V, 2^k of length k.
Source: Murua, Sanz-Serna, Phil. Trans. R. Soc. A 357 (1999) 1079; McLachlan, Quispel, Acta Numerica 11 (2002) 341.
"""

import functools
from collections.abc import Sequence

import numpy as np

from symtop.measure.order_conditions import Conditions
from symtop.model.charts import Array

LONGEST_WORD = 10  # the highest order that is tried
RANK = 1e-9  # of a direction: shorter is none

Words = list[Array]  # coefficients of the words of length 0, 1, 2 ..., shapes (1,), (2,), (4,) ...; T is 0 and V is 1


def product(first: Words, second: Words) -> Words:
    """The product of two series of words."""
    return [
        np.sum([np.multiply.outer(first[j], second[k - j]).ravel() for j in range(k + 1)], axis=0)
        for k in range(len(first))
    ]


def commutator(first: Words, second: Words) -> Words:
    """[first, second]."""
    return [one - other for one, other in zip(product(first, second), product(second, first), strict=True)]


def element(most: int, t: float = 0.0, v: float = 0.0) -> Words:
    """t T + v V as a series up to the length `most`."""
    return [np.array([t, v]) if k == 1 else np.zeros(2**k) for k in range(most + 1)]


def exponential(words: Words) -> Words:
    """exp of a series without a constant."""
    one: Words = [np.ones(1), *(np.zeros_like(row) for row in words[1:])]
    total, power = one, one
    for k in range(1, len(words)):
        power = [row / k for row in product(power, words)]
        total = [row + more for row, more in zip(total, power, strict=True)]
    return total


def logarithm(words: Words) -> Words:
    """log of a series whose constant is one."""
    rest: Words = [np.zeros(1), *words[1:]]
    total, power = [np.zeros_like(row) for row in words], rest
    for k in range(1, len(words)):
        total = [row - (-1.0) ** k / k * more for row, more in zip(total, power, strict=True)]
        power = product(power, rest)
    return total


def step_of(
    drift: Sequence[float], kick: Sequence[float], gradient: Sequence[float] = (), processor: float = 0.0,
    most: int = LONGEST_WORD,
) -> Words:  # fmt: skip
    """The step with these coefficients, kick[0] first, as a series of words."""
    t, v = element(most, t=1.0), element(most, v=1.0)
    bent = commutator(v, commutator(v, t))
    bends = gradient or [0.0] * len(kick)
    step = exponential(element(most))
    for place, (b, c) in enumerate(zip(kick, bends, strict=True)):
        if b or c:
            step = product(step, exponential([b * one + c * more for one, more in zip(v, bent, strict=True)]))
        if place < len(drift):
            step = product(step, exponential(element(most, t=drift[place])))
    if processor:
        ends = [exponential([sign * processor * row for row in commutator(t, v)]) for sign in (1.0, -1.0)]
        step = product(product(ends[0], step), ends[1])
    return step


@functools.cache
def vanishing(length: int) -> Array:
    """An orthonormal basis of the words' combinations of a length that are zero here, shape (2^length, rank).

    They are the brackets with more than one V beyond the number of T: by degrees in the momenta, a bracket takes one
    away, T has two of them and V none.
    """
    parts = [_of(length, letters) for letters in range(length + 1)]
    whole: Array = np.concatenate(parts, axis=1)
    return whole


def _brackets(length: int, letters: int) -> Array:
    """Columns that span the vanishing combinations with so many V."""
    if length < 4 or not 0 <= letters <= length:
        return np.zeros((2**length, 0))
    columns = [_spread(column, 0) for column in _of(length - 1, letters).T]
    columns += [_spread(column, 1) for column in _of(length - 1, letters - 1).T]
    if letters > length - letters + 1:
        columns += [_nested(word, length) for word in range(2**length) if word.bit_count() == letters]
    return np.stack(columns, axis=1) if columns else np.zeros((2**length, 0))


@functools.cache
def _of(length: int, letters: int) -> Array:
    """The same, orthonormal."""
    spanning = _brackets(length, letters)
    if not spanning.size:
        return spanning
    left, sizes, _ = np.linalg.svd(spanning, full_matrices=False)
    kept: Array = left[:, sizes > RANK]
    return kept


def _spread(column: Array, letter: int) -> Array:
    """[X, column] for the letter X."""
    one = np.eye(2)[letter]
    bracket: Array = np.multiply.outer(one, column).ravel() - np.multiply.outer(column, one).ravel()
    return bracket


def _nested(word: int, length: int) -> Array:
    """[x1, [x2, ... [x(n-1), xn]]] of the letters of a word."""
    column: Array = np.eye(2)[word & 1]
    for place in range(1, length):
        column = _spread(column, word >> place & 1)
    return column


def splitting_conditions(
    drift: Sequence[float], kick: Sequence[float], gradient: Sequence[float] = (), processor: float = 0.0,
    most: int = LONGEST_WORD,
) -> Conditions:  # fmt: skip
    """What the conditions of a table are off by: the largest coefficient of each length that must vanish and does not.

    `drift` and `kick` as in `symtop.composition`; ``gradient[i]`` and `processor` as there.
    """
    defects = logarithm(step_of(drift, kick, gradient, processor, most))
    defects[1] = defects[1] - 1.0
    rest = []
    for length, row in enumerate(defects[1:], start=1):
        none = vanishing(length)
        rest.append(float(np.max(np.abs(row - none @ (none.T @ row)))))
    return Conditions(tuple(rest))
