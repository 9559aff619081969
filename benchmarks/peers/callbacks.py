"""Right-hand sides as C functions, made by numba, for libraries whose inner loop calls C and not Python.

    rebound's ODE     void f(ode *, double *out, const double *y, double t)         (e, L)
    rebound's IAS15   void f(simulation *)                                          e as a particle, e'' = a(e, e')
    SUNDIALS          int f(double t, N_Vector y, N_Vector out, void *)             (e, L), or the angles in two halves

IAS15 integrates x'' = a(x, x'). With L = I1 e x e' + p_psi e the axis is such a particle:

    e'' = (e x e') x e' + (p_psi/I1) e x e' + (mgl/I1) (z x e) x e

A split integrator of H = T(p) + V(q) takes the reduced top in angles, which is separable at fixed p_phi and p_psi:

    velocity half:  theta' = p_theta/I1
    force half:     p_theta' = -V'(theta),  phi' = (p_phi - p_psi c)/(I1 s^2),  psi' = p_psi/I3 - c phi'

with s, c = sin, cos(theta) and V' = (p_phi - p_psi c)(p_psi - p_phi c)/(I1 s^3) - mgl s. Keep a callback alive while C
may call it.
"""

import ctypes
import functools
import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, types
from numba.core import cgutils
from numba.extending import intrinsic

from symtop.model.top import Angles, SymmetricTop

DOUBLES = types.CPointer(types.float64)
SUNDIALS = types.int32(types.float64, types.voidptr, types.voidptr, types.voidptr)


@intrinsic
def _pointer_at(typing: Any, base: Any, offset: Any) -> Any:  # noqa: ARG001
    """The pointer that a C struct holds `offset` bytes after its start."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:  # noqa: ARG001
        place = cgutils.pointer_add(builder, values[0], values[1])
        return builder.load(builder.bitcast(place, ir.IntType(8).as_pointer().as_pointer()))

    return types.voidptr(types.voidptr, types.int64), generate


@functools.lru_cache(maxsize=16)
def ode_field(top: SymmetricTop) -> Any:
    """The derivative of (e, L) for rebound's ODE."""
    inverse, mgl = 1.0 / top.I1, top.mgl

    @cfunc(types.void(types.voidptr, DOUBLES, DOUBLES, types.float64))
    def field(_, out, state, t):  # noqa: ARG001
        f, y = carray(out, 6), carray(state, 6)
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        f[0], f[1], f[2] = wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]
        f[3], f[4], f[5] = -mgl * y[1], mgl * y[0], 0.0

    return field


@functools.lru_cache(maxsize=16)
def particle_force(top: SymmetricTop, start: Angles, offset: int) -> Any:
    """The acceleration of the axis as rebound's only particle; its particles lie behind a pointer at `offset`."""
    weight, twist = top.mgl / top.I1, top.I3 * start.spin / top.I1

    @cfunc(types.void(types.voidptr))
    def force(simulation):
        p = carray(_pointer_at(simulation, offset), 9, dtype=np.float64)  # position, velocity, acceleration
        ex, ey, ez, vx, vy, vz = p[0], p[1], p[2], p[3], p[4], p[5]
        wx, wy, wz = ey * vz - ez * vy, ez * vx - ex * vz, ex * vy - ey * vx
        p[6] += wy * vz - wz * vy + twist * wx + weight * ex * ez
        p[7] += wz * vx - wx * vz + twist * wy + weight * ey * ez
        p[8] += wx * vy - wy * vx + twist * wz - weight * (ex * ex + ey * ey)

    return force


def _data_of(core: ctypes.CDLL) -> Any:
    """SUNDIALS' own function from an N_Vector to its numbers."""
    function = core.N_VGetArrayPointer
    function.argtypes, function.restype = [ctypes.c_void_p], ctypes.POINTER(ctypes.c_double)
    return function


@functools.lru_cache(maxsize=16)
def vector_field(top: SymmetricTop, core: ctypes.CDLL) -> Any:
    """The derivative of (e, L) for CVODE."""
    inverse, mgl, data = 1.0 / top.I1, top.mgl, _data_of(core)

    @cfunc(SUNDIALS)
    def field(t, state, out, _):  # noqa: ARG001
        y, f = carray(data(state), 6), carray(data(out), 6)
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        f[0], f[1], f[2] = wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]
        f[3], f[4], f[5] = -mgl * y[1], mgl * y[0], 0.0
        return 0

    return field


@functools.lru_cache(maxsize=16)
def split_field(top: SymmetricTop, start: Angles, core: ctypes.CDLL) -> tuple[Any, Any]:
    """Both halves of the derivative of (theta, p_theta, phi, psi) for ARKODE: of the force and of the velocity."""
    p_phi, p_psi, *_ = top.momenta(start)
    inverse, spin, mgl, data = 1.0 / top.I1, p_psi / top.I3, top.mgl, _data_of(core)

    @cfunc(SUNDIALS)
    def force(t, state, out, _):  # noqa: ARG001
        y, f = carray(data(state), 4), carray(data(out), 4)
        s, c = math.sin(y[0]), math.cos(y[0])
        if s == 0.0:
            return -1
        across = p_phi - p_psi * c
        turn = across * inverse / (s * s)
        f[0], f[1] = 0.0, mgl * s - turn * (p_psi - p_phi * c) / s
        f[2], f[3] = turn, spin - c * turn
        return 0

    @cfunc(SUNDIALS)
    def velocity(t, state, out, _):  # noqa: ARG001
        y, f = carray(data(state), 4), carray(data(out), 4)
        f[0], f[1], f[2], f[3] = inverse * y[1], 0.0, 0.0, 0.0
        return 0

    return force, velocity
