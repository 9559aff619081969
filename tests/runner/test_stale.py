"""A number is stale if what it was made of is edited, and no other is; `--status --why` says by which edit."""

import contextlib
import dataclasses
import importlib
import json
import linecache
import shutil
import sys
from types import FunctionType

import pytest

import symtop
from symtop.core import code_hash, jit
from symtop.core.code_hash import PACKAGE
from symtop.methods.framework.registry import is_built_in
from symtop.report import style
from symtop.runner import fingerprint, run as runner
from symtop.runner.cases import status
from symtop.runner.run import drawing_digest
from tests.commands import PROBE, probe, stdout_of, symtop as symtop_command


@contextlib.contextmanager
def edited(place):
    """Let a function ``module:name`` have one more constant, which no instruction uses; all is looked at anew."""
    module, _, name = place.partition(":")
    function = importlib.import_module(module)
    for part in name.split("."):
        function = getattr(function, part)
    function = getattr(function, "py_func", getattr(function, "__wrapped__", function))
    assert isinstance(function, FunctionType)
    before = function.__code__
    function.__code__ = before.replace(co_consts=(*before.co_consts, "edited"))
    forget()
    try:
        yield
    finally:
        function.__code__ = before
        forget()


def forget():
    fingerprint._known.clear()
    fingerprint.reached.cache_clear()


def digests(study):
    """The digest of each quick case."""
    return [fingerprint.digest(study, case) for case in study.cases(True)]


def stale_after(places, study, before):
    """Integrators of a study's cases whose digest changes with edits; what an earlier one left behind would too."""
    with contextlib.ExitStack() as edits:
        for place in places.split():
            edits.enter_context(edited(place))
        after = digests(study)
    return {case.integrator for case, old, new in zip(study.cases(True), before, after, strict=True) if old != new}


def of_everyone():
    """The probe with every integrator of the registry."""
    cases = [symtop.Case("goldstein", name, {}) for name in symtop.integrators()]
    return dataclasses.replace(runner.load(str(PROBE)), cases=lambda quick: cases)


@pytest.fixture(scope="module")
def everyone():
    """That study and its digests."""
    study = of_everyone()
    return study, digests(study)


GAUSS_FILE = "symtop/methods/runge_kutta/gauss.py"
GAUSS = {f"gauss-{order}" for order in (2, 4, 6, 8, 10, 12)}
METHODS = "symtop.methods"


@pytest.mark.parametrize(("place", "stale"), [
    (f"{METHODS}.runge_kutta.gauss:solve_stages", GAUSS),
    (f"{METHODS}.lagrangian.discrete_lagrangian:forces", {"midpoint", "trapezoidal", "simpson-linear"}),
    (f"{METHODS}.library.scipy_ivp:compiled_field", {"rk45", "dop853", "lsoda", "radau"}),
    (f"{METHODS}.runge_kutta.explicit:later_stages", {"euler", "rk4"}),  # the watch of guards reaches what pairs are of
    (f"{METHODS}.lie_group.generalised_alpha:_correct", {"generalised-alpha"}),
    (f"{METHODS}.taylor.heyoka:propagate", {"taylor", "taylor-longdouble", "taylor-quad"}),
    ("symtop.cli.common:as_text symtop.report.page:write symtop.measure.accuracy:error_row", set()),
])  # fmt: skip
def test_an_edited_kernel_makes_the_cases_that_use_it_stale_and_no_others(everyone, place, stale):
    """In a study that runs every integrator and compares with no reference."""
    assert {name for name in stale_after(place, *everyone) if is_built_in(name)} == stale


@pytest.mark.parametrize("place", [
    "symtop.model.top:SymmetricTop.potential", "symtop.run.simulation:simulate",
    "symtop.model.exact.constants:all_constants", "symtop.methods.framework.calling:solve",
])  # fmt: skip
def test_an_edit_of_what_all_cases_reach_makes_all_stale(everyone, place):
    assert stale_after(place, *everyone) == set(symtop.integrators())


