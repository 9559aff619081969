"""Sentences and titles of the notebook study, told other numbers: each says something else."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.notebook import words as notebook_words
from symtop_studies.notebook.long_energy import better_from
from symtop_studies.notebook.tables import SOLVER, Column
from symtop_studies.notebook.words import long_table


def long_runs(level, slope):
    """A discrete method of a level energy error beside a solver whose error grows with time, to t = 1000."""
    time = np.geomspace(1.0, 1000.0, 301)
    coords = {"scene": ["spheroid"], "variant": ["midpoint[angles]", SOLVER]}
    return xr.Dataset({
        Column.LONG_TIME: (("scene", "variant", "long"), [[time, time]]),
        Column.LONG_ENERGY: (("scene", "variant", "long"), [[np.full(301, level), slope * time]]),
        "energy_largest": (("scene", "variant"), [[level, slope * 8.0]]),
        Column.SAMPLE_TIME: (("scene", "variant", "sample"), np.full((1, 2, 1), 8.0)),
    }, coords=coords)  # fmt: skip


def test_the_notebooks_question_is_answered_and_the_time_from_which_its_hope_is_true_is_measured():
    late = long_runs(3e-5, 1e-7)
    assert better_from(late, "spheroid", "midpoint[angles]") == pytest.approx(300.0, rel=0.03)
    (said,) = notebook_words.hopes(late)
    assert "t = 8, lsoda[angles] keeps the energy to 8e-07, better than midpoint[angles] (3e-05)." in said
    assert said.endswith("the other's has not changed: midpoint[angles] is better from t = 302 on.")
    table = long_table(late, ["midpoint[angles]"])
    assert list(table.rows[-1]) == ["spheroid", "midpoint[angles]", "8", "3e-05", "3e-05", "302"]
    never, always = long_runs(3e-5, 1e-9), long_runs(1e-9, 1e-7)
    assert better_from(never, "spheroid", "midpoint[angles]") == math.inf
    assert "has not changed; midpoint[angles] is never better." in notebook_words.hopes(never)[0]
    assert better_from(always, "spheroid", "midpoint[angles]") == 0.0
    assert "worse than midpoint[angles]" in notebook_words.hopes(always)[0]


def test_the_notebooks_path_is_turned_by_a_quarter_about_the_vertical():
    phi = np.linspace(0.1, 1.0, 5)
    angles = {Column.SOLVER_THETA: 0.5 + phi, Column.SOLVER_PHI: phi, Column.TRUE_THETA: 0.5 + phi,
              Column.TRUE_PHI: phi}  # fmt: skip
    data = xr.Dataset(
        {name: (("scene", "variant", "path"), values[None, None]) for name, values in angles.items()},
        coords={"scene": ["spheroid"], "variant": [SOLVER]},
    )
    assert notebook_words.turned(data, "spheroid") == pytest.approx(90.0)
