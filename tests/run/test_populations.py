"""Each stratum of tops and bodies does what its line says; the same seed is the same population, wherever it ends."""

import numpy as np
import pytest

import symtop
from symtop.core.netcdf import content_hash
from symtop.model.exact.closed_form import NUMBERS, ClosedForms
from symtop.run.ensemble import population as populations
from symtop.run.ensemble.bodies import CHAOTIC_GROWTH, FREE, STRATA as BODY_STRATA, body_population, growth, scenes_of
from symtop.run.ensemble.population import STRATA, population

HASH = "8afda6e1ae62a77eabc29ef01ffbbb0c0777d931e63e1ed78ae8aed761d678b2"  # of 1000 members of seed 1
BODY_HASH = "db868dbc6447cfc999cf348d04fb7e241827773bc77f595a9064c2a658f8b795"  # of 64 members of seed 1


class Motion:
    """What the closed forms say of one stratum, without units."""

    def __init__(self, kind, seed=1):
        self.data = population(3000, seed=seed, kind=kind)
        numbers = np.stack([self.data[name].values for name in NUMBERS], axis=1)
        forms = ClosedForms(numbers)
        I1, I3, mgl, self.theta, _, _, theta_dot, phi_dot, psi_dot = numbers.T
        unit = np.sqrt(I1 / np.abs(mgl))
        self.a = I3 * (psi_dot + phi_dot * np.cos(self.theta)) * unit / I1
        self.sigma = np.abs(self.a) / 2.0
        self.kinetic = 0.5 * unit**2 * (theta_dot**2 + (phi_dot * np.sin(self.theta)) ** 2)
        self.period = forms.nutation_period / unit
        self.low, self.high = forms.theta_range.T
        self.gap = np.minimum(self.low, np.pi - self.high)


def test_grazing_tops_pass_a_pole_as_near_as_they_say_and_those_near_the_separatrix_hover_at_one():
    grazing = Motion("grazing")
    assert 2.0**-15 < grazing.gap.min() < grazing.gap.max() < 2.0**-4
    assert (grazing.gap < 2.0**-11).mean() > 0.2
    assert 0.45 < (grazing.low < grazing.gap * 1.0001).mean() < 0.55
    assert grazing.period.max() < 8.0
    assert (Motion("slow").gap > 2.0**-4).mean() > 0.7  # the negative control
    # Its period grows as the logarithm of the gap: 2 ln(1/gap)/r and some, r the rate at which it leaves the pole.
    motion = Motion("near-separatrix")
    assert 2.0**-17 < motion.low.min() < motion.low.max() < 2.0**-5.9
    assert motion.sigma.max() < 0.9
    assert (motion.period * np.sqrt(1.0 - motion.sigma**2) > 2.0 * np.log(1.0 / motion.low)).all()
    assert motion.period.min() > 1.5 * Motion("grazing").period.max()


def test_slow_fast_hanging_and_sleeping_tops_are_what_they_are_called():
    slow = Motion("slow")
    assert slow.sigma.max() < 1.0
    assert (slow.sigma < 0.05).mean() > 0.2
    assert slow.kinetic.max() < 8.001
    assert (slow.kinetic < 0.1).mean() > 0.05
    assert (slow.kinetic > 4.0).mean() > 0.2
    fast = Motion("fast")
    assert fast.sigma.min() >= 1.99
    assert ((fast.high - fast.low) * fast.a**2).max() < 10.0
    assert np.abs(2.0 * np.pi / (fast.period * np.abs(fast.a)) - 1.0).max() < 0.2
    assert (2.0 * np.pi / Motion("slow").period > 1.5 * np.abs(Motion("slow").a)).mean() > 0.5  # the negative control
    hanging = Motion("hanging")
    assert (hanging.data.mgl < 0.0).all()
    assert hanging.high.max() < np.pi / 2.0
    assert (hanging.high > 1.3).mean() > 0.01
    assert all((population(200, kind=kind).mgl > 0.0).all() for kind in STRATA if kind != "hanging")
    sleeping = Motion("sleeping")
    assert sleeping.sigma.min() >= 1.0 + 2.0**-5 - 1e-12
    assert sleeping.theta.max() < 2.0**-4 + 1e-12
    assert (sleeping.high / sleeping.theta).max() < np.sqrt(3.0) * 1.01
    assert (Motion("near-separatrix").high / 0.1 > 3.0).all()  # the negative control: too slow, and it falls


