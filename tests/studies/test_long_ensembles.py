"""The ensemble of the drift study: windows of many long runs at once, with the bits of one long run each."""

from itertools import pairwise

import numpy as np
import pytest
from symtop_studies.drift import study
from symtop_studies.drift.runs import gauges_of, members, side_by_side
from symtop_studies.drift.tables import ROUNDINGS

from symtop.methods.framework.many import LEAST
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import scene
from symtop.run.long_run import QUANTITIES, long_run

PER_NUTATION = 1000.37
PARTS = ("least", "largest", "mean")


@pytest.mark.parametrize("compensated", [True, False])
@pytest.mark.parametrize("name", ["midpoint[angles]", "cayley[axis]"])
def test_each_has_the_bits_of_a_long_run(name, compensated):
    method, scenes = integrator(name), members(scene("spheroid"), 6)  # enough for lanes
    gauges = gauges_of(scenes, method, PER_NUTATION)
    ends, seen = side_by_side(scenes, gauges, method, 20_000, PER_NUTATION, compensated=compensated)
    for i, one in ((0, scenes[0]), (5, scenes[5])):
        h = one.nutation_period / PER_NUTATION
        alone = long_run(one, method, steps=20_000, step_size=h, compensated=compensated, quiet=True)
        np.testing.assert_array_equal(ends, alone["steps"])
        for quantity in QUANTITIES:
            for k, part in enumerate(PARTS):
                np.testing.assert_array_equal(seen[quantity][i, :, k], alone[f"{quantity}_{part}"])
    others = [seen["modified_energy"][i] for i in range(6)]
    assert not any(np.array_equal(one, other) for one, other in pairwise(others))  # each is a run of its own


def test_the_ordinary_ensemble_goes_in_lanes():
    """Fewer members, or another sum, would run one after another, 8 times slower."""
    ensembles = [case for case in study.cases(False) if case.group == ROUNDINGS]
    assert len(ensembles) == 4
    for case in ensembles:
        row = integrator(case.integrator)
        assert case.settings["count"] >= LEAST
        assert row.solvers[row.charts()[0]].in_lanes
