"""Kernels that are on disk are not compiled again, and what surrounds a kernel has the bits of its Python."""

import dataclasses
import errno
import os
import random
from unittest.mock import Mock

import numpy as np
import pytest
from numba.core.codegen import CPUCodegen

import symtop
from symtop.core import jit
from symtop.core.jit import compile_kernel
from symtop.methods.framework import loop, loop as loops
from symtop.methods.framework.angles import on_angles, with_rates
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.framework.preparation import BareTop, Start
from symtop.methods.framework.space import on_attitude, on_axis, on_frame
from symtop.methods.lagrangian.unreduced import with_momenta
from symtop.methods.splitting.coefficients import METHODS
from symtop.methods.splitting.loop import exact_sum
from symtop.model.top import Angles, SymmetricTop, flat
from tests.commands import printed_by

BITS = """
import hashlib, sys, symtop
from symtop.core import jit
from symtop.methods.framework import lanes
way, count = sys.argv[1], int(sys.argv[2])
if way == "numba alone":
    jit.lean_probe = lambda: False
if way in ("stored", "bitcode"):
    jit.on_cold[:] = [lambda: sys.exit("compiled")]
lanes.FEW_STEPS = -1
rows = [f"{entry.name}[{chart}]" for entry in symtop.integrators().values() if entry.implementation == "compiled"
        for chart in entry.charts()]
for k in range(count):
    row = symtop.integrator(rows[k * (len(rows) - 1) // (count - 1)])
    setting = row.given(0.02 if row.fixed_step else 1e-7)
    runs = [symtop.simulate("spheroid", row, **setting, samples=30, guard=False)]
    if k % 3 == 0:
        runs.append(symtop.ensemble(["spheroid", "goldstein"] * 20, row, **setting, horizon=3.0, threads=1, quiet=True))
    for run in runs:
        values = [run[name].values for name in sorted(run.data_vars) if run[name].dtype.kind == "f" and run[name].ndim]
        print(row.name, hashlib.sha256(b"".join(value.tobytes() for value in values)).hexdigest())
"""


