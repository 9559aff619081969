"""Extrapolation: the order of each line of its table, variable order, samples, blocks, and failures."""

import numpy as np
import pytest

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.runge_kutta import extrapolation
from symtop.model.scenes import closed_form

SPHEROID = symtop.scene("spheroid")


def one_step(h, lines):
    """A step of h with so many lines, as a sample at the fraction h of a step of one."""
    form = FORMULATIONS["axis"]
    par, state = form.prepare(SPHEROID.top, SPHEROID.start)
    method = extrapolation.method(form.field)
    memory = np.zeros((extrapolation.LAST + 1, 6))
    memory[0] = form.field(par, state)
    memory[extrapolation.ORDERS, 1] = lines
    sample = method.sample

    def kernel(par, state, memory, x):
        return sample(par, state, state, memory, 1.0, x)

    return np.array(compile_kernel(kernel)(par, state, memory, h))


@pytest.mark.parametrize("lines", [1, 2, 3, 4])
def test_a_line_more_gives_two_orders_more(lines):
    steps = np.array([0.16, 0.08]) if lines > 2 else np.array([0.04, 0.02])
    exact = closed_form(SPHEROID).axis(steps)
    errors = [np.linalg.norm(one_step(float(h), lines)[:3] - e) for h, e in zip(steps, exact, strict=True)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * lines + 1, abs=0.7)  # of one step
