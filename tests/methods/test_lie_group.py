"""Methods on Lie groups and variational ones on SO(3): each step is its definition, and what it is known for holds."""

import itertools
import math

import numpy as np
import pytest
from scipy import optimize
from scipy.spatial.transform import Rotation

import symtop
from symtop.measure.published import published_values
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.preparation import BareTop
from symtop.methods.framework.registry import integrator
from symtop.methods.framework.space import SpaceTop, field_axis, on_axis
from symtop.methods.lie_group import variational
from symtop.methods.lie_group.generalised_alpha import generalised_alpha
from symtop.model import charts
from tests.conftest import defer, random_scenes
from tests.judging.blind.right import product
from tests.methods.engine_formulas import hat

LIE_TABLES = ("rkmk-se3-2", "rkmk-se3-4", "rkmk-se3-5", "rkmk-se3-8", "crouch-grossman-3", "commutator-free-4")
VARIATIONAL = ("lie-variational", "lie-variational-suzuki-4", "euler-poincare")
COLLECTIVE = ("collective-gauss-2", "collective-gauss-4", "collective-gauss-6")
K = np.array([0.0, 0.0, 1.0])


def states(name, scene, h, steps, chart="attitude"):
    """The states of a chart after 0, 1, ... steps."""
    return solve(integrator(name), chart, scene.top, scene.start, Plan.steps(h, list(range(steps + 1)))).states


def matrices(rows):
    """Rotation matrices of states (q, L)."""
    return Rotation.from_quat(np.roll(rows[:, :4], -1, axis=1)).as_matrix()


def moments(top):
    """The inertia in body axes."""
    return np.diag([top.I1, top.I1, top.I3])


def root(function, guess):
    """A root to rounding by a general solver."""
    return optimize.root(function, guess, tol=1e-15).x


def energies(scene, rows):
    """The energy of states (e, L)."""
    return 0.5 * np.sum(rows[:, 3:] ** 2, axis=1) / scene.top.I1 + scene.top.mgl * rows[:, 2]


@pytest.mark.parametrize("name", [*LIE_TABLES, *VARIATIONAL[::2], *defer(VARIATIONAL[1], *COLLECTIVE)])
def test_casimirs_are_exact_where_rk4_loses_them(name):
    scene = symtop.scene("spheroid")
    for method, exact in ((name, True), ("rk4", False)):
        rows = states(method, scene, scene.nutation_period / 40.0, 400, "axis")
        change = np.abs(np.sum(rows[:, :3] * rows[:, 3:], axis=1) / (rows[0, :3] @ rows[0, 3:]) - 1.0).max()
        assert bool(change < 3e-14) is exact


def kicked(scene, rows, h):
    """Body momenta at the start of each rotation, after half a kick: R^T (L + h tau/2)."""
    R = matrices(rows)
    pull = scene.top.mgl * np.cross(K, R[:, :, 2])
    return R, np.einsum("nji,nj->ni", R, rows[:, 4:] + 0.5 * h * pull), pull


@pytest.mark.parametrize("scene", random_scenes(4, seed=11), ids=lambda scene: scene.name)
def test_a_step_solves_the_equation_of_lee_leok_and_mcclamroch_or_discrete_euler_poincare_equations(scene):
    """h Pi = F J_d - J_d F^T with J_d = tr(J)/2 - J, and Pi_1 = F^T Pi.

    Of the other, the trivialised derivative of Cayley's map takes the momentum to that of the rates xi.
    """
    h, J = 0.02, moments(scene.top)
    rows = states("lie-variational", scene, h, 3)
    R, momentum, pull = kicked(scene, rows, h)
    Jd = 0.5 * np.trace(J) * np.eye(3) - J
    for k in range(3):
        F = R[k].T @ R[k + 1]
        np.testing.assert_allclose(F @ Jd - Jd @ F.T, h * hat(momentum[k]), atol=1e-14)
        after = R[k + 1] @ F.T @ momentum[k] + 0.5 * h * pull[k + 1]
        np.testing.assert_allclose(after, rows[k + 1, 4:], rtol=1e-13, atol=1e-13)
    R, momentum, _ = kicked(scene, states("euler-poincare", scene, h, 3), h)
    for k in range(3):
        F = R[k].T @ R[k + 1]
        xi = 2.0 / h * np.array([F[2, 1] - F[1, 2], F[0, 2] - F[2, 0], F[1, 0] - F[0, 1]]) / (1.0 + np.trace(F))
        x = h * xi
        inverse = np.eye(3) - 0.5 * hat(x) + 0.25 * np.outer(x, x)
        np.testing.assert_allclose(inverse.T @ J @ xi, momentum[k], rtol=1e-12, atol=1e-12)


