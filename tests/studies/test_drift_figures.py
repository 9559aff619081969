"""The figures of dots of the drift study: what their titles count is drawn, once each."""

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import messages

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


def test_growth_as_time_is_told_from_faster_growth():
    slopes = np.array([0.91, 1.0, 1.09, 0.88, 1.12, 2.0])
    assert messages.as_time(slopes).tolist() == [True, True, True, False, False, False]
    assert messages.faster(slopes).tolist() == [False, False, False, False, True, True]


def test_phases_are_grouped_by_what_the_energy_does(histories):
    groups = messages.by_energy(histories)
    assert sorted(groups["bounded"]) == [1.0, 1.0, 1.04, 2.0]
    assert sorted(groups["lost"]) == [1.9, 2.0, 2.0, 2.2]
