"""The tops of the study: their scales, the closed form at the times of samples, and the errors of many runs at once.

Everything is an array over members, because ten thousand scenes would take a hundred times the time of their runs. The
formulas are those of `symtop.measure.errors` and `symtop.model.scenes`, and tests compare both:

    axis, attitude   angle between, rad                      energy   |E - E0| / (E0 - p_psi^2/2 I3 - min V)
    momenta          the larger of |p_phi - ref| and |p_psi - ref|, over max(|p_phi|, |p_psi|)

A run of a variant with fixed step makes FIRST 2^k steps a nutation. Its samples fall on the same times at every k, a
dozen that are not commensurate with the nutation, so that the closed form is computed once. Their largest error is 93
to 100 % of that of 2000 samples in the median run, and half of it in one of twenty, for all variants alike. The
coarsest run is that coarse because a step of 14 stages meets 1e-6 at four a nutation.

The members are those of two populations, followed by the named scenes:

    strata     `symtop.population`: six kinds, chosen to include hard ones (25, 25, 15, 10, 10 and 15 % of the tops)
    natural    homogeneous spheroids that turn about a pole of their surface, let go anywhere. In units where
               I1 = mgl = 1 and time is counted in 1/g, g = sqrt(mgl/I1):
                   inertia     axes of ratio r, log-uniform from 1/4 to 4, so that I3/I1 = 0.4/(0.2 + 1.2 r^2)
                   axis        isotropic
                   spin        I3 w3 over the sleeping threshold 2 sqrt(I1 mgl), log-uniform from 1/16 to 32, either way
                   velocity    of the axis from 0 to 2 g, uniform, in any direction
    scene      the scenes of the catalogue with a nutation, each one top among the others
"""

import functools
import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from symtop_studies.grid import grid_scenes

from symtop.core.numbers import EPSILON, GOLDEN, TINY
from symtop.methods.framework.lanes import members_of
from symtop.model import charts, scenes
from symtop.model.charts import Array, View
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import NUMBERS, Angles, SymmetricTop, flat
from symtop.run.ensemble.chunks import together
from symtop.run.ensemble.population import STRATA, population
from symtop.run.reference.truth import ROUNDING

FIRST = 1.0925  # steps a nutation of the coarsest run
SAMPLES = 12
ASKED = ("axis", "attitude", "energy")  # quantities that have targets
MOMENTA = "momenta"
CLEAR = 0.1  # a target is asked where the error bound of the closed form is at most this part of it
NATURAL, SCENE = "natural", "scene"
KINDS = (*STRATA, NATURAL, SCENE)
DRAWS = 8  # uniform numbers of a natural top
LEFT_OUT = {  # tags of scenes, with the reason
    "repeats": "the same ranking shows",
    "steady": "no nutation: every target is wider than it",
    "unstable": "errors grow with the motion",
}
TOGETHER = 512  # members whose errors are computed at a time, so that intermediate arrays stay in the cache


def sample_marks(steps: int, samples: int = SAMPLES) -> NDArray[np.int64]:
    """After which of so many steps a run is sampled: golden fractions apart, the last step among them."""
    places = np.arange(1.0, samples + 1.0) + np.append(np.mod(GOLDEN * np.arange(1.0, samples), 1.0) - 0.5, 0.0)
    return np.unique(np.maximum(np.rint(places * steps / samples).astype(np.int64), 1))


class Samples(Protocol):
    """Samples of n runs, such as `symtop.methods.framework.lanes.Many`."""

    @property
    def states(self) -> Array:
        """States (n, samples, dimension)."""

    @property
    def momenta(self) -> Array:
        """p_phi and p_psi (n, samples, 2)."""