@pytest.mark.slow
def test_kernels_return_the_same_bits_whichever_way_they_were_made(tmp_path):
    """By numba alone, compiled here, from disk, from bitcode, and from that for a processor with fewer instructions."""
    x86, output, count = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}, {}, 36
    ways = {"numba alone": {}, "compiled": {}, "stored": {}, "bitcode": {}, "bitcode, x86-64": x86}
    code = lambda: {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in tmp_path.rglob("*.code")}
    for way, processor in ways.items():
        before = code()
        for file in before if way != "stored" else ():
            file.unlink()
        output[way] = printed_by(BITS, way.partition(",")[0], count, SYMTOP_CACHE=tmp_path, **processor).splitlines()
        assert len(output[way]) == count + -(-count // 3)
        assert output[way] == output["numba alone"], way
        assert way != "stored" or code() == before  # nor is machine code made of bitcode again
        if way == "bitcode":  # mostly the same machine code, and so as fast
            assert np.mean([file.read_bytes() == content for file, (content, _) in before.items()]) > 0.8
        if way == "bitcode, x86-64":
            assert not any(file.exists() for file in before)
    assert all(any(f"[{chart}]" in line for line in output["compiled"]) for chart in ("angles", "axis", "attitude"))


def _doubled(x):
    return x + x


def _kept_twice(monkeypatch, folder):
    """A kernel with code on disk for whole and for real numbers, and the two files."""
    monkeypatch.setenv("SYMTOP_CACHE", str(folder))
    kernel = compile_kernel(_doubled)
    assert not jit.is_stored(kernel)
    assert (kernel(2), kernel(2.5)) == (4, 5.0)
    assert jit.is_stored(compile_kernel(_doubled))
    files = sorted(folder.rglob("*.code"))
    assert len(files) == 2
    return kernel, files


def test_a_file_is_named_after_the_signature_whose_code_it_holds(monkeypatch, tmp_path):
    """And after the processor, so that two processes that save at once write two files."""
    kernel, files = _kept_twice(monkeypatch, tmp_path)
    codegen = kernel.targetctx.codegen()
    assert sorted(kernel._cache.files(signature, codegen)[0] for signature in kernel.overloads) == files
    monkeypatch.setattr(codegen, "magic_tuple", lambda: ("this system", "another processor", ""))
    assert not set(files) & {kernel._cache.files(signature, codegen)[0] for signature in kernel.overloads}


@pytest.mark.parametrize("swapped", [["code"], ["bitcode"], ["code", "bitcode"]])
def test_the_code_of_another_signature_is_not_run(monkeypatch, tmp_path, swapped):
    _kept_twice(monkeypatch, tmp_path)
    for kind in swapped:
        first, second = tmp_path.rglob(f"*.{kind}")
        content = first.read_bytes()
        first.write_bytes(second.read_bytes())
        second.write_bytes(content)
    kernel = compile_kernel(_doubled)
    assert (kernel(2), kernel(2.5)) == (4, 5.0)
    assert {signature[0].name for signature in kernel.signatures} == {"int64", "float64"}


def test_machine_code_is_run_with_the_bitcode_that_it_was_made_of(monkeypatch, tmp_path):
    """Names in it hang on the process that compiled: with another's, a process ended."""
    kernel, files = _kept_twice(monkeypatch, tmp_path)
    contents = [file.read_bytes() for file in files]
    for file in tmp_path.rglob("*.bitcode"):
        file.unlink()
    for number in range(3):  # more names of numba's
        compile_kernel(lambda x, number=number: x + number)(1)
    monkeypatch.setattr(jit, "_pruned", [])
    assert compile_kernel(_doubled)(2) == 4
    for file, code in zip(files, contents, strict=True):
        file.write_bytes(code)
    reloaded = compile_kernel(_doubled)
    assert ((reloaded(2), reloaded(2.5)), kernel.signatures) == ((4, 5.0), reloaded.signatures)


def test_a_full_disk_or_a_numba_that_keeps_nothing_costs_time_and_no_run(monkeypatch, tmp_path):
    full = Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(jit, "_write", full)
        assert compile_kernel(_doubled)(2.0) == 4.0
    library = jit.JITCodeLibrary
    for owner, name in ((CPUCodegen, "magic_tuple"), (library, "_get_compiled_object")):
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, property())
            assert compile_kernel(_doubled)(2.0) == 4.0
    assert not list(tmp_path.rglob("*.code"))
    assert compile_kernel(_doubled)(2.0) == 4.0
    assert list(tmp_path.rglob("*.code"))
    monkeypatch.setattr(library, "_set_compiled_object", property())
    assert compile_kernel(_doubled)(2.0) == 4.0


def test_kernels_of_one_factory_have_names_of_their_own():
    """Machine code is found by name: two stored kernels of one name, loaded into one process, would be one."""

    def adding(number):
        def added(x):
            return x + number

        return compile_kernel(added)

    first, twin, second = adding(1.0), adding(1.0), adding(2.0)
    assert (first(1.0), twin(1.0), second(1.0)) == (2.0, 2.0, 3.0)
    names = [kernel.py_func.__qualname__ for kernel in (first, twin, second)]
    assert names[0] == names[1] != names[2]


CLASH = """
import math, sys
from symtop.core import jit
def made(number):
    def within(x):
        for k in range(40):
            x = math.sin(x) + number * math.cos(x * k) + math.exp(-x * x) / (1.0 + x * x)
            for power in (3, 4, 5, 6):  # more than LLVM copies into its three callers
                x = x - math.floor(x) + math.sqrt(abs(x)) + number * x ** power / (1.0 + x ** 4 + math.tan(x) ** 2)
                x = math.atan2(x, 1.0 + power) + math.log1p(abs(x)) - math.cosh(0.1 * x) * math.sinh(0.2 * x)
        return x
    jit.register_jitable(within, jit.OPTIONS | jit.KERNEL_ONLY)
    def kernel(x):
        return within(x) + within(x + 1.0) + within(x + number)
    return jit.compile_kernel(kernel)
for number in sys.argv[2:]:
    print(made(float(number))(0.5))
"""