def test_the_mixture_has_its_shares_and_spreads_over_units_and_bodies():
    data = population(20_000, seed=2)
    for name, (share, _) in STRATA.items():
        assert float((data.stratum == name).mean()) == pytest.approx(share, abs=0.012)
    ratio = data.I3 / data.I1
    assert 0.02 < ratio.min() < 0.03
    assert 1.97 < ratio.max() < 1.98
    assert data.I1.min() < 2e-3
    assert data.I1.max() > 5e2
    assert abs(float((data.theta_dot > 0.0).mean()) - 0.5) < 0.1
    assert abs(float((data.psi_dot > 0.0).mean()) - 0.5) < 0.05


@pytest.mark.parametrize("draw", [population, body_population])
def test_a_seed_has_all_its_digits_however_large_it_is(draw, tmp_path):
    """A double holds none of these; the control: seeds that are the same number draw the same."""
    for seed in (2**53 + 1, 2**127 + 1):
        data = draw(3, seed=seed)
        assert int(data.attrs["seed"]) == seed
        assert not data.equals(draw(3, seed=seed - 1))
        assert data.equals(draw(3, seed=np.int64(seed) if seed < 2**63 else seed))
        data.to_netcdf(tmp_path / "drawn.nc")
    assert draw(3, seed=4.0).attrs["seed"] == 4


class Bodies:
    """Members of one kind with their moments in order, momenta along those axes, and 2 E I2/L^2 without weight."""

    def __init__(self, kind, count=400):
        self.data = body_population(count, seed=3, kind=kind)
        moments = np.stack([self.data[name].values for name in ("I1", "I2", "I3")], axis=1)
        rates = np.take_along_axis(self.data.omega_body.values, np.argsort(moments, axis=1), axis=1)
        self.low, self.middle, self.high = np.sort(moments, axis=1).T
        self.momentum = np.sort(moments, axis=1) * rates
        self.size = np.linalg.norm(self.momentum, axis=1)
        self.share = (self.momentum * rates).sum(axis=1) * self.middle / self.size**2


@pytest.mark.parametrize("kind", BODY_STRATA)
def test_members_are_bodies_with_directions_of_length_one(kind):
    bodies = Bodies(kind, 16)
    assert (bodies.high <= bodies.low + bodies.middle).all()
    for name in ("centre", "quaternion"):
        assert np.abs(np.linalg.norm(bodies.data[name].values, axis=1) - 1.0).max() < 1e-15
    assert (bodies.data.mgl == (0.0 if kind in FREE else 1.0)).all()
    for row, scene in enumerate(scenes_of(bodies.data)):  # the way back
        assert scene.top.moments == tuple(float(bodies.data[name][row]) for name in ("I1", "I2", "I3"))
        np.testing.assert_allclose(scene.start.quaternion, bodies.data.quaternion[row], atol=2e-16)
        assert scene.start.omega_body == tuple(bodies.data.omega_body[row].values.tolist())


def test_free_bodies_rotate_as_their_strata_say():
    short, long, near = Bodies("short-axis"), Bodies("long-axis"), Bodies("near-separatrix")
    assert np.abs(short.momentum[:, 2] / short.size).min() > np.cos(0.501)
    assert np.abs(long.momentum[:, 0] / long.size).min() > np.cos(0.501)
    assert np.abs(near.share - 1.0).max() < 0.1
    assert (np.abs(near.share - 1.0) < 1e-3).mean() > 0.3
    assert max((np.abs(bodies.share - 1.0) < 1e-3).mean() for bodies in (short, long)) < 0.01  # the negative control
    symmetric, needle = Bodies("near-symmetric"), Bodies("needle")
    gap = np.minimum(symmetric.middle / symmetric.low, symmetric.high / symmetric.middle) - 1.0
    assert gap.max() < 2.0**-5.9
    assert (gap < 1e-4).mean() > 0.3
    assert (needle.low / needle.middle).max() < 2.0**-4.9
    assert (short.low / short.middle).min() > 0.29
    for bodies in (short, long, near, symmetric, needle):
        assert np.abs(bodies.size - 1.0).max() < 1e-8
        firsts = [float((bodies.data[name].values == bodies.low).mean()) for name in ("I1", "I2", "I3")]
        assert min(firsts) > 0.2  # axes in any order