class Tops:
    """Tops and starts as rows (n, 9) of `NUMBERS`, followed for a number of nutations, and places in `KINDS`, (n,).

    Samples fall on whole steps of a run that makes `first` a nutation.
    """

    def __init__(
        self, numbers: Array, nutations: float, kinds: NDArray[np.int64] | None = None, *, first: float = FIRST,
        samples: int = SAMPLES,
    ) -> None:  # fmt: skip
        self.numbers, self.nutations = np.ascontiguousarray(numbers), nutations
        self.kinds = np.zeros(len(numbers), dtype=np.int64) if kinds is None else kinds
        self.forms = ClosedForms(self.numbers)
        self._members: dict[int, tuple[SymmetricTop, Angles]] = {}
        self.period = np.array(self.forms.nutation_period)
        self.marks = sample_marks(math.ceil(nutations * first), samples)
        self.times = self.marks * (self.period / first)[:, np.newaxis]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which members have a nutation and a closed form."""
        return np.isfinite(self.period) & (self.period > 0.0)

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """Axes (n, samples, 3) and quaternions (n, samples, 4)."""
        times = np.where(self.known[:, np.newaxis], self.times, 0.0)
        return self.forms.axis(times), self.forms.quaternion(times)

    @cached_property
    def momenta(self) -> tuple[Array, Array, Array, Array]:
        """p_phi, p_psi, p_phi - p_psi and p_phi + p_psi of the starts, each (n,)."""
        return scenes.start_momenta(self.numbers)

    @cached_property
    def energy(self) -> Array:
        """Total energy (n,)."""
        return scenes.start_energies(self.numbers)

    @cached_property
    def energy_scale(self) -> Array:
        """The divisor of energy errors, (n,): `Scene.energy_scale`, the energy of the nutation."""
        return scenes.energy_scales(self.numbers, self.forms.theta_range)

    @cached_property
    def width(self) -> Array:
        """Angle between the turning points, rad, (n,)."""
        return np.asarray(np.diff(self.forms.theta_range, axis=1)[:, 0])

    @cached_property
    def regime(self) -> Array:
        """Four numbers without units that fix the motion of the axis, (n, 4).

        cos(theta) at both turning points, and asinh of p_psi and p_phi over sqrt(I1 |mgl|). A top with mgl < 0 moves as
        one with -mgl whose axis is named the other way round: cos(theta) and p_psi change sign, p_phi does not.
        """
        I1, _, mgl = (self.numbers[:, k] for k in range(3))
        unit = np.sqrt(I1 * np.maximum(np.abs(mgl), TINY))
        high, low = np.cos(self.forms.theta_range.T)
        p_phi, p_psi = (np.arcsinh(p / unit) for p in self.momenta[:2])
        turned = self.numbers[:, 2] < 0.0
        low, high = np.where(turned, -high, low), np.where(turned, -low, high)
        return np.stack([low, high, np.where(turned, -p_psi, p_psi), p_phi], axis=1)

    def bounds(self) -> dict[str, Array]:
        """The least error of each quantity that can be judged against the closed form over the horizon, (n,).

        That of the axis and the attitude is the rounding of the closed form (`symtop.run.reference.truth`). Variants in
        the angles chart return phi and psi as doubles, whose rounding is an angle; it counts for all variants.
        """
        turns = (np.abs(self.forms.phi_per_period) + np.abs(self.forms.psi_per_period)) * self.nutations
        grain = (np.abs(self.energy) + np.abs(self.numbers[:, 2])) / self.energy_scale
        same = np.ones(len(self.period))
        energy = 4.0 * EPSILON * np.maximum(grain, 1.0)
        return {
            "axis": ROUNDING["axis"] * same, "attitude": ROUNDING["attitude"] + 0.5 * EPSILON * turns, "energy": energy
        }  # fmt: skip

    def asked(self, targets: Any) -> dict[str, NDArray[np.bool_]]:
        """Which targets are asked of which members, (targets, n): below the nutation's width, above the bound."""
        levels = np.asarray(targets)[:, np.newaxis]
        wide = (levels < self.width) & self.known
        return {name: wide & (bound <= CLEAR * levels) for name, bound in self.bounds().items()}

    def members(self, chosen: NDArray[np.int64]) -> Iterator[tuple[SymmetricTop, Angles]]:
        """The top and the start of each chosen member, made once and kept."""
        for k in chosen.tolist():
            member = self._members.get(k)
            if member is None:
                (member,) = members_of(self.numbers[k : k + 1])
                self._members[k] = member
            yield member

    def errors(self, chart: str, samples: Samples, chosen: NDArray[np.int64]) -> dict[str, Array]:
        """Largest error of each quantity of the chosen members' runs, (chosen,); inf after a failure.

        `attitude` is left out where the chart does not show it.
        """
        parts = [slice(begin, begin + TOGETHER) for begin in range(0, max(len(chosen), 1), TOGETHER)]
        pieces = [self._errors(chart, samples.states[part], samples.momenta[part], chosen[part]) for part in parts]
        return {name: np.concatenate([part[name] for part in pieces]) for name in pieces[0]}

    def _errors(self, chart: str, states: Array, momenta: Array, chosen: NDArray[np.int64]) -> dict[str, Array]:
        """The errors of a few members."""
        p_phi, p_psi = momenta[..., 0], momenta[..., 1]
        view = View(chart, together(self.numbers[chosen]), states, p_phi, p_psi)
        with np.errstate(all="ignore"):  # a run may have blown up
            errors = {"axis": charts.axis_distance(view.axis, self.truth[0][chosen])}
            if chart != "axis":
                errors["attitude"] = charts.attitude_distance(view.quaternion, self.truth[1][chosen])
            change = np.abs(view.energy - self.energy[chosen, np.newaxis])
            errors["energy"] = change / self.energy_scale[chosen, np.newaxis]
            start = [part[chosen, np.newaxis] for part in self.momenta[:2]]
            scale = np.maximum(np.maximum(np.abs(start[0]), np.abs(start[1])), TINY)
            errors[MOMENTA] = np.maximum(np.abs(p_phi - start[0]), np.abs(p_psi - start[1])) / scale
            largest = {name: values.max(axis=1) for name, values in errors.items()}
        return {name: np.where(np.isfinite(values), values, np.inf) for name, values in largest.items()}


