"""The figures of dots of the drift study: what their titles count is drawn, once each."""

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import dot_figures, messages

from symtop.measure.conservation import CONSTANTS

NAMES = ["strang[axis]", "gauss-4[axis]", "rk4[axis]", "rk4[angles]", "radau[angles]"]
SIZES = {"energy": [1e-4, 1e-15, 1e-3, 1e-2, 1e-6], "p_phi": [0.0, 0.0, 0.0, 1e-5, 1e-6], "p_psi": [0.0] * 5}
SLOPES = {"energy": [0.0, 0.5, 1.0, 1.0, 0.0], "p_phi": [0.0, 0.0, 0.0, 1.0, 1.0], "p_psi": [0.0] * 5}
PHASE = [[1.0, 1.04], [0.4, 1.5], [2.0, 1.9], [2.0, 2.2], [1.0, 2.0]]  # by variant and scene


@pytest.fixture
def histories():
    """Five variants on two scenes: two hold everything, one loses the energy, one that and p_phi, one p_phi."""
    both = {
        f"{one}_{part}": np.repeat(np.array(values, float)[:, None], 2, axis=1)
        for one in CONSTANTS
        for part, values in (("largest", SIZES[one]), ("exponent", SLOPES[one]), ("exponent_interval", [0.01] * 5))
    }
    both |= {"phase_exponent": np.array(PHASE), "phase_exponent_interval": np.full((5, 2), 0.01)}
    both |= {"nutations": np.full((5, 2), 100.0), "steps_a_nutation": np.full((5, 2), 118.0)}
    both |= {"tolerance": np.full((5, 2), np.nan), "own_tolerance": np.zeros((5, 2))}
    data = xr.Dataset(
        {key: (("variant", "scene"), values) for key, values in both.items()},
        coords={"variant": NAMES, "scene": ["spheroid", "goldstein"]},
    )
    times = np.broadcast_to(np.linspace(0.0, 1.0, 3), (5, 2, 3))
    return data.assign(
        outcome=(("variant", "scene"), np.full((5, 2), "ok")), sample_time=(("variant", "scene", "sample"), times)
    )


def drawn(figure, color=None):
    """Coordinates of the dots of each panel, of one colour or of all."""
    dots = [
        [one for one in axis.get_lines() if one.get_marker() == "o" and color in (None, one.get_color())]
        for axis in figure.axes
    ]
    return [np.concatenate([np.empty((0, 2)), *(one.get_xydata() for one in panel)]) for panel in dots]


def test_rows_are_grouped_by_the_constants_that_they_lose(histories):
    groups = messages.lost(histories)
    assert groups == {
        (): ["gauss-4[axis]", "strang[axis]"],
        ("energy", "p_phi"): ["rk4[angles]"],
        ("energy",): ["rk4[axis]"],
        ("p_phi",): ["radau[angles]"],
    }
    assert messages.sizes(histories) == (
        "2 of 5 methods hold the energy and both momenta, at rounding or with a bounded error; 3 lose at least one"
    )
    assert messages.sizes(histories.sel(variant=NAMES[:2])).endswith("with a bounded error")
    ended = histories.assign(outcome=histories["outcome"].where(histories["variant"] != "strang[axis]", "left_chart"))
    assert messages.lost(ended)[CONSTANTS] == ["strang[axis]"]


def test_the_figure_of_sizes_has_a_dot_a_row_and_lost_ones_stand_out(histories):
    figure = dot_figures.sizes(histories).figure
    assert [len(dots) for dots in drawn(figure)] == [len(NAMES)] * len(CONSTANTS)
    assert [len(dots) for dots in drawn(figure, dot_figures.LOST)] == [2, 2, 0]
    assert [axis.get_title().partition(": ")[2] for axis in figure.axes] == [
        "3 hold it, 2 do not", "3 hold it, 2 do not", "5 hold it, 0 do not"
    ]  # fmt: skip
    bold = [text.get_text() for text in figure.axes[0].get_yticklabels() if text.get_weight() == "bold"]
    assert bold[0] == "2 hold all three"
    assert [text[:7] for text in bold[1:]] == ["1 loses"] * 3


def test_the_title_on_the_phase_counts_the_dots_that_stand_out(histories):
    assert messages.exponents(histories) == (
        "The phase error grows as t with a bounded energy error (3 of 4 runs) and faster with an energy that drifts "
        "or grows (4 of 4 runs)"
    )
    figure = dot_figures.exponents(histories).figure
    assert [len(dots) for dots in drawn(figure)] == [4, 4, 2]
    assert [len(dots) for dots in drawn(figure, "black")] == [3, 0, 0]
    assert [len(dots) for dots in drawn(figure, dot_figures.LOST)] == [0, 4, 0]


def test_what_grows_as_time_is_one_column_of_dots():
    slopes = np.array([0.91, 1.0, 1.09, 0.88, 1.12, 2.0])
    columns = dot_figures._columns(slopes)
    assert columns[1.0] == sorted(slopes[messages.as_time(slopes)])
    assert sum(map(len, columns.values())) == slopes.size
    assert not np.any(messages.as_time(slopes) & messages.faster(slopes))


def test_no_dot_of_the_phase_covers_another(histories):
    many = xr.concat([histories.sel(variant="strang[axis]")] * 40, "variant")
    many = many.assign_coords(variant=[f"m{k}[axis]" for k in range(40)])
    figure = dot_figures.exponents(many).figure
    (dots,) = drawn(figure)
    figure.draw_without_rendering()
    places = figure.axes[0].transData.transform(dots) * 72.0 / figure.dpi
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)[~np.eye(len(dots), dtype=bool)]
    assert apart.min() >= 4.2  # points, the size of a dot


@pytest.fixture
def ensembles():
    """One method whose plain sums grow as n^0.4 and lose 50 times as much in the last decade."""
    sums = {
        "exponent": 0.49,
        "plain_exponent": 0.40,
        "late": 2e-15,
        "plain_late": 1e-13,
        "gain": 50.0,
        "exponent_interval": 0.06,
    }
    return {"midpoint[angles]": xr.Dataset(sums)}


def test_the_exponents_of_rounding_are_told_apart(ensembles):
    (cell,) = ensembles.values()
    assert messages.walk(cell) == "plain: power 0.40\ncompensated: power 0.49"
    said = messages.rounding(ensembles)
    assert said.startswith(
        "Compensated sums lower the drift by rounding 50 to 50 times; it grows as n to the power 0.49"
    )
    assert "0.40" not in said
    assert said.endswith("as a random walk does (0.5)")
    assert messages.rounding({"midpoint[angles]": cell.assign(exponent=0.4)}).endswith("to 0.40 then")