def test_rattle_on_directors_is_the_lie_group_variational_integrator():
    """RATTLE on the nine numbers of a rotation matrix, R^T R = 1, with Lagrange multipliers found by a solver."""
    scene, h = symtop.scene("spheroid"), 0.02
    J = moments(scene.top)
    Jd, rows = 0.5 * np.trace(J) * np.eye(3) - J, states("lie-variational", scene, h, 4)
    R, P = matrices(rows)[0], None
    P = R @ hat(np.linalg.solve(J, R.T @ rows[0, 4:])) @ Jd  # R' J_d
    force = np.zeros((3, 3))
    force[2, 2] = -scene.top.mgl  # of the potential mgl (d_3)_z
    upper = np.triu_indices(3)

    def symmetric(values):
        matrix = np.zeros((3, 3))
        matrix[upper] = values
        return matrix + matrix.T

    for k in range(4):

        def ahead(values, R=R, P=P):
            half = P + 0.5 * h * force - R @ symmetric(values)
            return half, R + h * half @ np.linalg.inv(Jd)

        multipliers = root(lambda values: (ahead(values)[1].T @ ahead(values)[1] - np.eye(3))[upper], np.zeros(6))
        half, R = ahead(multipliers)
        P = half + 0.5 * h * force
        V = R.T @ P @ np.linalg.inv(Jd)  # tangent: V must be skew, by a second set of multipliers
        defect, inverse = V + V.T, np.diag(np.linalg.inv(Jd))
        P = P - R @ (defect / (inverse[:, None] + inverse[None, :]))
        np.testing.assert_allclose(R, matrices(rows)[k + 1], atol=3e-13)
    M = R.T @ P
    L = R @ np.array([M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
    np.testing.assert_allclose(L, rows[4, 4:], atol=1e-11)


def test_the_scalar_equations_are_solved_and_the_discrete_rigid_body_ends_at_a_right_angle():
    top, start = symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0, theta_dot=1.0, phi_dot=1.0)
    for name, outcome in (("lie-variational", "not_converged"), ("euler-poincare", "ok")):
        assert solve(integrator(name), "axis", top, start, Plan.steps(0.2, [1])).outcome == "ok"
        assert solve(integrator(name), "axis", top, start, Plan.steps(3.0, [1])).outcome == outcome
    random = np.random.default_rng(3)
    for _ in range(2000):
        top, size = BareTop(1.0, random.uniform(0.02, 1.98), 1.0), 10.0 ** random.uniform(-8, 4)
        A, square = size * random.normal(), size**2 * random.exponential()
        first, after, rates = variational.RETRACTION
        unknown, converged, work = first(top, A, square), False, 0
        while not converged:
            unknown, converged, _ = after(top, A, square, unknown)
            work += 1
            assert work <= 60
        _, i, x = rates(top, A, unknown)
        k, bent = i - top.I1, (top.I3 - top.I1) * x
        assert k == pytest.approx(top.I1 * square / (i * i + bent**2) + top.I3 * x * x, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("scene", random_scenes(4, seed=13), ids=lambda scene: scene.name)
def test_a_step_is_simo_and_wongs(scene):
    """R_1 = R_0 cay(h (W_0 + W_1)/2) and L_1 = L_0 + h tau at the mean of both axes."""
    h, J = 0.02, moments(scene.top)
    rows = states("simo-wong", scene, h, 3)
    R = matrices(rows)
    W = np.array([np.linalg.solve(J, R[k].T @ rows[k, 4:]) for k in range(4)])
    for k in range(3):
        half = 0.25 * h * hat(W[k] + W[k + 1])
        np.testing.assert_allclose(R[k] @ np.linalg.inv(np.eye(3) - half) @ (np.eye(3) + half), R[k + 1], atol=1e-13)
        mean = 0.5 * (R[k] + R[k + 1])[:, 2]
        np.testing.assert_allclose(rows[k + 1, 4:] - rows[k, 4:], h * scene.top.mgl * np.cross(K, mean), atol=1e-14)


def test_the_discrete_gradients_are_the_midpoint_rule_and_the_mean_field_loses_the_energy():
    scene, h = symtop.scene("spheroid"), 0.02
    par, start = on_axis(scene.top, scene.start)
    before, guess = np.array(start), start + h * np.array(field_axis(par, start))
    value = lambda y: energies(scene, y[None])[0]
    slope = lambda y: np.array([0.0, 0.0, scene.top.mgl, *(y[3:] / scene.top.I1)])

    def gonzalez(y):
        middle, delta = 0.5 * (before + y), y - before
        return slope(middle) + (value(y) - value(before) - slope(middle) @ delta) / (delta @ delta) * delta

    def itoh_abe(y):
        """Quotients of differences, one component after the other."""
        gradient, point = np.zeros(6), before.copy()
        for k in range(6):
            last, gap = value(point), y[k] - before[k]
            point[k] = y[k]
            gradient[k] = (value(point) - last) / gap if abs(gap) > 1e-9 else slope(point)[k]
        return gradient

    def mean(y):
        ends = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))
        return sum(0.5 * slope(before + c * (y - before)) for c in ends)

    def structure(y):
        e, L = 0.5 * (before + y)[:3], 0.5 * (before + y)[3:]
        return np.block([[np.zeros((3, 3)), -hat(e)], [-hat(e), -hat(L)]])

    def average(y):  # Simpson's rule is exact for a quadratic field
        middle = np.array(field_axis(par, 0.5 * (before + y)))
        return (np.array(field_axis(par, before)) + 4.0 * middle + np.array(field_axis(par, y))) / 6.0

    expected = states("gauss-2", scene, h, 1, "axis")[1]
    for gradient in (gonzalez, itoh_abe, mean):
        y = root(lambda y, gradient=gradient: y - before - h * structure(y) @ gradient(y), guess)
        np.testing.assert_allclose(y, expected, atol=1e-11)
    mean_field = root(lambda y: y - before - h * average(y), guess)
    assert abs(value(expected) / value(before) - 1.0) < 1e-13
    assert abs(value(mean_field) / value(before) - 1.0) > 1e-8