def test_measure_code_and_the_reference_make_the_cases_of_their_study_stale():
    convergence = runner.load("convergence")
    names, before = {case.integrator for case in convergence.cases(True)}, digests(convergence)
    for place in ("symtop.run.reference.truth:reference", "symtop.measure.accuracy:error_row"):
        assert stale_after(place, convergence, before) == names, place
    places = "symtop_studies.convergence.figures:pictures symtop.measure.step_map:step_map"
    assert (stale_after(places, convergence, before), digests(convergence)) == (set(), before)


@pytest.mark.parametrize(("place", "remade"), [
    ("symtop_studies.cost.cells:winners", True), ("symtop_studies.cost.facts:facts", True),
    ("symtop.measure.datasets:_dense", True), ("symtop.cli.common:as_text", False),
    ("symtop_studies.drift.facts:facts", False),
])  # fmt: skip
def test_findings_are_made_again_when_what_draws_or_judges_them_is_edited(place, remade):
    study = runner.load("cost")
    before = drawing_digest(study, style.save)
    with edited(place):
        assert (drawing_digest(study, style.save) != before) is remade
    assert drawing_digest(study, style.save) == before


def test_coefficients_count(clean_registry):
    study, case = of_everyone(), symtop.Case("goldstein", "chin-4a", {})
    method = symtop.integrator("chin-4a")
    before, solver = fingerprint.reasons(study, case), method.solvers["axis"]
    kicks = solver.rule.rule.kick
    nudged = solver.rule.rule._replace(kick=(kicks[0] * (1.0 + 1e-15), *kicks[1:]))
    variant = dataclasses.replace(solver.rule, rule=nudged)
    method = dataclasses.replace(method, solvers={"axis": dataclasses.replace(solver, rule=variant)})
    symtop.register(method, replace=True)
    assert "integrator chin-4a" in code_hash.changes(before, fingerprint.reasons(study, case))


def test_a_case_depends_on_the_integrators_that_its_study_says_it_runs():
    reduction = runner.load("reduction")
    twins = next(case for case in reduction.cases(True) if case.settings["part"] == "twins")
    assert fingerprint.uses(reduction, twins) == sorted(["exact", twins.integrator, f"{twins.integrator}-unreduced"])
    study = dataclasses.replace(reduction, uses=None)
    assert fingerprint.uses(study, twins) == sorted(["exact", twins.integrator])
    case = symtop.Case("goldstein", "together", {"integrators": ["rk4[axis]", "strang[axis]"]})
    assert fingerprint.uses(study, case) == ["exact", "rk4", "strang"]
    assert fingerprint.uses(of_everyone(), symtop.Case("goldstein", "*", {})) == sorted(symtop.integrators())


def test_digests_are_the_same_whatever_the_process_has_run_or_registered():
    """Values that calls have left in modules are state and count for nothing."""
    studies = [runner.load(name) for name in ("convergence", "cost", "notebook")]
    cases = [(study, case) for study in studies for case in study.cases(True)[:20]]
    before = [fingerprint.digest(*pair) for pair in cases]
    symtop.simulate("spheroid", "strang", step_size=0.01)
    symtop.reference("cusp", [0.0, 1.0])
    symtop.ensemble(symtop.population(5, seed=1), "rk4", step_size=0.01, horizon=0.1, samples=3)
    studies[0].measure(cases[0][1])
    forget()
    assert [fingerprint.digest(*pair) for pair in cases] == before

    def part(x):
        return 2.0 * x

    before = jit.code().reasons("part", part)
    jit.register_jitable(part)
    assert jit.code().reasons("part", part) == before
    assert jit.code_of(part)[1].values != jit.code().reached("part", part)[1].values  # the control: kernels see it