def test_heavy_bodies_lie_at_their_distance_from_a_lagrange_top():
    for epsilon in (0.0, 0.01, 0.3):
        bodies = body_population(400, seed=3, kind="heavy", epsilon=epsilon)
        assert (bodies.I1 == 1.0).all()
        assert float(bodies.I2.max()) <= 1.0 + epsilon
        assert float(bodies.I2.median()) > 1.0 + 0.6 * epsilon - 1e-9
        tilt = np.arctan(np.hypot(*bodies.centre.values[:, :2].T) / bodies.centre.values[:, 2])
        assert 0.9 * np.arctan(epsilon) <= tilt.max() <= epsilon + 1e-9
    free_distance = body_population(400, seed=3, kind="heavy")
    assert float(free_distance.I2.min()) - 1.0 > 2.0**-8.01
    assert float(free_distance.I2.max()) > 1.2
    pair = [body_population(9, seed=3, kind="heavy", epsilon=epsilon) for epsilon in (0.0, 0.1)]
    for name in ("I3", "quaternion", "omega_body"):
        np.testing.assert_array_equal(pair[0][name], pair[1][name])
    lagrange = body_population(9, seed=3, kind="lagrange")
    assert (lagrange.I1 == lagrange.I2).all()
    assert (lagrange.centre.values == [0.0, 0.0, 1.0]).all()


def test_regular_and_chaotic_bodies_are_told_apart_by_the_growth_of_a_disturbance():
    rows = lambda bodies: np.array([scene.top.flat(scene.start) for scene in scenes_of(bodies)])
    growths = lambda count, **options: growth(rows(body_population(count, seed=3, **options)))
    regular, chaotic = (growths(6, kind=kind, epsilon=0.3) for kind in ("regular", "chaotic"))
    assert max(regular) < CHAOTIC_GROWTH < min(chaotic)
    assert max(tops := growths(60, kind="lagrange")) < CHAOTIC_GROWTH  # an integrable motion shears
    assert np.median(tops) > 2.0


def test_a_population_is_the_beginning_of_a_larger_one_and_the_same_everywhere(monkeypatch):
    tops, bodies = population(3000, seed=1), body_population(64, seed=1)
    for draw, count, large, name in ((population, 1000, tops, "theta"), (body_population, 21, bodies, "omega_body")):
        assert draw(count, seed=1).drop_attrs().identical(large.isel(member=slice(count)).drop_attrs())
        assert not np.array_equal(draw(count, seed=2)[name], large[name][:count])
    assert bodies.stratum[:8].values.tolist() == [*BODY_STRATA]
    # Hashes that were written down: nothing hangs on the machine's sine, its vectors or NumPy's distributions.
    assert (content_hash(population(1000, seed=1)), content_hash(bodies)) == (HASH, BODY_HASH)
    monkeypatch.setattr(populations, "BLOCK_MEMBERS", 128)
    assert population(3000, seed=1).identical(tops)


def test_members_that_make_no_sense_are_refused_in_a_sentence():
    for words, sentence in (
        ({"kind": "odd"}, "kind 'odd' is unknown"), ({"seed": -1}, "seed"), ({"n": 0}, "n must be"),
        ({"epsilon": 0.6}, r"epsilon must be from 0.02 to 0.5, not 0.6"),
        ({"epsilon": 0.001, "kind": "chaotic"}, r"epsilon must be from 0.02 to 0.5, not 0.001"),
        ({"epsilon": float("nan"), "kind": "heavy"}, "epsilon must be"),
        ({"epsilon": 0.1, "kind": "needle"}, "epsilon is of heavy bodies, and not of the kind 'needle'"),
    ):  # fmt: skip
        with pytest.raises(symtop.SymtopError, match=sentence):
            symtop.body_population(**{"n": 1} | words)