@pytest.mark.slow
def test_kernels_of_two_processes_do_not_call_each_others_inner_functions(tmp_path):
    """numba names an inner function by a count: those of two processes share names, and a third one loads both."""
    script = tmp_path / "clash.py"
    script.write_text(CLASH, encoding="utf-8")
    run = "import runpy, sys; runpy.run_path(sys.argv[1])"
    output = lambda *numbers: printed_by(run, script, *numbers, SYMTOP_CACHE=tmp_path / "cache").split()
    expected = [*output("0.1"), *output("0.2")]
    assert expected[0] != expected[1]
    assert output("0.1", "0.2") == expected
    for file in (tmp_path / "cache").rglob("*.code"):
        file.unlink()  # and once more from bitcode
    assert (output("0.2", "0.1"), len(list((tmp_path / "cache").rglob("*.bitcode")))) == (expected[::-1], 2)


PREPARATIONS = [on_angles, with_rates, with_momenta, on_axis, on_attitude, on_frame]


def tops(count, seed=3):
    """Random tops and starts, of all sizes."""
    draw = random.Random(seed)
    for _ in range(count):
        I1 = 10.0 ** draw.uniform(-4, 4)
        top = SymmetricTop(I1, I1 * draw.uniform(1e-3, 2.0),
                           draw.choice((0.0, 1.0, -1.0)) * 10.0 ** draw.uniform(-4, 4))  # fmt: skip
        rates = [draw.gauss(0.0, 1.0) * 10.0 ** draw.uniform(-3, 3) for _ in range(3)]
        theta = draw.choice((draw.uniform(1e-6, 3.14), 10.0 ** draw.uniform(-9, 0)))
        yield top, Angles(theta, draw.uniform(-9, 9), draw.uniform(-9, 9), *rates)


@pytest.mark.parametrize("prepare", PREPARATIONS, ids=lambda prepare: prepare.numbers.__name__)
def test_a_preparation_compiles_to_its_own_bits(prepare):
    numbers = prepare.numbers
    compiled = compile_kernel(lambda values: numbers(BareTop(*values[:3]), Start(*values[3:])))
    for top, start in tops(3000):
        par, state = compiled(flat(top, start))
        assert ((tuple(par), state), len(state)) == (tuple(map(tuple, prepare(top, start))), prepare.size)


@pytest.mark.parametrize("name", ["strang", "chin-4a", "srkn-14-6", "sofroniou-spaletta-10", "stormer-verlet-suzuki-4"])
def test_the_tables_of_a_kernel_are_closed_as_python_closes_them(name):
    """Against `math.fsum`, for any step and top: no sum of drifts or kicks is off by a rounding."""
    chart, solver = next(iter(symtop.integrator(name).solvers.items()))
    rule, draw = solver.rule.rule, random.Random(5)
    for top, start in tops(1000, seed=5):
        h = 10.0 ** draw.uniform(-6, 1)
        table = solver.rule(top, start, h)
        drift, kick = (h / top.I1, h) if chart == "angles" else (0.5 * h / top.I1, h * top.mgl)
        assert tuple(table.drift) == exact_sum([a * drift for a in rule.drift], drift)
        assert tuple(table.kick) == exact_sum([b * kick for b in rule.kick], kick)
        if chart != "angles":
            bend = 2.0 * h * kick * kick / top.I1
            assert tuple(table.bend) == tuple(c * bend for c in rule.gradient)


def assert_the_same_run(solver, top, start, plan):
    """At once, and in stretches by a solver whose preparation does not compile."""
    in_python = dataclasses.replace(solver, prepare=solver.prepare.__call__)
    at_once, stretched = solver(top, start, plan), in_python(top, start, plan)
    for first, second in zip(at_once, stretched, strict=True):
        np.testing.assert_array_equal(first, second)
    assert type(at_once.steps) is int
    assert type(at_once.force_evaluations) is int
    with pytest.raises(symtop.SymtopError, match="whose parts all compile"):
        in_python.many(np.zeros((1, 9)), np.ones(1), np.ones((1, 1), dtype=np.int64))


