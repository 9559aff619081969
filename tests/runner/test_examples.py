"""A user's file outside the package: tables and a kernel of its own become methods that do what they claim."""

import importlib
import importlib.metadata
import math
import shutil
from pathlib import Path

import pytest

import symtop
from symtop.measure.accuracy import error_table
from symtop.measure.order import order
from symtop.run import plugins

registry = importlib.import_module("symtop.methods.framework.registry")
EXAMPLE = Path(__file__).resolve().parents[2] / "studies" / "examples" / "my_methods.py"


@pytest.fixture
def example(tmp_path, clean_registry):
    shutil.copy(EXAMPLE, tmp_path / "my_own_methods.py")
    plugins.load(tmp_path / "my_own_methods.py")


CLAIMS = {"two-point": 2, "mclachlan-2": 2, "ralston-3": 3, "symplectic-euler": 1}


def test_its_methods_have_the_orders_they_claim(example):
    scene = symtop.scene("goldstein")
    for name, claim in CLAIMS.items():
        method = symtop.integrator(name)
        assert method.order == claim
        steps = [scene.nutation_period / (80.37 * 1.7**k) * (0.05 if claim == 1 else 1.0) for k in range(9)]
        table = error_table(scene, method, steps, 8.0, observe="axis")
        fit = order(table["step_size"], table["axis"], table["axis_bound"], 2 * math.pi / scene.nutation_period)
        assert fit.slope == pytest.approx(claim, abs=0.05), name


def test_its_kernel_keeps_the_momenta_it_recomputes(example):
    run = symtop.simulate("spheroid", "symplectic-euler", step_size=1e-3)
    for name in ("p_phi", "p_psi"):
        assert float(abs(run[name] / run[name][0] - 1.0).max()) < 1e-13


class Point:
    """What an installed package's entry point looks like."""

    value = "stranger:methods"

    def __init__(self, announced):
        self.announced = announced

    def load(self):
        return self.announced


def test_an_installed_package_announces_its_methods(clean_registry, monkeypatch):
    method = symtop.discrete_lagrangian("announced", (0.5,), (1.0,))
    monkeypatch.setattr(registry, "_announced", [])
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [Point(lambda: [method])])
    assert symtop.integrator("announced") is method


def test_a_package_that_fails_is_named_and_the_registry_stands(clean_registry, monkeypatch):
    monkeypatch.setattr(registry, "_announced", [])
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [Point(lambda: 1 / 0)])
    with pytest.warns(symtop.SymtopWarning, match="integrators of stranger:methods are left out: ZeroDivisionError"):
        assert "midpoint" in symtop.integrators()
