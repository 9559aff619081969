"""Sentences and titles of the notebook study, told other numbers: each says something else."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.notebook import words as notebook_words
from symtop_studies.notebook.long_energy import better_from
from symtop_studies.notebook.long_words import long_table
from symtop_studies.notebook.tables import SOLVER, Column


def test_the_notebook_study_names_discrete_methods_that_lose_their_momenta():
    sizes = np.array([[1e-15, 1e-15, 1e-6]])
    coords = {"scene": ["spheroid"], "variant": ["midpoint[angles]", "strang[axis]", SOLVER]}
    data = xr.Dataset(dict.fromkeys(notebook_words.MOMENTA, (("scene", "variant"), sizes)), coords=coords)
    assert "With all 2 discrete Lagrangians and splittings" in notebook_words.momenta(data)
    lost = data.assign({"p_phi_largest": (("scene", "variant"), [[1e-15, 1e-9, 1e-6]])})
    assert "With 1 of 2 discrete Lagrangians and splittings" in notebook_words.momenta(lost)
    assert "not with strang[axis]" in notebook_words.momenta(lost)


def test_the_notebook_study_says_how_many_discrete_methods_have_a_smaller_error_than_the_solver():
    coords = {"scene": ["spheroid"], "variant": ["midpoint[angles]", "stormer-verlet[angles]", SOLVER]}
    data = xr.Dataset(coords=coords).assign({
        "energy_largest": (("scene", "variant"), [[3e-5, 1e-9, 1e-6]]),
        Column.ENERGY_CHANGE: ("shadow_setting", [4e-4]),
        Column.MODIFIED_CHANGE: ("shadow_setting", [1e-5]),
    })  # fmt: skip
    sentence = notebook_words.energy(data)
    assert "1 of 2 have a smaller one than the solver (1e-06)" in sentence
    assert "40-fold" in sentence


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


def test_the_titles_of_the_notebook_say_where_the_discrete_method_is_the_worse_one():
    first, second = long_runs(3e-5, 1e-7), long_runs(1e-7, 1e-7).assign_coords(scene=["goldstein"])
    data = xr.concat([first, second], "scene")
    assert notebook_words.hope_message(data) == (
        "lsoda keeps the energy better than 1 of 1 methods of order two to the notebook's end on spheroid, 0 of 1 on "
        "goldstein; by 1000 s it is worse than each of them"
    )
    never = xr.concat([long_runs(3e-5, 1e-9), second], "scene")
    assert notebook_words.hope_message(never).endswith("by 1000 s it is not worse than all of them")
    momenta = xr.DataArray([[1e-15, 2e-6]] * 2, dims=("scene", "variant"))
    said = notebook_words.residuals_message(data.assign(p_phi_largest=momenta, p_psi_largest=momenta))
    assert said == (
        "Discrete methods keep both momenta to 10⁻¹⁵, lsoda to 2 × 10⁻⁶; the energy is worse than lsoda's with 1 of 1 "
        "on spheroid and 0 of 1 on goldstein"
    ).replace(" × ", "\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}")


def test_the_notebooks_path_is_turned_by_a_quarter_about_the_vertical():
    phi = np.linspace(0.1, 1.0, 5)
    angles = {Column.SOLVER_THETA: 0.5 + phi, Column.SOLVER_PHI: phi, Column.TRUE_THETA: 0.5 + phi,
              Column.TRUE_PHI: phi}  # fmt: skip
    data = xr.Dataset(
        {name: (("scene", "variant", "path"), values[None, None]) for name, values in angles.items()},
        coords={"scene": ["spheroid"], "variant": [SOLVER]},
    )
    assert notebook_words.turned(data, "spheroid") == pytest.approx(90.0)