@pytest.mark.parametrize(("name", "chart"), [
    ("midpoint", "angles"), ("takahashi-imada", "attitude"), ("rk4", "angles"), ("gauss-4", "attitude"), *(
        pytest.param(*pair, marks=pytest.mark.quick) for pair in (
            ("midpoint-unreduced", "angles"), ("cayley-tuned", "axis"), ("stormer-verlet", "angles"),
            ("stormer-verlet-blanes-moan-6", "angles"), ("collective-gauss-6", "axis"), ("kahan-li-8", "attitude"),
            ("sofroniou-spaletta-10", "axis")))
])  # fmt: skip
def test_a_run_at_once_is_a_run_in_stretches(name, chart):
    scene, solver = symtop.scene("spheroid"), inside(symtop.integrator(name).solvers[chart])
    assert solver._whole is not None
    for marks in ([0, 1], [1], [0, 3, 10, 400], [7, 300]):
        assert_the_same_run(solver, scene.top, scene.start, symtop.Plan.steps(0.02, marks))
        assert_the_same_run(solver, scene.top, scene.start, symtop.Plan.steps(-0.02, marks))


@pytest.mark.slow
def test_every_run_at_once_is_a_run_in_stretches():
    for scene in (symtop.scene(name, bodies=True) for name in ("goldstein", "grazing", "fast", "tennis-racket")):
        for method in symtop.integrators().values():
            solvers = [solver for chart, solver in method.solvers.items() if (chart == "body") is scene.of_body]
            for solver in filter(None, map(inside, solvers)):
                for h in (scene.horizon / 400, scene.horizon / 5):
                    assert_the_same_run(solver, scene.top, scene.start, symtop.Plan.steps(h, np.arange(0, 400, 3)))


def test_long_runs_return_to_python(monkeypatch):
    """Beyond `BLOCK` steps a run is made in stretches, to the same bits, so that an interrupt is heard."""
    scene, solver = symtop.scene("spheroid"), symtop.integrator("gauss-4").solvers["attitude"]
    plan = symtop.Plan.steps(0.01, [0, 50, 100])
    expected = solver(scene.top, scene.start, plan)
    monkeypatch.setattr(loops, "BLOCK", 7)
    monkeypatch.setattr(loop, "flat", None)  # what a run in one call begins with
    np.testing.assert_array_equal(solver(scene.top, scene.start, plan).states, expected.states)


@pytest.mark.parametrize("rule", [(0.0,), np.array([0.5, 0.25])])
def test_a_rule_may_be_whatever_a_kernel_takes(rule):
    def begin(par, rule, state, h):
        return (0.0,)

    def increment(par, rule, state, carry, h):
        return (h * state[1], 0.0, 0.0, 0.0), carry, 1, 0

    def observe(par, rule, before, dstate, h):
        return 0.0, 0.0

    solver = FixedStep(loops.Loop(begin, increment, observe), rule, on_angles, 1, implicit=False)
    run = solver(SymmetricTop(1.0, 1.0, 1.0), Angles(1.0, theta_dot=0.5), symtop.Plan.steps(0.25, [0, 1, 4]))
    assert run.states[:, 0].tolist() == [1.0, 1.125, 1.5]
    assert (solver._whole is not None) == isinstance(rule, tuple)


def test_tables_and_compositions_travel_as_arrays_and_arrive_whole():
    """The negative control: scaled without closing, one table in two is off by a rounding somewhere."""
    rule, steps = METHODS["srkn-14-6"].table, np.random.default_rng(0).uniform(0.01, 0.1, 100)
    assert sum(exact_sum([a * h for a in rule.drift], h) != tuple(a * h for a in rule.drift) for h in steps) > 20
    # Numbers of every kind, a rule that hangs on the start included, to the bits of the rule that Python makes.
    scene = symtop.scene("spheroid")
    drift, kick = [0.1, 0.2, 0.4, 0.2, 0.1], [0.05, 0.15, 0.3, 0.3, 0.15, 0.05]
    for options in ({"rotation": "cayley-tuned"}, {"gradient": [0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0], "processor": 0.01}):
        for solver in symtop.composition("long", drift, kick, chart="space", **options).solvers.values():
            assert solver._whole.rule[1].tolist()[:11] == [*solver.rule.rule.drift, *solver.rule.rule.kick]
            assert_the_same_run(solver, scene.top, scene.start, symtop.Plan.steps(0.02, [0, 1, 300]))
