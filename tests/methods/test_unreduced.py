"""The unreduced kernels: the same map as the reduced ones, with momenta that nothing holds in place."""

import numpy as np
import pytest
from symtop_studies.reduction.measures import unreduced_cost, unreduced_gaps

import symtop
from symtop.measure.conservation import trend
from symtop.measure.step_map import one_step, symplectic_defect
from symtop.methods.framework.loop import Loop
from symtop.methods.lagrangian import unreduced as kernel
from symtop.methods.lagrangian.discrete_lagrangian import RULES, Quadrature
from symtop.methods.lagrangian.unreduced import march, with_momenta
from tests.conftest import random_scenes

TWIN = "-unreduced"
SCENES = ("spheroid", "goldstein")


def largest_gap(scene_name, first, second, steps=10_000):
    """Largest difference of any angle between two methods over a run of the scene."""
    scene = symtop.scene(scene_name)
    runs = [symtop.simulate(scene, name, step_size=scene.horizon / steps, samples=401) for name in (first, second)]
    return max(float(np.max(np.abs(runs[0][angle] - runs[1][angle]))) for angle in ("theta", "phi", "psi"))


@pytest.mark.parametrize("scene_name", SCENES)
@pytest.mark.parametrize("name", ["midpoint", "trapezoidal"])
def test_the_reduced_kernel_assumed_nothing(scene_name, name):
    """Ten thousand steps: rounding grows as n^1.5 and stays below 1e-11 rad (measured 7e-13)."""
    assert largest_gap(scene_name, name, name + TWIN) < 1e-11
    if name == "midpoint":  # the control: another rule of order 2 is another trajectory
        assert largest_gap(scene_name, "midpoint", "trapezoidal" + TWIN) > 1e-7


def test_the_study_finds_rounding_between_the_forms_and_iterations_that_end_soon():
    scene = symtop.scene("goldstein")
    history = unreduced_gaps(scene, "midpoint", scene.nutation_period, 500)
    assert float(history["psi_gap"].max()) < 1e-12
    assert float(history["p_phi_drift"].max()) < 1e-13
    iterations = unreduced_cost(scene, "midpoint", [scene.nutation_period / 300.0], batches=1)["iterations_per_step"]
    assert ((iterations >= 1.0) & (iterations < 5.0)).all()


def momentum_walk(scene_name, loop, steps=1_000_000):
    """Largest relative change of p_phi and p_psi, and the larger of their trends, with the midpoint rule."""
    scene = symtop.scene(scene_name)
    par, state = with_momenta(scene.top, scene.start)
    marks = np.arange(0, steps + 1, 997)
    result = loop(par, Quadrature((0.5,), (1.0,)), state, 0.01, marks)
    changes = [(result.momenta[1:, k] - state[4 + k]) / max(abs(state[4]), abs(state[5])) for k in (0, 1)]
    return max(np.abs(c).max() for c in changes), max(abs(trend(marks[1:], c).rise) for c in changes)


@pytest.mark.parametrize("scene_name", SCENES)
def test_momenta_that_nothing_holds_stay_for_a_million_steps(scene_name):
    """Within 1e-11, and without a trend: a bias of a hundredth of an ulp a step would rise by 2e-12."""
    largest, rise = momentum_walk(scene_name, march)
    assert largest < 1e-11
    assert rise < 2e-12


def one_iteration(par, rule, state, carry, h):
    """A step with a single Newton iteration from the last rates: the equations are solved to O(h^2) only."""
    w, v, u = carry[0]
    sums = kernel._node_sums(par, rule, state[0], (w, v, u), h)
    dw, dv, du = kernel._correction(par, sums, (w, v, u), state[3:], h)
    w, v, u = w + dw, v + dv, u + du
    sums = kernel._node_sums(par, rule, state[0], (w, v, u), h)
    p_theta, p_phi, p_psi = par.I1 * w + h * sums.after, sums.across * v + sums.mixed * u, sums.mixed * v + par.I3 * u
    step = (h * w, h * v, h * u, p_theta - state[3], p_phi - state[4], p_psi - state[5])
    return step, ((w, v, u), carry[0], carry[1]), 1, 0


def test_maps_that_invent_or_let_go_of_their_momenta_are_seen():
    """The negative control: a p_phi moved by 1e-4 sin(theta) after an otherwise right step is seen."""
    method = symtop.integrator("midpoint" + TWIN)

    def solve(top, start, plan):
        run = method.solvers["angles"](top, start, plan)
        return run._replace(p_phi=run.p_phi + 1e-4 * np.sin(run.states[:, 0]))

    variant = symtop.Integrator(name="wrong", family="other", summary="", solvers={"angles": solve})
    scene = random_scenes(1, seed=11)[0]
    step = one_step(variant, "angles", scene, 0.02)
    assert symplectic_defect(step, scene.start).size * step.unit > 1e-5
    # The negative control: equations that are not solved show in p_phi, which no parameter holds.
    largest, _ = momentum_walk("goldstein", Loop(kernel.begin, one_iteration, kernel.observe), steps=50_000)
    assert not largest < 1e-11


@pytest.mark.parametrize("rule", RULES)
def test_newtons_jacobian_is_that_of_the_discrete_legendre_transform(rule):
    """A correction misses the root by the square of the distance to it; with one wrong entry, by the distance."""
    scene, h = random_scenes(1, seed=13)[0], 0.05
    par, state = with_momenta(scene.top, scene.start)
    table, root = Quadrature(*RULES[rule][:2]), np.array(kernel._rates(par, state))

    def left_momenta(rate):
        (w, v, u), sums = rate, kernel._node_sums(par, table, state[0], rate, h)
        return par.I1 * w - h * sums.before, sums.across * v + sums.mixed * u, sums.mixed * v + par.I3 * u

    def miss(distance, spoil):
        rate = root + distance * np.array([1.0, -0.7, 0.4])
        sums = kernel._node_sums(par, table, state[0], tuple(rate), h)
        sums = sums._replace(**{name: value + 0.01 for name, value in sums._asdict().items() if name == spoil})
        return np.max(np.abs(rate + kernel._correction(par, sums, tuple(rate), left_momenta(tuple(root)), h) - root))

    assert miss(1e-3, "") / miss(5e-4, "") == pytest.approx(4.0, rel=0.02)
    for entry in ("stiffness", "before_v", "before_u", "after_v", "after_u"):
        assert miss(1e-3, entry) / miss(5e-4, entry) == pytest.approx(2.0, rel=0.3)


def test_long_horizons_do_not_slow_it_down():
    """phi beyond 1e4 rad has an ulp of 2e-12: a stop rule on the angle itself would run into its limit."""
    scene = symtop.scene("spheroid")
    short, long = (symtop.simulate(scene, "midpoint-unreduced", step_size=0.01, horizon=T, samples=11, guard=False)
                   for T in (10.0, 2000.0))  # fmt: skip
    assert abs(float(long["phi"][-1])) > 5e3
    per_step = [run.attrs["newton_iterations"] / run.attrs["steps"] for run in (short, long)]
    assert per_step[1] == pytest.approx(per_step[0], rel=0.05)
