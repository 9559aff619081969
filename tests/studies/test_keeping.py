"""What it costs to keep the phase: the law of a variant goes through its measurement and foretells another one."""

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import figures
from symtop_studies.drift.phase_loss import phase_loss

import symtop
from symtop.methods.framework.registry import integrator


def loss(length=2500.0, paid=100.0, exponent=1.0):
    return xr.Dataset({"measured": length, "evaluations": paid, "exponent": exponent, "predicted": length})


def test_the_law_of_a_method_of_order_two_needs_the_square_root_of_the_length():
    law = figures.keeping("stormer-verlet[angles]", loss())
    assert law.work(2500.0) == pytest.approx(100.0)
    assert law.work(10_000.0) == pytest.approx(200.0)
    steeper = figures.keeping("stormer-verlet[angles]", loss(exponent=2.0))  # a drifting energy
    assert steeper.work(10_000.0) == pytest.approx(400.0)


def test_a_row_without_an_order_or_a_loss_has_no_law():
    assert figures.keeping("exact-discrete[axis]", loss()) is None
    assert figures.keeping("nobodys-method[axis]", loss()) is None
    assert figures.keeping("rk4[axis]", loss(length=np.nan)) is None
    assert figures.keeping("rk4[axis]", loss().drop_vars("evaluations")) is None


def test_the_named_rows_are_the_familiar_ones_and_the_cheapest_of_each_order():
    laws = {name: figures.keeping(name, loss(paid=paid)) for name, paid in (
        ("midpoint[angles]", 300.0), ("strang[axis]", 100.0), ("cayley[axis]", 200.0), ("rk4[axis]", 90.0),
        ("takahashi-imada[axis]", 10.0), ("kahan-li-8[axis]", 40.0),
    )}  # fmt: skip
    named = figures.chosen(laws)
    assert named == ["midpoint[angles]", "rk4[axis]", "strang[axis]", "takahashi-imada[axis]", "kahan-li-8[axis]"]


def test_the_law_foretells_the_work_of_a_run_that_lasts_four_times_as_long():
    scene, verlet = symtop.scene("spheroid"), integrator("stormer-verlet[angles]")
    short, long = (phase_loss(scene, verlet, 100.0, target) for target in (300.0, 1200.0))
    law = figures.keeping(verlet.name, short)
    assert law.power == pytest.approx(0.5, abs=0.05)
    assert float(long["measured"]) > 3.0 * float(short["measured"])
    assert law.work(float(long["measured"])) == pytest.approx(float(long["evaluations"]), rel=0.05)
    rule = float(short["evaluations"]) / float(short["steps"])
    assert rule == pytest.approx(1.0, abs=0.01)  # one force evaluation a step
