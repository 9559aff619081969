"""From a top and a start to the parameters and the state of a kernel, by plain Python functions that numba compiles.

    prepare(top, at) -> (par, state)         the numbers of the top, and the start as the kernel steps it
    scale(rule, top, at, h) -> rule          the coefficients of a method times the step
    sample(par, t, state) -> state           a sample at the time t, in the chart that a user sees

A `Preparation`, a `ScaledRule` and a `Presentation` each hold one such function and can be called like it. A run takes
the function itself and compiles it into the loop (`loop.whole_run`): calls from Python cost more than a few steps of a
kernel, above all if they pass a NamedTuple to compiled code.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from symtop.core.jit import compile_kernel, register_jitable
from symtop.methods.framework.plan import Array
from symtop.model import top as model
from symtop.model.top import Angles, SymmetricTop, flat

Numbers = tuple[float, ...]  # I1, I3, mgl, theta, phi, psi, theta', phi', psi'
Pack = Callable[[Any], tuple[Callable[[Any], Any], Any]]  # (rule): a compiled function that makes it, and its argument

conserved = register_jitable(model.conserved)


class BareTop(NamedTuple):
    """A top in compiled code, with the names of `SymmetricTop`; no momenta."""

    I1: float
    I3: float
    mgl: float


class Start(NamedTuple):
    """A start in compiled code, with the names of `Angles`."""

    theta: float
    phi: float
    psi: float
    theta_dot: float
    phi_dot: float
    psi_dot: float


@register_jitable
def unpack_top(row: Any) -> Any:
    """A top and a start, from their nine numbers."""
    return BareTop(*row[:3]), Start(*row[3:])


@register_jitable
def momenta_at(top: Any, at: Any) -> Any:
    """p_phi and p_psi of a start."""
    constants = conserved(top, at)
    return constants.p_phi, constants.p_psi


@dataclass(frozen=True)
class Preparation:
    """Computes the parameters and the state of a kernel from a top and a start."""

    numbers: Callable[..., tuple[Any, Numbers]]  # (top, at): the parameters and the state; compiles
    size: int  # of the state
    check: Callable[[Any], None] | None = None  # refuses a start that the kernel cannot step: raises SymtopError
    unpack: Callable[..., Any] = unpack_top  # (row): the records that `numbers` takes
    momenta: Callable[..., Any] = momenta_at  # (top, at): p_phi and p_psi
    given: int = 9  # how many plain numbers a top and a start have

    def __post_init__(self) -> None:
        register_jitable(self.numbers)  # now, as the hash of a kernel's code must not depend on what has run

    def __call__(self, top: Any, at: Any) -> tuple[Any, Numbers]:
        """Kernel parameters and state of a start."""
        if self.check is not None:
            self.check(at)
        return self.numbers(*self.unpack(flat(top, at)))


@functools.cache
def _constructor(kind: Any) -> Callable[[Any], Any]:
    return register_jitable((lambda fields: fields) if kind is tuple else (lambda fields: kind(*fields)))


def as_fields(rule: Any) -> tuple[Callable[[Any], Any], Any]:
    """The function that makes a rule from its fields, and the fields: a plain tuple is a faster argument."""
    kind: Any = type(rule)
    return _constructor(kind), tuple(rule)


@functools.cache
def _compiled_scale(scale: Callable[..., Any], table: Callable[[Any], Any], unpack: Callable[[Any], Any]) -> Any:
    """`scale` by itself, compiled; `table` makes the table from plain numbers, `unpack` the top and the start."""

    def scaled(row, numbers, h):  # type: ignore[no-untyped-def]
        top, at = unpack(row)
        return scale(table(numbers), top, at, h)

    return compile_kernel(scaled)


@dataclass(frozen=True)
class ScaledRule:
    """A rule whose numbers depend on the run: ``scale(rule, top, start, h)``, compiled."""

    rule: Any  # a NamedTuple
    scale: Callable[..., Any]
    pack: Pack = as_fields
    unpack: Callable[..., Any] = unpack_top  # as `Preparation` has it

    def __post_init__(self) -> None:
        register_jitable(self.scale)

    def __call__(self, top: SymmetricTop, at: Angles, h: float) -> Any:
        """The rule of one run."""
        make, table = self.pack(self.rule)
        return _compiled_scale(self.scale, make, self.unpack)(flat(top, at), table, h)


@dataclass(frozen=True)
class LazyRule:
    """A rule that is the same for all runs, made when it is first used."""

    make: Callable[[], Any]
    pack: Pack = as_fields

    def __call__(self, *_run: object) -> Any:
        """The rule of any run."""
        return self.make()


@functools.cache
def _compiled_samples(sample: Callable[..., Any], kind: Any) -> Any:
    def fill(par, times, states, out):  # type: ignore[no-untyped-def]
        top = kind(*par)
        for i in range(len(times)):
            values = sample(top, times[i], states[i])
            for m in range(len(values)):
                out[i, m] = values[m]

    return compile_kernel(fill)


@dataclass(frozen=True)
class Presentation:
    """From a kernel's states to those of the user's chart: `sample(par, t, state)` compiles, returns `size` numbers."""

    sample: Callable[..., Any]
    size: int

    def __post_init__(self) -> None:
        register_jitable(self.sample)

    def __call__(self, par: Any, times: Array, states: Array) -> Array:
        """States of the chart, shape (samples, size), of states of the kernel."""
        out, kind = np.empty((len(times), self.size)), cast("Any", type(par))
        fill = _compiled_samples(self.sample, kind)
        fill(tuple(par), np.ascontiguousarray(times, dtype=float), np.ascontiguousarray(states), out)
        return out


as_it_is = register_jitable(lambda rule, _top, _at, _h: rule)  # `scale` of numbers that no run changes
as_it_steps = register_jitable(lambda _par, _t, state: state)  # `sample` of a kernel that steps states of the chart
