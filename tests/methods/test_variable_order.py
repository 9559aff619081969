"""Methods of variable order: coefficients of Adams on any nodes, SciPy's Adams codes, lines of an extrapolation."""

import itertools

import numpy as np
import pytest
from scipy import integrate

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.runge_kutta import adams, extrapolation
from symtop.methods.runge_kutta.adams import ALPHA, BETA, GAMMA, HIGHEST, LAST, NUMBERS, PSI, SIGMA, G
from symtop.model.scenes import closed_form


def prepared(steps, h, k):
    """The memory with the psi of past steps, the newest first, and the coefficients of a step h of order k."""
    memory = np.zeros((LAST + 1, 6))
    memory[NUMBERS : NUMBERS + len(steps), PSI] = np.cumsum(steps)
    adams.coefficients(memory, k, h)
    return memory[NUMBERS : NUMBERS + k + 1]


def test_coefficients_of_equal_steps_are_those_of_adams_and_bashforth():
    made = prepared(np.full(13, 0.25), 0.25, 12)
    np.testing.assert_allclose(made[:7, G], [1, 1 / 2, 5 / 12, 3 / 8, 251 / 720, 95 / 288, 19087 / 60480], rtol=1e-13)
    np.testing.assert_array_equal(made[:12, BETA], 1.0)
    np.testing.assert_allclose(made[:, SIGMA], 1.0, rtol=1e-14)
    np.testing.assert_allclose(made[:12, ALPHA], 1.0 / np.arange(1, 13), rtol=1e-15)
    np.testing.assert_allclose(GAMMA[:6], [1, 1 / 2, 1 / 12, 1 / 24, 19 / 720, 3 / 160], rtol=1e-13)
    np.testing.assert_allclose(np.diff(made[:7, G]), -np.array(GAMMA[1:7]), rtol=1e-12)  # gamma*_j


@pytest.mark.parametrize("k", range(1, HIGHEST + 1))
def test_a_predictor_integrates_polynomials_below_its_order_on_any_nodes_and_no_higher_one(k):
    rng = np.random.default_rng(k)
    past, h = rng.uniform(0.5, 2.0, 13), 0.8
    nodes = -np.concatenate([[0.0], np.cumsum(past)])[:k]
    made = prepared(past, h, k)
    for degree in range(k + 1):
        f = nodes**degree if degree else np.ones(k)
        differences = []  # psi_1 .. psi_i f[t_n, .., t_{n-i}], of the nodes behind
        table = f.astype(float)
        factor = 1.0
        for i in range(k):
            differences.append(factor * table[0])
            if i + 1 < k:
                table = (table[:-1] - table[1:]) / (nodes[: -i - 1] - nodes[i + 1 :])
                factor *= nodes[0] - nodes[i + 1]
        terms = h * made[:k, G] * made[:k, BETA] * differences
        exact = h ** (degree + 1) / (degree + 1)
        gap = abs(np.sum(terms) - exact) / max(np.abs(terms).sum(), exact)
        assert gap < 1e-11 if degree < k else gap > 1e-2, (degree, gap)


@pytest.mark.parametrize("name", ["spheroid", "goldstein"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_it_needs_no_more_evaluations_than_scipys_adams_codes_and_errs_no_more(name, tolerance):
    scene = symtop.scene(name)
    field = symtop.field("axis", scene.top)
    times = np.linspace(0.0, scene.horizon, 33)
    truth = symtop.reference(scene, times)["axis"].values
    run = symtop.simulate(scene, "adams[axis]", tolerance=tolerance, samples=33, guard=False)
    error = float(symtop.errors(run)["axis"].max())
    start = field.state(scene.start)
    lsoda = integrate.solve_ivp(
        field, (0.0, scene.horizon), start, method="LSODA", rtol=tolerance, atol=tolerance, t_eval=times
    )
    count = [0]

    def counted(t, y):
        count[0] += 1
        return field(t, y)

    vode = integrate.ode(counted).set_integrator("vode", method="adams", rtol=tolerance, atol=tolerance, nsteps=10**6)
    vode.set_initial_value(start, 0.0)
    states = np.array([vode.integrate(t)[:3] for t in times[1:]])
    for evaluations, axis in ((lsoda.nfev, lsoda.y[:3].T), (count[0], np.vstack([truth[:1], states]))):
        assert run.attrs["force_evaluations"] < 1.02 * evaluations
        assert error < 1.1 * np.linalg.norm(axis - truth, axis=1).max()


@pytest.mark.parametrize("chart", list(FORMULATIONS))
@pytest.mark.parametrize(("name", "tolerances"), [
    ("adams", (1e-5, 1e-8, 1e-11)),  # at 1e-4 a quaternion is longer than one by more than 0.1 %, an outcome
    ("extrapolation", (1e-4, 1e-8, 1e-12)),
])  # fmt: skip
def test_errors_follow_the_tolerance_and_orders_rise_with_it(name, tolerances, chart):
    runs = [
        symtop.simulate("spheroid", f"{name}[{chart}]", tolerance=tolerance, samples=161, guard=False)
        for tolerance in tolerances
    ]
    assert [run.attrs["outcome"] for run in runs] == ["ok"] * 3
    errors = [float(symtop.errors(run)["axis"].max()) for run in runs]
    assert all(50.0 * fine < coarse for coarse, fine in itertools.pairwise(errors))
    assert errors[-1] < 1e-9
    counts = [run.attrs["force_evaluations"] for run in runs]
    steps = [run.attrs["steps"] for run in runs]
    if name == "adams":
        assert counts[-1] < 5.6 * counts[0]  # of one order k it would be 1000^(2/k) times: k = 8 and more
        assert all(2 * made <= count for made, count in zip(steps, counts, strict=True))
    else:
        assert counts[0] / steps[0] < counts[1] / steps[1] < counts[2] / steps[2]
        assert steps[2] < 2.5 * steps[0]  # of one order: hundreds of times as many


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


def test_huge_times_begin_and_a_step_rounded_to_what_it_was_halved_from_ends_the_run():
    """Its first step is far below the spacing of numbers at its end, on whose grid steps lie: it stood still."""
    top = symtop.SymmetricTop(5.8e10, 5.6e10, -7.2e-12)
    scene = symtop.Scene("slow", top, symtop.Angles(1.7, 1.6, 2.8, 4.7e-12, -2.4e-11, -4.6e-11), 1.1e13)
    run = symtop.simulate(scene, "adams", tolerance=1e-9, samples=11, budget=1e5)
    assert run.attrs["outcome"] == "ok"
    assert float(symtop.errors(run)["axis"].max()) < 1e-3
    # The energy has blown up by then, and steps are as long as what times are rounded by; it ran for ever.
    top = symtop.SymmetricTop(0.3138360947869337, 0.4179762569907529, 4.007653015081924)
    rate = 0.4277222539612995
    scene = symtop.Scene("drawn", top, symtop.Angles(3.0, theta_dot=rate, psi_dot=rate), 46.7593159223593)
    run = symtop.simulate(scene, "adams[attitude]", tolerance=0.08613785662111073, budget=2000, guard=False)
    assert run.attrs["outcome"] != "ok"
    assert run.attrs["reached_time"] < 4.0
