"""The nearest tops of a stored study of cost: distances without units, and counts of a table with known answers."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.cost.tops import tops_of

import symtop
from symtop.measure import ranking as module
from symtop.measure.ranking import distances, nearest, regime

INF, NAN = math.inf, math.nan


def test_a_regime_is_that_of_the_mirror_image_and_of_the_axis_named_the_other_way_round():
    scene = symtop.scene("goldstein")
    top, start = scene.top, scene.start
    rates = start.theta_dot, start.phi_dot, start.psi_dot
    mirrored = symtop.Scene("m", top, symtop.Angles(start.theta, 0.0, 0.0, rates[0], -rates[1], -rates[2]), 1.0)
    upside_down = symtop.SymmetricTop(top.I1, top.I3, -top.mgl)
    turned = symtop.Scene(
        "t", upside_down, symtop.Angles(math.pi - start.theta, 0.0, 0.0, -rates[0], rates[1], -rates[2]), 1.0
    )
    heavier = symtop.Scene("h", symtop.SymmetricTop(top.I1, top.I3, 2.0 * top.mgl), start, 1.0)
    far = distances(np.stack([regime(one) for one in (mirrored, turned, heavier)]), regime(scene))
    assert far[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert far[2] > 0.1


def store(folder, costs, regimes, prices=None):
    """A study of one horizon, 10 nutations, with costs (tops,) of the axis at 1e-6 by variant."""
    names, table = list(costs), np.array(list(costs.values()))
    dims = "scene", "variant", "quantity", "target", "member"
    short = xr.Dataset(
        {"cost": (dims, table[np.newaxis, :, None, None]), "met_at": (dims, 10.0 * table[np.newaxis, :, None, None]),
         "nutations": (("scene", "variant"), np.full((1, len(names)), 10.0))},
        coords={"scene": ["tops"], "variant": names, "quantity": ["axis"], "target": [1e-6]},
    )  # fmt: skip
    tops = xr.Dataset({"regime": (("scene", "variant", "member", "number"), np.array(regimes)[None, None])},
                      {"scene": ["short"]})  # fmt: skip
    price = np.array(prices or [1.0] * len(names))[np.newaxis, :, np.newaxis]
    priced = xr.Dataset(
        {"price": (("scene", "variant", "priced_at"), price), "call": (("scene", "variant", "priced_at"), 0.0 * price)},
        coords={"scene": ["first-0"], "variant": names, "priced_at": [1e-8]},
    )
    tree = xr.DataTree.from_dict({"short": short, "tops": tops, "prices": priced})
    tree.to_netcdf(folder / module.STORED, engine="netcdf4")
    return folder / module.STORED


def test_counts_of_known_costs(tmp_path, monkeypatch):
    scene = symtop.scene("goldstein")
    monkeypatch.setattr(module, "NEAREST", 4)
    here = regime(scene)
    regimes = [here + 9.0, here, here, here, here, here, np.full(4, NAN)]  # far, near, not asked, no closed form
    costs = {
        "a[axis]": [1.0, 4.0, 2.0, 9.0, INF, NAN, 1.0],
        "b[axis]": [9.0, 1.0, 1.0, 5.0, INF, NAN, 1.0],
        "none[axis]": [NAN] * 7,  # does not show the axis
    }
    answer = nearest(store(tmp_path, costs, regimes), scene, "axis", 3e-6, 12.0)
    assert answer.tops == 4
    assert answer.served == {"b[axis]": 3, "a[axis]": 2}
    assert answer.settings == {"b[axis]": 10.0, "a[axis]": 40.0}  # the medians of what meets it
    assert "on 3 of the 4 nearest random tops (axis 1e-06 over 10 nutations)" in answer.words("b[axis]")
    dear = nearest(store(tmp_path, costs, regimes, [1.0, 9.0, 1.0]), scene, "theta", 1e-6, 12.0)
    assert dear.served == {"a[axis]": 3, "b[axis]": 0}  # a row made worse by hand serves nobody
    assert nearest(tmp_path / module.STORED, scene, "precession_rate", 1e-6, 12.0) is None


def test_nothing_is_said_without_a_study_and_a_bad_one_is_refused(tmp_path):
    scene = symtop.scene("goldstein")
    file = tmp_path / module.STORED
    with pytest.raises(symtop.SymtopError, match=r"holds no cost.nc.*symtop study cost first"):
        nearest(file, scene, "axis", 1e-6, 10.0)
    file.write_text("no dataset")
    with pytest.raises(symtop.SymtopError, match=r"cost.nc cannot be read.*--fresh"):
        nearest(file, scene, "axis", 1e-6, 10.0)
    file.unlink()
    xr.DataTree.from_dict({"short": xr.Dataset({"cost": ("x", [1.0])})}).to_netcdf(file, engine="netcdf4")
    with pytest.raises(symtop.SymtopError, match=r"older version.*nutations.*--fresh"):
        nearest(file, scene, "axis", 1e-6, 10.0)


def test_random_tops_are_nearest_to_themselves():
    tops = tops_of(40, 0, 5, 10.0)
    for member in np.flatnonzero(tops.known):
        numbers = tops.numbers[member].tolist()
        scene = symtop.Scene("m", symtop.SymmetricTop(*numbers[:3]), symtop.Angles(*numbers[3:]), 1.0)
        assert np.nanargmin(distances(tops.regime, regime(scene))) == member
