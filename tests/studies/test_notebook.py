"""The notebook that the project began with: its algebra checked symbolically, its numbers, its inconsistencies."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.notebook import facts
from symtop_studies.notebook.derivations import easy_way, hard_way, notebook_top, nutation_cubic, with_alpha
from symtop_studies.notebook.long_energy import better_from
from symtop_studies.notebook.measures import SOLVER, SOLVER_TOLERANCE, both_derivations, residual_history
from symtop_studies.notebook.study import STUDY, cases, measure

import symtop
from symtop.measure import datasets
from symtop.methods.framework.angles import accelerations, momenta
from symtop.methods.lagrangian.discrete_lagrangian import RULES
from symtop.run.modified_energy import modified_energy
from tests.templates import checked_page

FIRST = symtop.scene("spheroid").top
NUMBERS = (FIRST.I1, FIRST.I3, FIRST.mgl)


class Symbols:
    """The Lagrangian of the top as heyoka's expressions, and what follows from it by differentiation alone."""

    def __init__(self):
        hy = pytest.importorskip("heyoka", reason="heyoka, whose expressions are differentiated here, is not installed")
        self.hy = hy
        self.q = hy.make_vars("theta", "phi", "psi")
        self.v = hy.make_vars("theta_dot", "phi_dot", "psi_dot")
        I1, I3, mgl = NUMBERS
        (theta, _, psi), (theta_dot, phi_dot, psi_dot) = self.q, self.v
        s, c, sp, cp = hy.sin(theta), hy.cos(theta), hy.sin(psi), hy.cos(psi)
        w = (phi_dot * s * sp + theta_dot * cp, phi_dot * s * cp - theta_dot * sp, phi_dot * c + psi_dot)
        V, inertia = mgl * c, ((I1, 0.0, 0.0), (0.0, I1, 0.0), (0.0, 0.0, I3))
        self.ways = (
            0.5 * I1 * (w[0] ** 2 + w[1] ** 2) + 0.5 * I3 * w[2] ** 2 - V,
            0.5 * sum(w[i] * inertia[i][j] * w[j] for i in range(3) for j in range(3)) - V,
            0.5 * I1 * (theta_dot**2 + phi_dot**2 * s**2) + 0.5 * I3 * (psi_dot + phi_dot * c) ** 2 - V,
        )

    def values(self, expressions, points):
        """Numbers of expressions at points (n, 6) of (theta, phi, psi, theta', phi', psi'); shape (len, n)."""
        return self.hy.cfunc(list(expressions), [*self.q, *self.v])(np.ascontiguousarray(points.T))


@pytest.fixture(scope="module")
def symbols():
    return Symbols()


@pytest.fixture(scope="module")
def points():
    draw = np.random.default_rng(7)
    return np.column_stack([draw.uniform(0.3, 2.8, 200), draw.uniform(-3, 3, (200, 5))])


