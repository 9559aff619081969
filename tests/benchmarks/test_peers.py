"""Peers are given the motion of the kernels and judged like us, by a public call and an inner loop."""

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import cfunc, types
from scipy.integrate import solve_ivp

import symtop
from benchmarks import peers
from benchmarks.peers import callbacks, common, measure, own
from symtop.methods.framework.angles import field_angles, with_rates
from symtop.methods.framework.space import field_axis
from symtop.run.simulation import make_plan

ROOT = Path(__file__).resolve().parents[2]
DOUBLES = ctypes.POINTER(ctypes.c_double)


@pytest.fixture(scope="module")
def scene():
    return symtop.scene("spheroid")


def _pointer(row):
    return row.ctypes.data_as(DOUBLES)


@cfunc(types.voidptr(types.voidptr))
def _numbers_of(vector):
    return callbacks._pointer_at(vector, 0)


class Core:
    """In place of SUNDIALS: an N_Vector is a struct that holds the address of its numbers and no more."""

    def __init__(self):
        kind = ctypes.CFUNCTYPE(DOUBLES, ctypes.c_void_p)
        self.N_VGetArrayPointer = kind(_numbers_of.address)


def _vector_field(function, state):
    numbers = [np.array(state), np.empty_like(state)]
    vectors = [np.array([row.ctypes.data], dtype=np.uint64) for row in numbers]
    assert function.ctypes(0.0, *(vector.ctypes.data for vector in vectors), None) == 0
    return numbers[1]


def test_all_right_hand_sides_on_the_axis_are_the_kernels_own(scene):
    y = common.start_of(scene.top, scene.start)
    par, _ = common.on_axis(scene.top, scene.start)
    expected = np.array(field_axis(par, tuple(y)))
    filled, through_c = np.empty(6), np.empty(6)
    common.filling_field(scene.top)(0.0, y, filled)
    callbacks.ode_field(scene.top).ctypes(None, _pointer(through_c), _pointer(y), 0.0)
    through_vectors = _vector_field(callbacks.vector_field(scene.top, Core()), y)
    returned = [field(scene.top)(0.0, y) for field in (common.python_field, common.compiled_field)]
    for found in (*returned, filled, through_c, through_vectors):
        assert np.allclose(found, expected, rtol=1e-15, atol=0.0)


def test_both_right_hand_sides_in_angles_are_the_kernels_own(scene):
    par, state = with_rates(scene.top, scene.start)
    expected = field_angles(par, state)
    for field in (common.python_angles, common.compiled_angles):
        assert np.allclose(field(scene.top)(0.0, np.array(state)), expected, rtol=1e-14, atol=0.0)


def test_the_halves_of_the_split_field_add_up_to_the_motion(scene):
    top, start = scene.top, scene.start
    par, state = with_rates(top, start)
    theta_dot, phi_dot, psi_dot, theta_ddot, *_ = field_angles(par, state)
    expected = np.array([theta_dot, top.I1 * theta_ddot, phi_dot, psi_dot])
    y = np.array([start.theta, top.I1 * start.theta_dot, start.phi, start.psi])
    halves = [_vector_field(half, y) for half in callbacks.split_field(top, start, Core())]
    assert np.allclose(sum(halves), expected, rtol=1e-13, atol=0.0)
    assert not any(np.allclose(half, expected) for half in halves)
    moved = _vector_field(callbacks.split_field(top, start, Core())[0], y + np.array([0.0, 1.0, 1.0, 1.0]))
    assert np.array_equal(moved, halves[0])  # the force depends on theta alone: H is separable


def test_the_axis_as_a_particle_has_the_acceleration_of_the_axis(scene):
    top, start = scene.top, scene.start
    y = common.start_of(top, start)
    e, momentum = y[:3], y[3:]
    velocity = np.cross(momentum, e) / top.I1
    torque = top.mgl * np.array([-e[1], e[0], 0.0])
    expected = (np.cross(torque, e) + np.cross(momentum, velocity)) / top.I1
    particle = np.concatenate([e, velocity, np.zeros(3)])
    simulation = np.array([0, particle.ctypes.data], dtype=np.uint64)  # a struct with a pointer in its second place
    callbacks.particle_force(top, start, 8).ctypes(simulation.ctypes.data)
    assert np.allclose(particle[6:], expected, rtol=1e-13, atol=1e-13)
    assert not np.allclose(particle[6:], np.cross(torque, e) / top.I1)  # gravity alone


def test_a_peer_that_is_not_installed_is_named_and_skipped(monkeypatch):
    for module in ("diffrax", "mujoco"):
        monkeypatch.setitem(sys.modules, module, None)  # an import of it fails
    found, missing = peers.load(("diffrax", "scipy", "mujoco"))
    assert {peer.package for peer in found} == {"scipy"}
    assert [sentence.split()[0] for sentence in missing] == ["diffrax", "mujoco"]
    assert all("skipped" in sentence for sentence in missing)


def _own(name):
    return peers.Peer(measure.OURS, symtop.integrator(name), own.LANGUAGE)


@pytest.mark.parametrize(
    ("name", "setting"), [("takahashi-imada", 0.01), ("rk4", 0.005), ("taylor", 1e-12), ("rk45-compiled", 1e-10)]
)
def test_the_kernel_alone_ends_where_simulate_ends(scene, name, setting):
    peer = _own(name)
    whole, loop = measure.ready(scene, peer, setting)
    data = whole()
    assert data["time"].size == measure.SHOWN
    truth = symtop.reference(scene, data["time"].values[-1:])["axis"].values
    there = float(common.charts.axis_distance(data["axis"].values[-1:], truth)[0])
    assert measure.end_error(scene, peer, loop) == pytest.approx(there, rel=0.3, abs=1e-13)


def _scipy(row):
    return next(peer for peer in peers.load(("scipy", "odeint"))[0] if peer.row == row)


@pytest.mark.parametrize(
    "row",
    ["scipy-dop853-python[axis]", "scipy-dop853-numba[angles]", "scipy-lsoda-numba[axis]", "scipy-odeint-numba[axis]"],
)
def test_both_calls_of_scipy_end_at_the_truth(scene, row):
    peer = _scipy(row)
    whole, loop = measure.ready(scene, peer, 1e-11)
    assert len(whole().states) == measure.SHOWN
    assert measure.end_error(scene, peer, loop) < 1e-7


def test_an_inner_loop_that_does_not_start_anew_is_seen(scene):
    """CVODE and others keep their state: a second call that went on from the first would be 20 nutations on."""
    peer = _scipy("scipy-dop853-python[axis]")
    horizon = measure.PERIODS * scene.nutation_period
    plan, _ = make_plan(scene, peer.method, tolerance=1e-9, horizon=horizon, samples=2)
    state = [common.start_of(scene.top, scene.start)]

    def call():
        field = common.python_field(scene.top)
        state[0] = solve_ivp(field, (0.0, plan.horizon), state[0], rtol=1e-9, atol=1e-9).y[:, -1]
        return state[0]

    assert measure.end_error(scene, peer, common.Inner(call, lambda last: last)) > 1e-2


def test_the_search_finds_the_loosest_setting():
    scene, method = symtop.scene("goldstein"), symtop.integrator("takahashi-imada")
    points = measure.worth_timing(measure.search(scene, method, (1e-6,)), (1e-6,))
    meets = next(point for point in points if point.error <= 1e-6)
    assert measure.accuracy(scene, method, 1.15 * meets.setting).error > 1e-6
    assert points == sorted(points, key=lambda point: -point.error)
