"""Each stratum of bodies does what its line says; the same seed is the same population, wherever it ends."""

import numpy as np
import pytest

import symtop
from symtop.core.netcdf import content_hash
from symtop.run.ensemble.bodies import CHAOS, FREE, STRATA, body_population, growth, scenes_of

HASH = "db868dbc6447cfc999cf348d04fb7e241827773bc77f595a9064c2a658f8b795"  # of 64 members of seed 1


class Bodies:
    """Members of one kind with their moments in order, momenta along those axes, and 2 E I2/L^2 without weight."""

    def __init__(self, kind, count=400):
        self.data = body_population(count, seed=3, kind=kind)
        moments = np.stack([self.data[name].values for name in ("I1", "I2", "I3")], axis=1)
        order = np.argsort(moments, axis=1)
        rates = np.take_along_axis(self.data.omega_body.values, order, axis=1)
        self.low, self.middle, self.high = np.sort(moments, axis=1).T
        self.momentum = np.sort(moments, axis=1) * rates
        self.size = np.linalg.norm(self.momentum, axis=1)
        self.share = (self.momentum * rates).sum(axis=1) * self.middle / self.size**2


@pytest.mark.parametrize("kind", STRATA)
def test_members_are_bodies_with_directions_of_length_one(kind):
    drawn = Bodies(kind, 16)
    assert (drawn.high <= drawn.low + drawn.middle).all()
    for name in ("centre", "quaternion"):
        assert np.abs(np.linalg.norm(drawn.data[name].values, axis=1) - 1.0).max() < 1e-15
    assert (drawn.data.mgl == (0.0 if kind in FREE else 1.0)).all()
    for row, scene in enumerate(scenes_of(drawn.data)):  # the way back
        assert scene.top.moments == tuple(float(drawn.data[name][row]) for name in ("I1", "I2", "I3"))
        np.testing.assert_allclose(scene.start.quaternion, drawn.data.quaternion[row], atol=2e-16)
        assert scene.start.omega_body == tuple(drawn.data.omega_body[row].values.tolist())


def test_free_bodies_rotate_as_their_strata_say():
    short, long, near = Bodies("short-axis"), Bodies("long-axis"), Bodies("near-separatrix")
    assert np.abs(short.momentum[:, 2] / short.size).min() > np.cos(0.501)
    assert np.abs(long.momentum[:, 0] / long.size).min() > np.cos(0.501)
    assert np.abs(near.share - 1.0).max() < 0.1
    assert (np.abs(near.share - 1.0) < 1e-3).mean() > 0.3
    assert max((np.abs(drawn.share - 1.0) < 1e-3).mean() for drawn in (short, long)) < 0.01  # the negative control
    symmetric, needle = Bodies("near-symmetric"), Bodies("needle")
    apart = np.minimum(symmetric.middle / symmetric.low, symmetric.high / symmetric.middle) - 1.0
    assert apart.max() < 2.0**-5.9
    assert (apart < 1e-4).mean() > 0.3
    assert (needle.low / needle.middle).max() < 2.0**-4.9
    assert (short.low / short.middle).min() > 0.29
    for drawn in (short, long, near, symmetric, needle):
        assert np.abs(drawn.size - 1.0).max() < 1e-8
        firsts = [float((drawn.data[name].values == drawn.low).mean()) for name in ("I1", "I2", "I3")]
        assert min(firsts) > 0.2  # axes in any order


def test_heavy_bodies_lie_at_their_distance_from_a_lagrange_top():
    for epsilon in (0.0, 0.01, 0.3):
        drawn = body_population(400, seed=3, kind="heavy", epsilon=epsilon)
        assert (drawn.I1 == 1.0).all()
        assert float(drawn.I2.max()) <= 1.0 + epsilon
        assert float(drawn.I2.median()) > 1.0 + 0.6 * epsilon - 1e-9
        tilt = np.arctan(np.hypot(*drawn.centre.values[:, :2].T) / drawn.centre.values[:, 2])
        assert tilt.max() <= epsilon + 1e-9
        assert tilt.max() >= 0.9 * np.arctan(epsilon)
    free_distance = body_population(400, seed=3, kind="heavy")
    assert float(free_distance.I2.min()) - 1.0 > 2.0**-8.01
    assert float(free_distance.I2.max()) > 1.2
    same = [body_population(9, seed=3, kind="heavy", epsilon=epsilon) for epsilon in (0.0, 0.1)]
    for name in ("I3", "quaternion", "omega_body"):
        np.testing.assert_array_equal(same[0][name], same[1][name])
    lagrange = body_population(9, seed=3, kind="lagrange")
    assert (lagrange.I1 == lagrange.I2).all()
    assert (lagrange.centre.values == [0.0, 0.0, 1.0]).all()


def test_regular_and_chaotic_bodies_are_told_apart_by_the_growth_of_a_disturbance():
    regular, chaotic = (
        [growth(scene) for scene in scenes_of(body_population(6, seed=3, kind=kind, epsilon=0.3))]
        for kind in ("regular", "chaotic")
    )
    assert max(regular) < CHAOS < min(chaotic)
    tops = [growth(scene) for scene in scenes_of(body_population(60, seed=3, kind="lagrange"))]
    assert max(tops) < CHAOS  # an integrable motion shears
    assert np.median(tops) > 2.0


def test_a_population_is_the_beginning_of_a_larger_one_and_the_same_everywhere():
    large = body_population(64, seed=1)
    assert large.stratum[:8].values.tolist() == [*STRATA]
    assert body_population(21, seed=1).drop_attrs().identical(large.isel(member=slice(0, 21)).drop_attrs())
    assert not np.array_equal(body_population(9, seed=2).omega_body, large.omega_body[:9])
    assert content_hash(large) == HASH


def test_members_that_make_no_sense_are_refused_in_a_sentence():
    for words, sentence in (
        ({"kind": "odd"}, "kind 'odd' is unknown"),
        ({"seed": -1}, "seed"),
        ({"n": 0}, "n must be"),
        ({"epsilon": 0.6}, r"epsilon must be from 0.02 to 0.5, not 0.6"),
        ({"epsilon": 0.001, "kind": "chaotic"}, r"epsilon must be from 0.02 to 0.5, not 0.001"),
        ({"epsilon": float("nan"), "kind": "heavy"}, "epsilon must be"),
        ({"epsilon": 0.1, "kind": "needle"}, "epsilon is of heavy bodies, and not of the kind 'needle'"),
    ):
        with pytest.raises(symtop.SymtopError, match=sentence):
            symtop.body_population(**{"n": 1} | words)