def natural(members: int, seed: int) -> Array:
    """Tops and starts (members, 9) of the natural population; the first n of a larger one are those of the smaller."""
    integers = np.random.Philox([seed, 1]).random_raw(members * DRAWS) >> np.uint64(11)
    draw = (integers * 2.0**-53).reshape(members, DRAWS).T
    theta, ratio = np.arccos(1.0 - 2.0 * draw[0]), 0.4 / (0.2 + 1.2 * 16.0 ** (2.0 * draw[1] - 1.0))
    spin = np.where(draw[3] < 0.5, -2.0, 2.0) * 2.0 ** (9.0 * draw[2] - 4.0)  # I3 w3
    speed, way = 2.0 * draw[4], 2.0 * np.pi * draw[5]
    phi_dot = speed * np.sin(way) / np.sin(theta)
    ones = np.ones(members)
    columns = {
        "I1": ones, "I3": ratio, "mgl": ones, "theta": theta, "phi": np.pi * (2.0 * draw[6] - 1.0),
        "psi": np.pi * (2.0 * draw[7] - 1.0), "theta_dot": speed * np.cos(way), "phi_dot": phi_dot,
        "psi_dot": spin / ratio - phi_dot * np.cos(theta),
    }  # fmt: skip
    return np.stack([columns[name] for name in NUMBERS], axis=1)


def named() -> dict[str, Array]:
    """The nine numbers of each scene of the catalogue that has a nutation and repeats no other."""
    catalogue = {name: scenes.scene(name) for name in grid_scenes(LEFT_OUT)}
    chosen = {name: scene for name, scene in catalogue.items() if math.isfinite(scene.nutation_period)}
    return {name: np.array(flat(scene.top, scene.start)) for name, scene in chosen.items()}


@functools.lru_cache(maxsize=3)
def tops_of(strata: int, natural_tops: int, seed: int, nutations: float) -> Tops:
    """Tops of both populations and the named scenes; cached, as every variant runs the same."""
    draws = population(strata, seed=seed)
    parts = np.stack([draws[name].values for name in NUMBERS], axis=1), natural(natural_tops, seed), [*named().values()]
    places = [KINDS.index(name) for name in draws["stratum"].values]
    kinds = [*places, *[KINDS.index(NATURAL)] * natural_tops, *[KINDS.index(SCENE)] * len(parts[2])]
    return Tops(np.concatenate([np.reshape(part, (-1, len(NUMBERS))) for part in parts]), nutations, np.array(kinds))