def test_a_constant_of_the_script_counts_and_a_caption_does_not(tmp_path):
    script, text = tmp_path / "counted.py", PROBE.read_text()
    versions = [text, text.replace("Is it whole?", "Is it?").replace("figsize=(2, 2)", "figsize=(3, 2)")]
    for used, definition in (
        ("STEPS", "STEPS = {}"),
        ("len(helper())", "def helper():\n    return range({})"),
        ("cached()", "@functools.cache\ndef cached():\n    return {}"),
        ("Few().count()", "class Few:\n    def count(self):\n        return {}"),
    ):
        assert text.count("samples=51") == 1
        versions += [f"{text.replace('samples=51', f'samples={used}')}\n\n{definition.format(n)}\n" for n in (51, 53)]
    digests = set()
    for version in versions:
        script.write_text("import functools\n" + version)
        sys.modules.pop("symtop_study_counted", None)
        linecache.checkcache()
        importlib.invalidate_caches()
        shutil.rmtree(tmp_path / "__pycache__", ignore_errors=True)
        study = runner.load(str(script))
        digests.add(fingerprint.digest(study, study.cases(True)[0]))
    assert len({*versions}) == 10
    assert len(digests) == 9  # what is asked and drawn changes nothing


def test_a_missing_case_is_told_by_its_settings_and_by_what_was_edited(tmp_path):
    study = runner.load(str(PROBE))
    probe(tmp_path)
    coarser = dataclasses.replace(study, cases=lambda quick: [symtop.Case("loop", "midpoint", {"step_size": 0.02})])
    for place, causes in (("cli.common:as_text", []), ("model.top:SymmetricTop.energy", ["code symtop/model/top.py"])):
        with edited(f"symtop.{place}"):
            (row,) = status(coarser, tmp_path / "quick", why=True)
        assert (row["state"], row["why"]) == ("missing", ["setting step_size", *causes])


PLUGIN = """
import pathlib, sys
sys.path.insert(0, str(pathlib.Path(__file__).parent))
import symtop
from coeffs import W

symtop.register(symtop.runge_kutta("bad-of-a-user", ((), (0.5,)), W, order=2))
"""


@pytest.mark.slow
def test_an_edit_of_each_family_is_named_by_status_and_is_all_that_is_computed(tmp_path):
    """Through the command line, in a copy of the package, with a study and a plug-in of a user's own."""
    for name in ("symtop", "studies"):
        shutil.copytree(PACKAGE.parent / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(PROBE, tmp_path / "probe.py")
    (tmp_path / "plug.py").write_text(PLUGIN)
    (tmp_path / "coeffs.py").write_text("W = (0.0, 1.0)\n")
    words = ["study", tmp_path / "probe.py", "--plugin", tmp_path / "plug.py", "--results", tmp_path / "r"]

    def command(*options):
        return stdout_of(symtop_command(*words, *options, cwd=tmp_path, PYTHONPATH=tmp_path))

    assert "14 of 14 cases computed" in command()
    edits = [
        (tmp_path / GAUSS_FILE, "\n", "\n# a comment\n", None, set()),
        (tmp_path / "coeffs.py", "(0.0, 1.0)", "(0.5, 0.5)", "integrator bad-of-a-user", {"bad-of-a-user"}),
        (tmp_path / GAUSS_FILE, "    place = state\n", "    place, _ = state, 0\n", f"code {GAUSS_FILE}", {"gauss-4"}),
        (tmp_path / "probe.py", "samples=51", "samples=53", "code probe.py", "all"),
    ]
    for file, before, after, why, stale in edits:
        text = file.read_text()
        assert before in text
        file.write_text(text.replace(before, after, 1))
        rows = json.loads(command("--status", "--why", "--json"))["probe"]
        names = {row["integrator"] for row in rows} if stale == "all" else stale
        assert {row["integrator"] for row in rows if row["state"] == "stale"} == names, file
        assert all(row["why"] == [why] for row in rows if row["state"] == "stale"), rows
        assert f"{sum(row['state'] == 'stale' for row in rows)} of 14 cases computed" in command()