@pytest.mark.parametrize("scene", random_scenes(4, seed=14), ids=lambda scene: scene.name)
def test_kahan_is_its_runge_kutta_form(scene):
    """y_1 = y_0 + h (2 f((y_0 + y_1)/2) - (f(y_0) + f(y_1))/2)."""
    h, par = 0.02, SpaceTop(scene.top.I1, scene.top.mgl, 0.0)
    for before, after in itertools.pairwise(states("kahan", scene, h, 3, "axis")):
        f0, fm, f1 = (np.array(field_axis(par, y)) for y in (before, 0.5 * (before + after), after))
        np.testing.assert_allclose(after - before, h * (2.0 * fm - 0.5 * f0 - 0.5 * f1), atol=2e-14)


def flipped(q):
    """The conjugate."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


@pytest.mark.parametrize("seed", [0, 1])
def test_the_image_of_a_step_does_not_depend_on_the_point_above(seed):
    """The midpoint rule above, from another quaternion of the axis and with a shifted momentum, by a general solver."""
    random = np.random.default_rng(seed)
    scene, h = symtop.scene("spheroid"), 0.03
    top, k = scene.top, np.array([0.0, 0.0, 0.0, 1.0])
    attitude, spin = charts.space_state("attitude", top, scene.start), random.normal()
    q = product(attitude[:4], np.array([math.cos(spin), 0.0, 0.0, math.sin(spin)]))
    p = product(np.array([0.0, *(2.0 * attitude[4:])]), q) + random.normal() * q
    start = np.array([*q, *p])

    def field(y):
        q, p = y[:4], y[4:]
        w = np.array([0.0, *(0.5 * product(p, flipped(q))[1:] / top.I1)])
        return np.array([*(0.5 * product(w, q)), *(0.5 * product(w, p) + 2.0 * top.mgl * product(product(k, q), k))])

    y = root(lambda y: y - start - h * field(0.5 * (start + y)), start + h * field(start))
    e, L = product(product(y[:4], k), flipped(y[:4]))[1:], 0.5 * product(y[4:], flipped(y[:4]))[1:]
    np.testing.assert_allclose([*e, *L], states("collective-gauss-2", scene, h, 1, "axis")[1], atol=3e-12)


def test_collective_methods_bound_the_energy_that_gauss_keeps_to_rounding():
    scene = symtop.scene("spheroid")
    h, changes = scene.nutation_period / 40.3, {}
    for name in ("collective-gauss-4", "gauss-4", "commutator-free-4"):
        rows = states(name, scene, h, 20_000, "axis")
        changes[name] = np.abs(energies(scene, rows) / energies(scene, rows)[0] - 1.0)
    assert changes["gauss-4"].max() < 1e-12
    assert 1e-9 < changes["collective-gauss-4"][-2000:].max() < 1.1 * changes["collective-gauss-4"][:2000].max()
    assert changes["commutator-free-4"][-1] > 5.0 * changes["commutator-free-4"][2000]


@pytest.mark.parametrize("scene", random_scenes(3, seed=15), ids=lambda scene: scene.name)
@pytest.mark.parametrize("radius", [0.0, 0.6, 1.0])
def test_two_steps_are_those_of_the_generalised_alpha_method(radius, scene):
    """The definition in body axes with matrices, its equation solved by a general solver."""
    for value in (-0.1, 1.1, math.nan):
        with pytest.raises(symtop.SymtopError, match="spectral_radius"):
            generalised_alpha("alpha", value)
    method, h, J = generalised_alpha("alpha", radius), 0.01, moments(scene.top)
    rows = solve(method, "attitude", scene.top, scene.start, Plan.steps(h, [0, 1, 2])).states
    am, af = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    gamma = 0.5 + af - am
    beta, R = 0.25 * (gamma + 0.5) ** 2, matrices(rows)[0]
    W = np.linalg.solve(J, R.T @ rows[0, 4:])
    change = lambda R, W: np.linalg.solve(J, R.T @ (scene.top.mgl * np.cross(K, R[:, 2])) - np.cross(W, J @ W))
    slope = a = change(R, W)
    for k in (1, 2):

        def ahead(new, R=R, W=W, a=a, slope=slope):
            b = ((1.0 - af) * new + af * slope - am * a) / (1.0 - am)
            rotation = Rotation.from_rotvec(h * W + h * h * ((0.5 - beta) * a + beta * b)).as_matrix()
            return b, R @ rotation, W + h * ((1.0 - gamma) * a + gamma * b)

        new = root(lambda new: new - change(*ahead(new)[1:]), slope)
        a, R, W = ahead(new)
        slope = new
        np.testing.assert_allclose(matrices(rows)[k], R, atol=3e-13)
        np.testing.assert_allclose(rows[k, 4:], R @ J @ W, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(("name", "steps", "band"), [("simo-wong", 128000, 1e-5), ("collective-gauss-6", 2000, 6e-6)])
def test_the_benchmark_of_bruls_cardona_and_arnold(name, steps, band):
    """The displacement of the centre at t = 1 to the printed five digits: (0.17334, -0.35991, -0.74849)."""
    published = [value.published for value in published_values() if value.source.startswith("Bruls")]
    run = symtop.simulate("bruls-cardona-arnold", name, step_size=1.0 / steps, horizon=1.0, samples=2, observe="axis")
    np.testing.assert_allclose(run["axis"].values[-1] - [0.0, 1.0, 0.0], published, atol=band)
