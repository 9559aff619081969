"""What a number was made of: labels, reasons, text and whole files; kernels and checkpoints by their code."""

import cProfile
import dataclasses
import importlib.metadata
import inspect
import os
import shutil
import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import types

import symtop
from symtop.core import code_hash, files, jit
from symtop.core.code_hash import Code, by_file, changes, digest, merged
from symtop.run.plugins import execute
from symtop.runner import fingerprint, run as runner
from tests.commands import PROBE, printed_by

SCRIPT = """
import math
from symtop.methods.runge_kutta import gauss
from symtop.measure.datasets import differences

STEPS = (5,)
CAPTION = "unused"
state = {"calls": 0}

def measure():
    from symtop.measure.errors import error_bound
    state["calls"] += 1
    return part() + STEPS[0]

def part():
    return math.sin(gauss.STILL_COMPONENT)
"""


def test_a_script_counts_by_the_functions_and_globals_that_are_reached(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    module = execute("fingerprint_script", tmp_path / "script.py")
    labels = {part.label for part in Code().reached("measure", module.measure)}
    assert {"function script.py:measure", "function script.py:part", "constant script.py:STEPS"} <= labels
    assert "function symtop/measure/errors.py:error_bound" in labels  # imported when the function runs
    assert not any(name in label for label in labels for name in ("cases.py", "CAPTION", "state"))
    before = Code().reasons("measure", module.measure)
    module.state["calls"] = 9  # what calls leave behind is no part of code
    assert Code().reasons("measure", module.measure) == before
    module.STEPS = (6,)
    assert changes(before, Code().reasons("measure", module.measure)) == ["code script.py"]


def test_words_do_not_count_and_numbers_do():
    reasons_of = lambda value: Code().reasons("thing", value)
    scene = symtop.scene("spheroid")
    assert reasons_of(dataclasses.replace(scene, purpose="said otherwise", units="")) == reasons_of(scene)
    assert reasons_of(dataclasses.replace(scene, horizon=9.0)) != reasons_of(scene)
    method = symtop.integrator("strang")
    assert reasons_of(dataclasses.replace(method, summary="said otherwise")) == reasons_of(method)
    assert reasons_of(dataclasses.replace(method, order=4)) != reasons_of(method)


def test_a_replaced_integrator_is_walked_again_even_where_memory_is_used_again(clean_registry):
    study, method = runner.load(str(PROBE)), symtop.integrator("midpoint")
    case, digests = next(case for case in study.cases(True) if case.integrator == "midpoint"), []
    for order in range(2, 12):
        symtop.register(dataclasses.replace(method, order=order), replace=True)
        digests.append(fingerprint.digest(study, case))
    symtop.register(method, replace=True)
    assert (len(set(digests)), digests[0]) == (10, fingerprint.digest(study, case))


CLASSES = """
class Base:
    def count(self):
        return BASE

class Few(Base):
    COUNT = {}

BASE = {}

def measure():
    '''{}'''
    from . import nothing  # {}
    return Few().count() + Few.COUNT
"""


def test_an_import_inside_a_function_is_followed_and_a_script_counts_by_code_with_its_classes():
    def reasons_of(*numbers):
        text, space = CLASSES.format(*numbers), {"__name__": "few", "__package__": "unknown"}
        exec(text, space)
        return Code().reasons("measure", space["measure"])

    expected = reasons_of(2, 1, "words", "comment")
    assert reasons_of(2, 1, "other words", "another comment") == expected
    assert changes(expected, reasons_of(2, 3, "words", "comment")) == ["code <string>"]
    assert reasons_of(4, 1, "words", "comment") != expected
    space = {"__name__": "symtop.measure.made", "__package__": "symtop.measure"}
    exec(
        "def measure():\n    from . import errors\n    from ..methods.runge_kutta.gauss import farthest\n"
        "    import symtop.run.guard as other\n    return errors.error_bound, other.guard\n",
        space,
    )
    labels = {part.label for part in Code().reached("measure", space["measure"])}
    for name in ("measure/errors.py:error_bound", "methods/runge_kutta/gauss.py:farthest"):
        assert f"function symtop/{name}" in labels


def kernels_of(root: Path, store: Path) -> dict[str, int]:
    """The machine code in the cache and when they were written, after one run; and what it returned."""
    code = (
        "import symtop; from symtop.run import long_run as L; "
        "w, m = symtop.scene('spheroid'), symtop.integrator('gauss-4'); "
        "print(float(symtop.simulate(w, m, step_size=0.02, guard=False)['theta'][-1]).hex(), "
        "L._identity(w, m, 0.01, 100, True))"
    )
    output = printed_by(code, cwd=root, PYTHONPATH=root, SYMTOP_CACHE=store).split()
    files = {str(path.relative_to(store)): path.stat().st_mtime_ns for path in (store / "kernels").rglob("*.code")}
    return {"output": output, "files": files}


@pytest.mark.slow
def test_an_edited_callee_makes_a_new_kernel_and_a_comment_makes_none(tmp_path):
    """In a copy of the package, each time in a new process."""
    shutil.copytree(code_hash.PACKAGE, tmp_path / "symtop", ignore=shutil.ignore_patterns("__pycache__"))
    before = kernels_of(tmp_path, tmp_path / "cache")
    assert before["files"]
    for name in ("measure/errors.py", "run/modified_energy.py", "explore/answers.py", "methods/runge_kutta/gauss.py",
                 "methods/framework/loop.py", "core/jit.py", "core/code_hash.py"):  # fmt: skip
        file = tmp_path / "symtop" / name
        text = file.read_text()
        assert "\nfrom " in text
        file.write_text(text.replace("\nfrom ", "\n# a comment\nfrom ", 1))  # every line below moves down
    assert kernels_of(tmp_path, tmp_path / "cache") == before  # nothing compiled, and the checkpoint is still valid
    callee = tmp_path / "symtop" / "methods" / "framework" / "space.py"
    text = callee.read_text()
    assert "par.mgl" in text
    callee.write_text(text.replace("par.mgl", "(1.5 * par.mgl)"))  # called from gauss.py, compiled in loop.py
    after = kernels_of(tmp_path, tmp_path / "cache")
    assert len(after["files"]) > len(before["files"])
    assert before["files"].items() <= after["files"].items()
    assert after["output"][0] != before["output"][0]
    assert after["output"][1] != before["output"][1]
    callee.write_text(text)
    assert kernels_of(tmp_path, tmp_path / "cache") == after | {"output": before["output"]}


def test_a_kernel_is_told_by_what_it_calls():
    def kernel_of(part):
        def kernel(x):
            """Words."""
            return part(x)  # more words

        return digest(by_file(jit.code_of(kernel)))

    def part_of(source):
        space = {"__name__": "part"}
        exec(source, space)
        return jit.register_jitable(space["part"])

    expected = kernel_of(part_of("def part(x):\n    return 2.0 * x\n"))
    assert kernel_of(part_of("\n\n# moved\ndef part(x):\n    # said\n    return 2.0 * x\n")) == expected
    assert kernel_of(part_of("def part(x):\n    'Documented.'\n    return 2.0 * x\n")) == expected
    assert kernel_of(part_of("def part(x):\n    return 3.0 * x\n")) != expected
    constant = "K = {}\ndef part(x):\n    return K * x\n"
    assert kernel_of(part_of(constant.format(2.0))) != kernel_of(part_of(constant.format(3.0)))
    deep = "def deep(x):\n    return {}x\ndef part(x):\n    return deep(x)\n"
    assert kernel_of(part_of(deep.format(""))) != kernel_of(part_of(deep.format("-")))


def test_what_numba_compiles_in_place_of_a_function_counts():
    assert {"fused", "_fused", "_fma"} <= {part.label.rpartition(":")[2] for part in jit.code_of(jit.fused)}
    labels = {part.label.rpartition(":")[2] for part in Code().reached("kernel", jit.fused)}
    assert labels == {"kernel", "fused"}  # the control


def test_a_kernel_is_the_same_to_a_profiler():
    def kernel_with(constant):
        def kernel(x):
            return x + constant

        return kernel

    before, watching = digest(by_file(jit.code_of(kernel_with(1.0)))), cProfile.Profile()
    watching.enable()
    try:
        numba.njit(kernel_with(2.0))(1.0)
    finally:
        watching.disable()
    cleared = not kernel_with(1.0).__code__.co_flags & inspect.CO_OPTIMIZED  # by numba, for all that share the code
    assert cleared is (sys.version_info < (3, 12))
    assert digest(by_file(jit.code_of(kernel_with(1.0)))) == before


def test_a_value_counts_where_it_stands_and_not_by_its_identity():
    """A symmetric composition names its first table again at its end."""
    key, a, b, loop = lambda *values: digest(Code().reasons("values", values)), (1.5, 0.25), np.ones(2), [1.0]
    loop.append(loop)
    assert len({key((a, b)), key((a, b, a)), key((a, b, b)), key(((1.0,), 2.0)), key(((1.0, 2.0),)), key(loop)}) == 6
    assert key((a, a), (b, b)) == key((a, (1.5, 0.25)), (b, b.copy()))


def test_no_method_hangs_on_how_many_types_numba_has_made(monkeypatch):
    class Kind(types.Type):
        """The control: numba numbers types by process, and a hash with a number makes every case stale in another."""

    noted = set[str]()
    monkeypatch.setattr(Code, "_note", lambda self, *values: (noted.update(values), self._at.values.extend(values)))
    parts = jit.code().reached("methods", symtop.integrators())
    assert any("symtop/methods/simd.py" in part.file for part in parts)
    assert "'_code'" not in noted
    jit.code().reached("kind", Kind("of a test"))
    assert "'_code'" in noted


def test_the_cache_keeps_what_was_used_last(tmp_path):
    for age, name in enumerate(("a", "b", "c", "d")):
        (folder := tmp_path / name).mkdir()
        (folder / "kernel.code").write_bytes(b"\0" * 1000)
        os.utime(folder, (time.time() - age * 2 * files.DAY,) * 2)
    os.utime(tmp_path / "a", (time.time() - (files.UNUSED_DAYS + 1) * files.DAY,) * 2)
    files.touch(tmp_path / "d")  # it was used last, now
    files.prune(tmp_path, 2500)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b", "d"]
    files.prune(tmp_path, 100)
    assert not list(tmp_path.iterdir())
    files.prune(tmp_path / "nothing", 100)


def test_changes_name_what_differs_and_versions_of_packages_are_reasons():
    before, after = {"file a": "1", "file b": "2", "scene x": "3"}, {"file a": "1", "file b": "9", "package n": "4"}
    assert changes(before, after) == ["file b", "scene x (no longer counts)", "package n (did not count before)"]
    assert changes(after, after) == []
    assert "code symtop/core/jit.py" in Code().reasons("a file by its path", code_hash.PACKAGE / "core" / "jit.py")
    assert digest(before) == digest(dict(reversed(before.items()))) != digest(after)
    assert merged([{"a": "1"}, {"a": "1", "b": "2"}]) == {"a": "1", "b": "2"}
    assert merged([{"a": "1"}, {"a": "2"}])["a"] not in ("1", "2")
    numpy = importlib.metadata.version("numpy")
    assert code_hash.packages("numpy", "no-such-one") == {"package numpy": numpy, "package no-such-one": "absent"}
    assert code_hash.packages()["package python"] == ".".join(map(str, sys.version_info[:2]))


def test_processors_of_one_name_differ_by_their_models(monkeypatch, tmp_path):
    (file := tmp_path / "cpuinfo").write_text("model name\t: A\ncpu family\t: 6\nmodel\t\t: 85\n\nmodel name\t: A\n")
    monkeypatch.setattr(code_hash, "Path", lambda _: file)
    assert code_hash.processor.__wrapped__() == "A, cpu family 6, model 85"
    file.unlink()
    assert code_hash.processor.__wrapped__()  # of a system without that file: some name