def test_accelerations_and_momenta_of_the_kernels_are_those_of_the_symbolic_lagrangian(symbols, points):
    """d/dt dL/dv - dL/dq = 0 by differentiation, solved for the accelerations, against the kernels' formula."""
    hy, L = symbols.hy, symbols.ways[1]
    mass = [[hy.diff(hy.diff(L, a), b) for b in symbols.v] for a in symbols.v]
    force = [
        hy.diff(L, q) - sum(hy.diff(hy.diff(L, v), p) * rate for p, rate in zip(symbols.q, symbols.v, strict=True))
        for q, v in zip(symbols.q, symbols.v, strict=True)
    ]
    M = symbols.values([entry for row in mass for entry in row], points).T.reshape(-1, 3, 3)
    true = np.linalg.solve(M, symbols.values(force, points).T[..., None])[..., 0]
    for point, expected in zip(points, true, strict=True):
        assert accelerations(*NUMBERS, point[0], *point[3:]) == pytest.approx(expected, rel=1e-11, abs=1e-11)
    top = symtop.SymmetricTop(*NUMBERS)
    slopes = symbols.values([symbols.hy.diff(symbols.ways[0], v) for v in symbols.v[1:]], points)
    for k, point in enumerate(points):
        assert top.momenta(symtop.Angles(*point))[:2] == pytest.approx(slopes[:, k], rel=1e-12, abs=1e-12)
        assert momenta(top, point[0], point[4], point[5]) == pytest.approx(slopes[:, k], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("method", ["midpoint", "trapezoidal", "simpson-linear"])
def test_a_step_of_the_kernels_is_the_discrete_legendre_transform(symbols, method):
    """p0 = -D1 L_d and p1 = D2 L_d with L_d made of the symbolic Lagrangian: differentiated, not derived by hand."""
    scene, h = symtop.scene("spheroid"), 0.01
    hy, rule = symbols.hy, RULES[method]
    first, last = hy.make_vars("a0", "a1", "a2"), hy.make_vars("b0", "b1", "b2")
    L_d = 0.0
    for node, weight in zip(*rule[:2], strict=True):
        place = {f"{q}": a + node * (b - a) for q, a, b in zip(symbols.q, first, last, strict=True)}
        place |= {f"{v}": (b - a) / h for v, a, b in zip(symbols.v, first, last, strict=True)}
        L_d = L_d + h * weight * hy.subs(symbols.ways[2], place)
    slopes = hy.cfunc([*(hy.diff(L_d, a) for a in first), *(hy.diff(L_d, b) for b in last)], [*first, *last])
    plan = symtop.Plan(np.array([0.0, h]), h, h, np.array([0, 1]), math.nan)
    run = symtop.integrator(method).solvers["angles"](scene.top, scene.start, plan)
    q = run.states[:, [0, 2, 3]]
    ends = slopes(np.concatenate([q[0], q[1]]))
    assert -ends[:3] == pytest.approx([run.states[0, 1], run.p_phi[0], run.p_psi[0]], abs=1e-11)
    assert ends[3:] == pytest.approx([run.states[1, 1], run.p_phi[1], run.p_psi[1]], abs=1e-11)
    assert -ends[1:3] == pytest.approx(ends[4:], abs=1e-11)  # Noether, one step


def test_its_solver_keeps_five_figures_of_energy_and_six_of_momentum_and_no_more():
    """A constant of n figures stays within one unit of its n-th figure of its mean, and does not within a tenth."""
    run = residual_history(symtop.scene("spheroid"), SOLVER, SOLVER_TOLERANCE)
    midpoint = residual_history(symtop.scene("spheroid"), "midpoint", 0.01)
    for name, figures in (("energy", 5), ("p_phi", 6), ("p_psi", 6)):
        unit = 10.0 ** (math.floor(math.log10(abs(float(run[name][0])))) + 1 - figures)
        assert 0.1 * unit <= float(np.max(np.abs(run[name].values - run[name].values.mean()))) < unit, name
        if name != "energy":
            assert np.ptp(midpoint[name].values) < 1e-7 * unit


@pytest.mark.parametrize("name", ["spheroid", "goldstein"])
def test_the_hard_way_and_the_easy_way_agree(name):
    scene, draw = symtop.scene(name), np.random.default_rng(3)
    top, start = scene.top, scene.top.momenta(scene.start)
    for theta, theta_dot in zip(draw.uniform(0.2, 2.9, 100), draw.uniform(-3, 3, 100), strict=True):
        phi_dot = (start.p_phi - start.p_psi * math.cos(theta)) / (top.I1 * math.sin(theta) ** 2)
        psi_dot = start.p_psi / top.I3 - phi_dot * math.cos(theta)
        hard = hard_way(scene)(0.0, np.array([0.1, theta, 0.2, phi_dot, theta_dot, psi_dot]))
        easy = easy_way(scene)(0.0, np.array([0.1, theta, 0.2, theta_dot]))
        assert easy[[0, 2, 1]] == pytest.approx(hard[:3][[0, 2, 1]], rel=1e-12, abs=1e-12)
        assert easy[3] == pytest.approx(hard[4], rel=1e-11, abs=1e-11)  # round-off of terms in 1/sin^3
        kernel = accelerations(top.I1, top.I3, top.mgl, theta, theta_dot, phi_dot, psi_dot)
        assert hard[[4, 3, 5]] == pytest.approx(kernel, rel=1e-11, abs=1e-10)
    gaps = both_derivations(scene)
    assert float(gaps["ways_gap"].max()) < 1e-10
    assert float(gaps["hard_gap"].max()) < 1e-10


def test_radii_give_the_inertia_and_alpha_contradicts_a_release_at_rest():
    top, radii = notebook_top()
    assert radii == pytest.approx((2.73861, 1.58114), abs=5e-6)
    assert pytest.approx((2.0, 1.0), rel=1e-15) == (top.I1, top.I3)
    assert round(top.mgl, 4) == 26.8658
    for mass, polar, equatorial in ((1.0, 2.0, 1.0), (0.3, 0.1, 0.7)):
        body = symtop.SymmetricTop.from_spheroid(mass, polar, equatorial)
        assert body.spheroid_radii(mass) == pytest.approx((polar, equatorial), rel=1e-13)
    with pytest.raises(symtop.SymtopError, match="no spheroid"):
        symtop.SymmetricTop(1.0, 2.0, 1.0).spheroid_radii(1.0)
    with pytest.raises(symtop.SymtopError, match="mass"):
        top.spheroid_radii(0.0)
    scene = symtop.scene("goldstein")
    cubic = nutation_cubic(scene)
    assert cubic == pytest.approx((1.4981443962885, 2.0, 2.5, 1.7), abs=1e-13)
    u = math.cos(math.radians(43.0))
    assert cubic(u) == pytest.approx(0.0, abs=1e-14)  # at rest
    assert cubic._replace(alpha=1.6)(u) == pytest.approx(0.0473752579827533, abs=1e-14)  # as printed
    assert with_alpha(scene, 1.6, -1.0).start.theta_dot == pytest.approx(-0.31914824723237937, abs=1e-14)
    for name, sign in (("goldstein-rising", 1.0), ("goldstein-falling", -1.0)):
        assert with_alpha(scene, 1.6, sign).start.theta_dot == pytest.approx(symtop.scene(name).start.theta_dot)
        assert nutation_cubic(symtop.scene(name)).alpha == pytest.approx(1.6, abs=1e-14)
    with pytest.raises(symtop.SymtopError, match="alpha"):
        with_alpha(scene, 1.4, 1.0)


def test_the_lagrangian_is_the_same_in_three_forms_and_another_modified_energy_is_not_conserved(symbols, points):
    lagrangians = symbols.values(symbols.ways, points)
    assert np.ptp(lagrangians, axis=0).max() < 1e-13
    assert np.std(lagrangians[0]) > 1.0
    for coordinate in symbols.q[1:]:  # phi and psi are cyclic, psi although two of the three forms contain it
        for way in symbols.ways:
            assert np.abs(symbols.values([symbols.hy.diff(way, coordinate)], points)).max() < 1e-13
    scene = symtop.scene("spheroid")
    run = symtop.simulate(scene, "midpoint", step_size=0.01, guard=False)
    states, h = np.stack([run["theta"].values, run["p_theta"].values], axis=1), run.attrs["step_size"]
    names = "midpoint", "stormer-verlet"
    midpoint, verlet = (np.ptp(modified_energy(scene, name, "angles", states, h)) for name in names)
    assert midpoint < 0.02 * np.ptp(run["energy"].values) < verlet


@pytest.fixture(scope="module")
def data():
    """The quick grid, with shorter long runs."""
    grid = [symtop.Case(case.scene, case.integrator, case.settings | {"long": 100.0}) for case in cases(True)]
    return datasets.combine([(case, measure(case)) for case in grid])


def test_the_page_says_what_the_notebook_and_the_discrete_methods_keep(data, tmp_path):
    checked_page("notebook", data, tmp_path)
    answers = facts.facts(data)
    assert (answers["compared"], answers["discrete"], answers["momenta_kept"]) == (5, 5, 5)
    assert answers["momenta"] < 1e-14
    assert answers["solver_momenta"] > 1e-7  # the control
    assert max(answers["ways"], answers["energies"]) < 1e-10
    mirrored = data.assign(hard_theta=2.0 * data["true_theta"] - data["hard_theta"])
    assert facts.facts(mirrored)["followed"] == pytest.approx(answers["followed"]) != pytest.approx(0.0, abs=1e-6)
    ended = data.assign(p_psi_largest=data["p_psi_largest"].where(data["variant"] != "strang[axis]"))
    assert facts.facts(ended)["momenta_kept"] == 4
    assert (answers["first_turned"], answers["second_turned"]) == pytest.approx((90.0, 90.0), abs=0.1)
    assert (answers["alpha_at_rest"], answers["alpha_rate"]) == pytest.approx((1.4981443962885, 0.31914824723237937))
    assert (answers["power_least"], answers["modified_most"]) == pytest.approx((2.0, 4.0), abs=0.06)
    assert [answers[name] for name in ("first_behind", "second_behind", "second_ahead")] == [5, 2, 3]  # to 100 s


@pytest.mark.parametrize("name", ["midpoint[angles]", "strang[axis]", SOLVER])
def test_one_method_alone_has_the_facts_and_figures_that_are_its_own(data, name, tmp_path):
    part = data.sel(variant=[name])
    answers = facts.facts(part)
    assert answers.keys() == facts.facts(data).keys()
    assert (answers["momenta"] is None) is (answers["ways"] is not None) is (name == SOLVER)
    assert [picture.name for picture in STUDY.pictures(part)] == ["energy", "modified-energy"][: 1 + (name[0] == "m")]
    assert len(facts.tables(part)["kept"]) == 2


def long_runs(level, slope):
    """A discrete method of a level energy error beside a solver whose error grows with time, to t = 1000."""
    time = np.geomspace(1.0, 1000.0, 301)
    coords = {"scene": ["spheroid"], "variant": ["midpoint[angles]", SOLVER]}
    return xr.Dataset({
        "long_time": (("scene", "variant", "long"), [[time, time]]),
        "long_energy": (("scene", "variant", "long"), [[np.full(301, level), slope * time]]),
        "energy_largest": (("scene", "variant"), [[level, slope * 8.0]]),
        "sample_time": (("scene", "variant", "sample"), np.full((1, 2, 1), 8.0)),
    }, coords=coords)  # fmt: skip


def test_momenta_beside_the_solvers_are_those_compared_and_the_notebooks_question_is_answered(data):
    part = data.sel(variant=["cayley[axis]"]).assign_coords(variant=["five-rotations[attitude]"])
    answers = facts.facts(xr.concat([data, part.assign(p_psi_largest=part["p_psi_largest"] + 1e-3)], "variant"))
    assert (answers["compared"], answers["discrete"], answers["momenta_kept"]) == (6, 6, 5)  # all of order two
    assert answers["momenta"] == facts.facts(data)["momenta"]
    assert facts.facts(data.assign(p_psi_largest=data["p_psi_largest"] + 1e-3))["momenta"] > 9e-4  # the control
    runs = long_runs(3e-5, 1e-7)
    time = runs["long_time"].values[0, 0]
    assert better_from(runs, "spheroid", "midpoint[angles]") == time[time > 300.0][0]
    runs["long_energy"][0, 0, -1] = math.nan  # a run that has ended is no better
    assert better_from(runs, "spheroid", "midpoint[angles]") == math.inf
    never, always = long_runs(3e-5, 1e-9), long_runs(1e-9, 1e-7)
    assert better_from(never, "spheroid", "midpoint[angles]") == math.inf
    assert better_from(always, "spheroid", "midpoint[angles]") == 0.0
